/*
 * lobe.h — D(phi): how many facets of a gloss lobe lean by phi, relative to those that lie flat.
 *
 * Gaussian D = exp(-ln2 phi^2 / gamma^2); heavy tail D = (1 + (2^tail - 1) phi^2 / gamma^2)^(-1 / tail), whose
 * tail = 0 is the Gaussian. D(0) = 1 and gamma is the half width at half maximum for every tail.
 * Domain     phi_rad finite, gamma > 0, tail in 0 .. 2. A value that underflows is 0; then the slopes mean nothing.
 * Source     reflection-model.md 1.3, 6; measurement.md 10.
 * Checked    tests/unit/test_reflectance.c, test_reflectance_models.c against MPFR at 120 digits.
 */
#ifndef FIT_LOBE_H
#define FIT_LOBE_H

#ifdef __cplusplus
extern "C" {
#endif

struct lobe_tail { /* what depends on tail alone */
    double tail;
    double strength; /* (2^tail - 1) / tail; ln 2 at 0 */
    double bend;     /* (w / (1 - e^-w) - 1) / tail, w = tail ln 2 */
};

struct lobe {
    double value;
    double by_gamma, by_tail; /* d ln D / d gamma, d ln D / d tail */
};

struct lobe lobe_gaussian(double phi_rad, double gamma);
struct lobe_tail lobe_tail_of(double tail);
struct lobe lobe_tailed(const struct lobe_tail *t, double phi_rad, double gamma);

#ifdef __cplusplus
}
#endif

#endif
