/*
 * fresnel.h — what a smooth dielectric surface of relative index n reflects and lets through.
 *
 * F = ((1 + P) R_s + (1 - P) R_p) / 2 of light with degree of polarisation P, and T = (T_s + T_p) / 2 of
 * unpolarised light, both at angle theta to the normal, without cancellation from n - 1 = 1e-12 to grazing.
 * Shapes     cos_q, sin2_q: cosine and squared sine of the angle, each exact to the last bits by itself.
 * Domain     0 < cos_q <= 1, n > 1 (T: n >= 1), |P| <= 1.
 * Source     reflection-model.md 1.6, 2.2; measurement.md 7.
 * Checked    tests/unit/test_reflectance.c, test_reflectance_models.c against MPFR at 120 digits.
 */
#ifndef FIT_FRESNEL_H
#define FIT_FRESNEL_H

#ifdef __cplusplus
extern "C" {
#endif

double fresnel_reflectance(double cos_q, double sin2_q, double n, double polarisation,
                           double *slope);                                /* d / dn */
double fresnel_polarisation_slope(double cos_q, double sin2_q, double n); /* dF / dP = (R_s - R_p) / 2 */
double fresnel_transmittance(double cos_q, double n, double *log_slope);  /* d ln T / dn */
double fresnel_transmittance_normal(double n, double *log_slope);         /* T at theta = 0 */

#ifdef __cplusplus
}
#endif

#endif
