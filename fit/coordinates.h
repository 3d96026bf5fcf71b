/*
 * coordinates.h — the parametrisation of the fit: (ln S, ln sigma, ln gamma, ln A, ln(n - 1)).
 *
 * A = beta' F(45 deg, n), the height of the lobe at 45 deg, is nearly uncorrelated with n where beta' is not
 * (reflection-model.md 3.3). x[k] by the model's columns (reflectance_parameter), value[] by enum
 * material_parameter. Bounds are those of measurement.md 10; A is held within 1e-7 .. 1e7.
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
/* chain[i * k + j] = d value(column i) / d x[j] */
void coordinates_chain(enum reflectance_model model, const double *value, double *chain);

#ifdef __cplusplus
}
#endif

#endif
