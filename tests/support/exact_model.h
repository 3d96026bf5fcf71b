/*
 * exact_model.h — the reflection models in textbook form at 120 digits (MPFR), for judging fit/reflectance.c.
 *
 * Vectors, acos, Blinn's G, the printed Fresnel formula: none of the stable forms of the code under test.
 * Derivatives are central differences with a relative step of 1e-40, exact to about 80 digits.
 */
#ifndef TESTS_EXACT_MODEL_H
#define TESTS_EXACT_MODEL_H

#include "fit/reflectance.h"

/* A far lobe is a denormal number times what may be large: its last digits are lost. */
#define EXACT_DENORMAL 1e-260

struct exact_case {
    enum reflectance_model model;
    double theta_i_deg, theta_r_deg, dphi_deg;
    double value[MATERIAL_PARAMETERS];
    double kappa_q, polarisation;
};

struct exact_values {
    double phi_rad, visibility, fresnel,
        transmission;         /* transmission = T T / T(0)^2; 1 where there is none */
    double log_d[2], lobe[2]; /* of each lobe; lobe = D */
    double l1, l1_terms;      /* l1_terms: sum of the absolute values of its terms */
    double l2;
    double specular[2]; /* of each lobe */
    double unpolarised; /* F at P = 0 over F: near the angle of Brewster one polarisation cancels */
    double by_polarisation;
};

struct exact_slopes {                 /* by enum material_parameter */
    double beta[MATERIAL_PARAMETERS]; /* d beta / d parameter */
    double terms
        [MATERIAL_PARAMETERS]; /* sum of the absolute values of its terms, times 1 + 2 |ln D| where D occurs */
};

/* Signed theta_v_deg in plane, as reflectance_geometry has it. */
struct exact_case exact_in_plane(enum reflectance_model model, double theta_i_deg, double theta_v_deg,
                                 const double *value, const struct reflectance_optics *optics);
void exact_evaluate(const struct exact_case *at, struct exact_values *out);
void exact_differentiate(const struct exact_case *at, struct exact_slopes *out);
void exact_free_caches(void);

#endif
