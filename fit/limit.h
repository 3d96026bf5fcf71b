/*
 * limit.h — the one-sided 95 % limit of a parameter that sits at its bound, from its profile likelihood.
 *
 * The parameter is held further and further from the bound and all others are fitted anew; the limit is where
 * chi-square has risen by 2.71 (the square of the normal's one-sided 95 % point), times the scale.
 * Checked    tests/unit/test_estimate_limits.c
 */
#ifndef FIT_LIMIT_H
#define FIT_LIMIT_H

#include "fit/solve.h"

#ifdef __cplusplus
extern "C" {
#endif

/* best: the fit with the parameter at its bound; scale: of the cost, so that a rise of one is one variance. limit is in coordinates. Where chi-square never
 * rises so far within the bounds, *found is false and limit the other bound. */
int limit_find(const struct problem *p, const struct solve_result *best, int column, double scale,
               double *at_limit, bool *found, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
