/*
 * quality.h — how well a fit describes its points, and whether its parameters make physical sense.
 *
 * Checked    tests/unit/test_fit_parts.c
 */
#ifndef FIT_QUALITY_H
#define FIT_QUALITY_H

#include "fit/problem.h"

#define QUALITY_Z_999 3.090232306167813 /* the standard normal passes it once in 1,000 times */

#ifdef __cplusplus
extern "C" {
#endif

/* Value that a chi-square of this mean and variance passes once in 1,000 times (a scaled chi-square of the
 * same two moments, by Wilson and Hilferty 1931). */
double quality_chi2_limit(double mean, double variance);
/* Bayesian information criterion; n_effective of the n points count (measurement.md 10). chi2 in units of u where u is
 * stated; else of the common unknown variance only the logarithm tells. */
double quality_bic(double chi2, double n, double n_effective, int n_parameters, bool u_stated);
double quality_r2(const struct problem *p); /* of the last evaluation, unweighted */
int quality_median_error(const struct problem *p, double *error, struct err *e); /* measurement.md 10 */
/* w = (4 beta' / pi) * integral of D cos(phi) over the hemisphere, summed over lobes (measurement.md 10); physical up to
 * 1, and 0 for a model without gloss. */
double quality_specular_energy(enum reflectance_model model, const double *value);
/* Smallest mirror angle (theta_i = theta_v) at which Oren and Nayar's direct term is negative; NaN: nowhere.
 */
double quality_negative_from_deg(double sigma);

#ifdef __cplusplus
}
#endif

#endif
