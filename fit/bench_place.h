/*
 * bench_place.h — where and when figures were measured: what a report of a bench begins with.
 *
 * Units      none. A text that could not be found is "unknown".
 * Checked    tests/unit/test_bench_fit.py, tests/unit/test_goniorender.py: in the reports
 */
#ifndef FIT_BENCH_PLACE_H
#define FIT_BENCH_PLACE_H

struct bench_place {
    char date[32], commit[64], cpu[128];
    char system[96]; /* compiler and kernel */
};

void bench_place_find(struct bench_place *place);

#endif
