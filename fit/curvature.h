/*
 * curvature.h — the second derivatives that J^T W J lacks: sum over points of weighted residual times the model's own.
 *
 * With them a Newton step is exact, and what it leaves goes as its square. Known in closed form for the surfaces with one
 * Gaussian lobe or none, where the residual is linear in beta and each point is seen as one geometry by itself.
 * In the coordinates of the fit the diffuse part needs three sums over points, the lobe three more; the rest is the
 * gradient. With z = ln D: d ln D / d ln gamma = -2 z.
 * Shapes     columns of one block as fit/normal_equations.c has them (n mixed with beta'), padded with weight 0; second[k * k].
 * Promises   no allocation; the same bits by every width of the processor.
 * Checked    tests/unit/test_refit.c against differences of gradients
 */
#ifndef FIT_CURVATURE_H
#define FIT_CURVATURE_H

#include "fit/problem.h"

#ifdef __cplusplus
extern "C" {
#endif

#define CURVATURE_SUMS 6

struct curvature_columns { /* of the points first .. first + n - 1 */
    size_t first, n;
    const double *by_height, *by_n, *by_n_twice; /* NULL: the model has no lobe */
    const double *root_weight, *residual;
};

bool curvature_known(const struct problem *p);
void curvature_add(const struct problem *p, const double *value, const struct curvature_columns *c,
                   double sum[CURVATURE_SUMS]);
/* False where a sum is no number. chain and jtr as in fit/normal_equations.h. */
bool curvature_form(const struct problem *p, const double *value, const double *chain, const double *jtr,
                    const double sum[CURVATURE_SUMS], double *second);

#ifdef __cplusplus
}
#endif

#endif
