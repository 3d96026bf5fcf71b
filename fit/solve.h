/*
 * solve.h — one minimisation: the bounded least-squares solver behind a C face.
 *
 * Minimises sum of ((model - beta) root_weight)^2 over x (coordinates.h) inside the bounds, from a start,
 * with any of the coordinates held. The only file that knows Ceres; its logging is silenced and its inputs
 * are checked before it sees them, since some bad input makes it end the process.
 * Errors     -ERR_FIT the solver failed (its own words); -ERR_NOMEM.
 * Checked    tests/unit/test_estimate.c, tests/unit/test_estimate_input.c
 */
#ifndef FIT_SOLVE_H
#define FIT_SOLVE_H

#include "fit/problem.h"

#ifdef __cplusplus
extern "C" {
#endif

struct solve_result {
    double x[COORDINATES_MAX];
    double chi2;
    bool converged;
    int iterations;
};

/* held[k] may be NULL. trace may be NULL; steps are appended. */
int solve_run(const struct problem *p, const double *start, const bool *held, struct solve_result *result,
              struct estimate_trace *trace, struct err *e);

const char *solve_name(void); /* the solver and its version */

#ifdef __cplusplus
}
#endif

#endif
