/*
 * solve.h — one minimisation: the least-squares solvers behind a C face.
 *
 * Minimises sum of ((model - beta) root_weight)^2 over x (coordinates.h) inside the bounds, from a start, with any of
 * the coordinates held. By default with Ceres' TinySolver on the normal equations of one pass (fit/normal_equations.h); where a
 * step meets a bound, where the scaled Jacobian's condition passes 1e6 (the normal equations then lose the digits that
 * decide) or where it does not settle, Ceres' Solver with bounds and dense QR goes on from there.
 * Promises   nothing is allocated unless Solver is called; the same inputs give the same bits.
 * Errors     -ERR_FIT the solver failed (its own words); -ERR_NOMEM. Bad input never reaches Ceres, which may end the
 *            process on it.
 * Checked    tests/unit/test_solve.c, test_refit.c, test_estimate.c, test_estimate_input.c
 */
#ifndef FIT_SOLVE_H
#define FIT_SOLVE_H

#include "fit/normal_equations.h"

#ifdef __cplusplus
extern "C" {
#endif

enum solve_method {
    SOLVE_TINY,    /* TinySolver, handing over: the default */
    SOLVE_QR,      /* Solver, dense QR */
    SOLVE_CHOLESKY /* Solver, dense normal equations by Cholesky */
};

/* The last pass of a fit over its n points. A fit of these and some more may begin from it. */
struct solve_pass {
    size_t n; /* 0: there is none */
    double x[COORDINATES_MAX];
    struct normal_equations sums;
};

struct solve_result {
    double x[COORDINATES_MAX];
    double chi2;
    bool converged;
    int iterations;
    const char *handed_over; /* why TinySolver left the end to Solver; NULL: it did not */
    struct solve_pass last;  /* of TinySolver with nothing held */
};

/* held[k] may be NULL. trace may be NULL; steps are appended. */
int solve_run(const struct problem *p, const double *start, const bool *held, struct solve_result *result,
              struct estimate_trace *trace, struct err *e);
/* A refit after more points: the first before->n of p are those of that fit, at the same weights and without nuisances.
 * Where there is no such pass it begins at result->x. result is start and end; may hold before. */
int solve_more(const struct problem *p, const struct solve_pass *before, struct solve_result *result,
               struct err *e);
int solve_by(enum solve_method method, const struct problem *p, const double *start, const bool *held,
             struct solve_result *result, struct estimate_trace *trace, struct err *e);

const char *solve_name(enum solve_method method); /* with the version of Ceres */

#ifdef __cplusplus
}
#endif

#endif
