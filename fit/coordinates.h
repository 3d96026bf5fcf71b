/*
 * coordinates.h — the parametrisation of the fit: (ln S, ln sigma, ln gamma, ln A, ln(n - 1)), and for the
 * richer models tail itself, ln(n_d - 1), ln gamma_2, ln A_2.
 *
 * A = beta' F(45 deg, n), the height of the lobe at 45 deg, is nearly uncorrelated with n where beta' is not
 * (reflection-model.md 3.3). x[k] by the model's columns (reflectance_parameter), value[] by enum
 * material_parameter. Bounds are those of measurement.md 10; A is held within 1e-7 .. 1e7, n_d within 1.01 .. 3.
 * Two lobes are told apart by their widths alone: coordinates_order puts the narrower first.
 * Checked    tests/unit/test_fit_parts.c
 */
#ifndef FIT_COORDINATES_H
#define FIT_COORDINATES_H

#include "fit/reflectance.h"

#define COORDINATES_MAX 8

#ifdef __cplusplus
extern "C" {
#endif

void coordinates_bounds(enum reflectance_model model, double *low, double *high);
void coordinates_from_value(enum reflectance_model model, const double *value, double *x);
void coordinates_to_value(enum reflectance_model model, const double *x, double *value);
void coordinates_order(enum reflectance_model model, double *x);
/* chain[i * k + j] = d value(column i) / d x[j] */
void coordinates_chain(enum reflectance_model model, const double *value, double *chain);
/* d value(column) / d x[column]: the size by which an uncertainty of it is judged (1 for tail). */
double coordinates_scale(enum reflectance_model model, const double *value, int column);

#ifdef __cplusplus
}
#endif

#endif
