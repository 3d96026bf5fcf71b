/*
 * estimate.h — the material parameters that explain a set of radiance factors, with their uncertainty.
 *
 * Weighted least squares of the visible means: weights from u_ind and the independent angle part, recomputed
 * from the model once; bounds of measurement.md 10; q from S(lambda) in two passes; covariance H V H^T with
 * H = (J^T W J)^-1 J^T W, in a statistical part (u_ind, axis repeatability, drift) and a common part (named
 * common causes, axis zeros). Too few angles, or angles that cannot tell a parameter, are an answer
 * (estimate.refusal, estimate.not_identifiable), not an error.
 *
 * Shapes     n points; band arrays are [n * BANDS], row by row, NaN = missing. A common cause or a bracket
 *            names the points it touches by index; NULL means all points in order.
 * Units      degrees; u_* are standard uncertainties; drift: relative variance per second, microseconds.
 * Domain     |theta| < 90 deg; beta finite, of any sign; u_ind finite, >= 0 (values under 1e-5 beta + 1e-7
 *            are raised to it). u_ind NULL: unweighted, uncertainty from the scatter, and a warning says so.
 * Errors     -ERR_RANGE an angle or value outside the domain (the sentence names the point); -ERR_USAGE an
 *            unknown model; -ERR_FIT the solver failed, with its reason; -ERR_NOMEM. Never aborts.
 * Source     measurement.md 3, 5, 6, 8, 10; reflection-model.md 3.
 * Checked    tests/unit/test_estimate.c, test_estimate_input.c
 */
#ifndef FIT_ESTIMATE_H
#define FIT_ESTIMATE_H

#include <stdbool.h>
#include <stddef.h>

#include "proto/err.h"
#include "proto/material.h"

#ifdef __cplusplus
extern "C" {
#endif

struct estimate_common { /* one cause; the signed change of beta for one standard uncertainty of it */
    size_t n;
    const int *point;    /* [n] or NULL: all points, n ignored */
    const double *mean;  /* [n] of the visible mean */
    const double *bands; /* [n * BANDS], or NULL: in proportion to the mean's */
};

struct estimate_bracket { /* drift between two reference readings (measurement.md 3) */
    size_t n;
    const int *point;       /* [n] or NULL: all points, n ignored */
    const double *tau_us;   /* [n] sample reading since the bracket opened */
    const double *tau_r_us; /* [n] reference reading it was divided by, or NULL: the opening one (0) */
    double length_us;       /* <= 0: not closed yet */
    double rate;            /* r, relative variance per second */
};

/* Which spot lies inside the other, and where the reference was read: fit/spot.h. */
enum estimate_filling { ESTIMATE_FILLING_UNKNOWN, ESTIMATE_VIEW_IN_BEAM, ESTIMATE_BEAM_IN_VIEW };
enum estimate_reference { ESTIMATE_REFERENCE_FIXED, ESTIMATE_REFERENCE_INCIDENCE, ESTIMATE_REFERENCE_OWN };

struct estimate_step { /* one iteration of the solver, over all passes */
    double t_us, cost;
    double x[8]; /* fit/coordinates.h */
};

#define ESTIMATE_TRACE_MAX 128
struct estimate_trace {
    size_t n;
    struct estimate_step step[ESTIMATE_TRACE_MAX];
};

struct estimate_input {
    size_t n;
    const double *theta_i_deg, *theta_v_deg; /* [n] */
    const bool *mirrored;                    /* [n] both axes negated, or NULL: none */
    const double *beta, *u_ind;              /* [n] visible mean; u_ind may be NULL */
    const double *band_beta, *band_u_ind;    /* [n * BANDS] or NULL */
    size_t n_common;
    const struct estimate_common *common;
    size_t n_bracket;
    const struct estimate_bracket *bracket;
    double u_repeat_source_deg, u_repeat_sample_deg; /* independent per move */
    double u_zero_source_deg, u_zero_sample_deg;     /* common */
    enum estimate_filling filling;                   /* unknown: axis errors move the surface's angles only */
    enum estimate_reference reference;               /* its angle: fixed, the point's theta_i, or both */
    double kappa;                                    /* 1, or pi for the paper's printed form */
    double q;                                        /* of a surface without band_beta; 0: 1 */
    bool q_is_one;                                   /* the paper's own use */
    bool unweighted;                                 /* the paper's Eq. 6 */
    bool any_provisional;
    int mean_low_nm, mean_high_nm;
    const char *model;                   /* reflectance_name */
    struct estimate_trace *trace;        /* filled where not NULL */
    double polarisation, u_polarisation; /* P of source and sensor together; with a u it is fitted */
    bool polarisation_unknown; /* P is taken as 0, and the estimate says what |P| <= 0.1 would change */
    bool hold_offset; /* the mirror direction is not fitted, but enters as both zeros do (fit/nuisance.h) */
    double source_width_deg, sensor_width_deg; /* angular, full (fit/aperture.h) */
    /* Low and high bound by enum material_parameter in place of the usual ones, NaN = the usual one; or NULL. That
     * of beta' stays: it is none of beta' but of A (coordinates.h). */
    const double (*bound)[2];
    /* Azimuth between source and sensor where a point lies out of the plane of incidence, 0 where it lies in it; then
     * theta_v_deg is theta_r with the sign of its half space. NULL: all in plane. */
    const double *delta_phi_deg;
    const double *band_cov_next; /* [n * BANDS] covariance of a band with the next one, NaN = none; or NULL */
    bool cross_validate;         /* estimate.loio is wanted */
    enum material_loss loss;     /* fit/loss.h; ml without u_ind, or unweighted, is ols */
};

int estimate_fit(const struct estimate_input *input, struct estimate *estimate, struct err *e);

/* d beta / d axis per degree at n geometries, for the source and for the sample axis (theta_v = sample,
 * theta_i = source - sample; mirrored: both negated). */
int estimate_axis_slopes(const struct estimate *estimate, size_t n, const double *theta_i_deg,
                         const double *theta_v_deg, const bool *mirrored, double *source, double *sample,
                         struct err *e);

#ifdef __cplusplus
}
#endif

#endif
