/*
 * exact_model.h — the reflection model in textbook form at 120 digits (MPFR), for judging fit/reflectance.c.
 *
 * Vectors, acos, Blinn's G, the printed Fresnel formula: none of the stable forms of the code under test.
 * Derivatives are central differences with a relative step of 1e-40, exact to about 80 digits.
 */
#ifndef TESTS_EXACT_MODEL_H
#define TESTS_EXACT_MODEL_H

enum { EXACT_S, EXACT_SIGMA, EXACT_GAMMA, EXACT_BETA_PRIME, EXACT_N, EXACT_PARAMETERS };

struct exact_values {
    double phi_rad, visibility, fresnel, log_d, lobe; /* lobe = D */
    double l1, l1_terms;                              /* l1_terms: sum of the absolute values of its terms */
    double l2;
    double specular;
};

struct exact_slopes {
    double beta[EXACT_PARAMETERS];  /* d beta / d parameter */
    double terms[EXACT_PARAMETERS]; /* the size against which an error of the slope is judged */
};

void exact_evaluate(double theta_i_deg, double theta_v_deg, const double *value, double kappa_q,
                    struct exact_values *out);
void exact_differentiate(double theta_i_deg, double theta_v_deg, const double *value, double kappa_q,
                         struct exact_slopes *out);
void exact_free_caches(void);

#endif
