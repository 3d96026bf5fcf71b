/*
 * bench_run.h — how long the solvers take on one case: ours, and those of other libraries by their own program.
 *
 * Cold is a fit from the case's start, warm one from the optimum without the last point, TinySolver's from what that fit
 * left; both are medians over repeats, each repeat timed by itself, geometry and weights ready; of several rounds the
 * quietest. A trace is one more fit, watched iteration by iteration.
 * The others' program is called `PROGRAM CASE.csv REPEATS` and prints a record a line:
 *     solver,kernel,cold|warm|trace,t_us,chi2,evaluations,x...
 * kernel: "goniod" the model of fit/reflectance_batch.h, "plain" a scalar one written for the comparison.
 * Errors     -ERR_NOMEM; -ERR_IO, -ERR_INPUT of the others' program.
 * Checked    tests/unit/test_bench_fit.py, at small size
 */
#ifndef FIT_BENCH_RUN_H
#define FIT_BENCH_RUN_H

#include "fit/bench_case.h"

enum bench_what { BENCH_COLD, BENCH_WARM, BENCH_TRACE };

struct bench_record {
    char of[48], solver[40], kernel[12];
    enum bench_what what;
    double t_us, chi2, x[COORDINATES_MAX];
    int evaluations;
};

struct bench_records {
    struct bench_record *item;
    size_t n, capacity;
    bool again;         /* one more round: what is there already keeps the lower time, and its trace */
    char versions[256]; /* of the others' libraries */
};

int bench_run_ours(const struct bench_case *c, int repeats, struct bench_records *records, struct err *e);
/* command[]: program and its first arguments, NULL at the end. */
int bench_run_others(const struct bench_case *c, const char *const *command, int repeats, const char *dir,
                     struct bench_records *records, struct err *e);
/* Variable projection of the bands there are. */
int bench_run_joint(const struct bench_case *c, int repeats, struct bench_records *records, struct err *e);
const struct bench_record *bench_find(const struct bench_records *records, const char *of, const char *solver,
                                      const char *kernel, enum bench_what what);
void bench_records_free(struct bench_records *records);
double bench_median(double *value, int n); /* sorts */

#endif
