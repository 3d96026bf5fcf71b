/*
 * bench_report.h — what goniofit bench found: fit-report.md, and beside it the CSV and log-log plots it was drawn from.
 * Checked    tests/unit/test_bench_fit.py, at small size
 */
#ifndef FIT_BENCH_REPORT_H
#define FIT_BENCH_REPORT_H

#include "fit/bench_run.h"

#define BENCH_CASES_MAX 8

struct bench_results {
    struct bench_case *fits; /* [n_fits] the published sets first, then measured surfaces */
    int n_fits, n_published;
    struct bench_records of_fits;
    struct bench_records of_points; /* of[] is the number of points */
    struct bench_records of_bands;  /* of[] is the number of bands */
    double geometry_us;             /* angles and weights of 198 points, before any fit */
    int repeats, rounds;
};

/* DIR/fit-report.md, DIR/fit-report/NAME.csv, .gp, .svg, .pdf. Without gnuplot the report says so. */
int bench_report_write(const struct bench_results *results, const char *dir, struct err *e);

#endif
