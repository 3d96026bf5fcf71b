/*
 * estimate.h — the material parameters that explain a set of radiance factors, with their uncertainty.
 *
 * Weighted least squares of the visible means (weights from u_ind and the independent angle part), bounds of
 * measurement.md 10, q from S(lambda) in two passes, covariance H V H^T in a statistical and a common part.
 * Too few angles, or angles that cannot tell a parameter, are an answer (estimate.refusal, not_identifiable),
 * not an error. C face of fit/estimate.cc (Ceres); every entry catches all exceptions. Errors     -ERR_RANGE
 * an angle or value outside the domain; -ERR_FIT the solver failed, with its reason. Checked
 * tests/unit/test_estimate.c
 */
#ifndef FIT_ESTIMATE_H
#define FIT_ESTIMATE_H

#include <stdbool.h>
#include <stddef.h>

#include "proto/err.h"
#include "proto/material.h"

#define ESTIMATE_COMMON_MAX 4096

struct estimate_common { /* one common cause over all points: change of the mean for one standard uncertainty
                          */
    double *sensitivity; /* [n] */
    const double *band_sensitivity; /* [n * BANDS] or NULL */
};

struct estimate_input {
    size_t n;
    const double *theta_i_deg, *theta_v_deg; /* [n] */
    const double *beta, *u_ind;              /* [n] visible mean */
    const double *band_beta, *band_u_ind;    /* [n * BANDS] or NULL; NaN = missing */
    size_t n_common;
    const struct estimate_common *common;
    const double *drift_cov; /* [n * n] covariance of the drift of the means, or NULL */
    double u_repeat_source_deg, u_repeat_sample_deg; /* independent per move */
    double u_zero_source_deg, u_zero_sample_deg;     /* common */
    double kappa;
    bool q_is_one;   /* the paper's own use */
    bool unweighted; /* the paper's Eq. 6 */
    bool any_provisional;
    int mean_low_nm, mean_high_nm;
    const char *model; /* lambert | oren-nayar | eq1 | composite */
};

int estimate_fit(const struct estimate_input *input, struct estimate *estimate, struct err *e);

#endif
