/*
 * bench_case.h — one problem for goniofit bench: points, weights, a start, and where it is known the truth.
 *
 * Made-up cases have the noise of reflection-model.md section 3, sd = sqrt((0.005 beta)^2 + 0.001^2), on its grid (theta_i
 * 10..60 by 10, theta_v -80..80 by 5: 198 points) or on any number of points spread evenly over the same range; their start
 * is the truth with every parameter 15 % off, up and down in turn, and n - 1 by 7.5 %. Measured surfaces start where the
 * estimation does (fit/start.h).
 * Errors     -ERR_NOMEM, -ERR_INPUT, -ERR_IO.
 * Checked    tests/unit/test_bench_fit.py, at small size
 */
#ifndef FIT_BENCH_CASE_H
#define FIT_BENCH_CASE_H

#include <stdint.h>

#include "fit/fitset.h"
#include "fit/published.h"
#include "fit/solve.h"

struct bench_case {
    char name[48];
    struct fitset data;
    struct problem p;
    bool has_truth;
    double truth[COORDINATES_MAX], start[COORDINATES_MAX];
    double warm[COORDINATES_MAX];    /* the optimum without the last point */
    struct solve_pass left;          /* what TinySolver's fit without that point left */
    double optimum[COORDINATES_MAX]; /* set by bench_case_settle */
    double chi2;
};

/* points 0: the grid. bands > 0: as many bands of a coloured surface, the mean following from them. */
int bench_case_make(struct bench_case *c, const struct published *set, size_t points, int bands,
                    uint64_t seed, struct err *e);
/* A .brdf of a painted surface as reflection-model.md section 6 fits it: 80 points, 5 % (+) 0.005. */
int bench_case_read(struct bench_case *c, const char *path, struct err *e);
/* warm, optimum and chi2. */
int bench_case_settle(struct bench_case *c, struct err *e);
void bench_case_free(struct bench_case *c);

#endif
