/*
 * profile.h — whether chi-square really rises around a minimum as a parameter's stated u says it does.
 *
 * A u is that of the parabola at the minimum. Where a parameter is nearly told by nothing (sigma of a smooth surface,
 * a lobe between the samples, n of a metal) the true chi-square is flat or one-sided, and the parabola claims too much.
 * The parameter is moved 3 and 6 u to either side, or to its bound, all others are fitted anew, and the factor is told
 * by which u must grow for the rise to be what it should be. A steeper rise shrinks nothing.
 * Checked    tests/unit/test_stability.c, tests/unit/test_estimate_limits.c
 */
#ifndef FIT_PROFILE_H
#define FIT_PROFILE_H

#include "fit/solve.h"

#ifdef __cplusplus
extern "C" {
#endif

#define PROFILE_FROM 0.03 /* of a coordinate's u: smaller ones were never found to be off (fit/stability.h) */

/* u of the coordinate; scale: the rise of chi-square that one u stands for (1 where the weights tell all). */
int profile_stretch(const struct problem *p, const struct solve_result *best, int column, double u,
                    double scale, double *stretch, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
