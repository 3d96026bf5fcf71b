/*
 * cholesky.h — small symmetric systems, k <= COORDINATES_MAX: A = L L^T, without allocation.
 *
 * Shapes     a, l, inverse [k * k] row by row; l lower, its upper part is left alone; b, x [k].
 * Returns    false where A is not positive definite to the last digits of a double; nothing may be used then.
 * Checked    tests/unit/test_solve.c
 */
#ifndef FIT_CHOLESKY_H
#define FIT_CHOLESKY_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

bool cholesky_factor(int k, const double *a, double *l);
void cholesky_lower(int k, const double *l, const double *b, double *y); /* L y = b; y may be b */
void cholesky_solve(int k, const double *l, const double *b, double *x); /* A x = b; x may be b */
/* Condition of A scaled to a unit diagonal, in the row-sum norm; infinite where A is singular. */
double cholesky_condition(int k, const double *a);

#ifdef __cplusplus
}
#endif

#endif
