/*
 * normal_equations.h — one pass over the points of a fit: J^T W J, J^T W r and r^T W r at once, in the coordinates of the fit.
 *
 * All that Gauss, Newton and Levenberg ask of the points; the Jacobian itself is never stored. Points are taken in
 * blocks that stay in the first-level cache, so that the pass costs its arithmetic alone.
 * Shapes     jtj[k * k] row by row, both triangles; jtr[k]; k columns of the model.
 * Promises   no allocation; the same inputs give the same bits.
 * Errors     -ERR_RANGE x stands for parameters outside the model's domain, or the cost is no number.
 * Checked    tests/unit/test_solve.c, test_refit.c
 */
#ifndef FIT_NORMAL_EQUATIONS_H
#define FIT_NORMAL_EQUATIONS_H

#include "fit/problem.h"

#ifdef __cplusplus
extern "C" {
#endif

struct normal_equations {
    double chi2; /* r^T W r */
    double jtr[COORDINATES_MAX];
    double jtj[COORDINATES_MAX * COORDINATES_MAX];
};

int normal_equations_form(const struct problem *p, const double *x, struct normal_equations *s,
                          struct err *e);
/* The same, and second[k * k]: what J^T W J lacks of the second derivatives, where fit/curvature.h knows them. */
int normal_equations_curved(const struct problem *p, const double *x, struct normal_equations *s,
                            double *second, bool *known, struct err *e);
/* Adds the points from first on to the sums of those before them; without nuisances, which tie all points together. */
int normal_equations_add(const struct problem *p, const double *x, size_t first, struct normal_equations *s,
                         struct err *e);

#ifdef __cplusplus
}
#endif

#endif
