/*
 * normal_equations.h — one pass over the points of a fit: J^T W J, J^T W r and r^T W r at once, in the coordinates of the fit.
 *
 * All that Gauss, Newton and Levenberg ask of the points; the Jacobian itself is never stored. Points are taken in
 * blocks that stay in the first-level cache, so that the pass costs its arithmetic alone.
 * Shapes     jtj[k * k] row by row, both triangles; jtr[k]; k columns of the model.
 * Promises   no allocation; the same inputs give the same bits.
 * Errors     -ERR_RANGE x stands for parameters outside the model's domain, or the cost is no number.
 * Checked    tests/unit/test_solve.c
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

#ifdef __cplusplus
}
#endif

#endif
