/*
 * solve_tiny.h — Ceres' TinySolver on the normal equations of one pass.
 *
 * A pass over the points (fit/normal_equations.h) is one place of fit/tiny_descent.h, and the only cost over the points.
 * It ends before its last step is taken, once that step is small; the step is taken here, at no further pass, and by the
 * whole second derivatives where fit/curvature.h knows them: what it leaves is below 1e-9.
 * A pass that is known already, result->last at result->x over all points, is not done again.
 * Promises   no allocation. result->x is start and end, inside the bounds; result->last its last pass.
 * Returns    NULL settled; else why another solver should go on from result->x, in words.
 * Checked    tests/unit/test_solve.c
 */
#ifndef FIT_SOLVE_TINY_H
#define FIT_SOLVE_TINY_H

#include "fit/solve.h"

#ifdef __cplusplus
extern "C" {
#endif

const char *solve_tiny(const struct problem *p, const bool *held, struct solve_result *result,
                       struct estimate_trace *trace);

#ifdef __cplusplus
}
#endif

#endif
