/*
 * solve_bounded.h — Ceres' Solver with its bounds: slower than TinySolver, and right where that one is not.
 *
 * One of the two engines of fit/solve.h, which checks what goes in. result->x is start and end.
 * Errors     -ERR_FIT the solver failed, in its own words. May throw std::bad_alloc.
 * Checked    tests/unit/test_solve.c
 */
#ifndef FIT_SOLVE_BOUNDED_H
#define FIT_SOLVE_BOUNDED_H

#include "fit/solve.h"

#ifdef __cplusplus
extern "C" {
#endif

int solve_bounded(const struct problem *p, const bool *held, bool normal_equations,
                  struct solve_result *result, struct estimate_trace *trace, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
