/*
 * material.h — what an estimation says about a surface: parameters, their covariance, and the spectrum S(lambda).
 *
 * The one struct handed from estimation to session, status and rendering, with its JSON form (design 10).
 * kappa, q and the wavelength range travel with every parameter set. Standard uncertainties are totals unless
 * a name says otherwise: std^2 = statistical + common, on the diagonal.
 *
 * Shapes     value[], at_bound[], ... and rows and columns of the covariances are indexed by enum
 *            material_parameter; only those of the model (material_parameter_name is not NULL) have a meaning.
 * JSON       matrices (correlation, covariance_statistical, covariance_common) have their rows in the order of
 *            "order"; the covariances, range and spectrum keep to the last bit what the rest shows in short. NaN is
 *            null, an infinite number the text "inf" or "-inf".
 * Errors     estimate_from_json: -ERR_INPUT naming the key; *estimate is then unspecified.
 * Checked    tests/unit/test_material.c
 */
#ifndef PROTO_MATERIAL_H
#define PROTO_MATERIAL_H

#include <stdbool.h>
#include <jansson.h>

#include "proto/bands.h"
#include "proto/err.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MATERIAL_PARAMETERS 8 /* one to spare: session files hold matrices of this size */
#define MATERIAL_WARNINGS 12

enum material_parameter {
    MATERIAL_S,
    MATERIAL_SIGMA,
    MATERIAL_GAMMA,
    MATERIAL_BETA_PRIME,
    MATERIAL_N,
    MATERIAL_EXTRA_1, /* tail, n_d or gamma_2, as the model says */
    MATERIAL_EXTRA_2  /* beta_prime_2 */
};

enum material_loss { /* what a fit may minimise: fit/loss.h */
                     MATERIAL_LOSS_ML,
                     MATERIAL_LOSS_OLS,
                     MATERIAL_LOSS_LOG,
                     MATERIAL_LOSS_CUBEROOT,
                     MATERIAL_LOSS_COSINE,
                     MATERIAL_LOSSES
};

struct material_gap { /* why a parameter is not identifiable, and the geometry that would tell it */
    char why[160];
    bool has_next;
    double next_theta_i_deg, next_theta_v_deg;
};

struct material_span { /* of the values that a P within its limits would give */
    double p_limit;    /* |P| <= this; 0: nothing was asked */
    double n[2], beta_prime[2];
};

struct estimate {
    char model[16];    /* lambert | oren-nayar | eq1 | composite | ... */
    bool converged;    /* false: see refusal */
    char refusal[256]; /* why there is no estimate, in words; empty when there is one */
    bool provisional;  /* some points were provisional */
    int n_points, n_parameters;
    double value[MATERIAL_PARAMETERS];
    double statistical[MATERIAL_PARAMETERS][MATERIAL_PARAMETERS]; /* covariance */
    double common[MATERIAL_PARAMETERS][MATERIAL_PARAMETERS];      /* covariance */
    bool at_bound[MATERIAL_PARAMETERS];
    double limit_95[MATERIAL_PARAMETERS]; /* one-sided limit where at_bound */
    bool not_identifiable[MATERIAL_PARAMETERS];
    struct material_gap gap[MATERIAL_PARAMETERS]; /* where not_identifiable */
    double kappa, q;
    int mean_low_nm, mean_high_nm;
    double chi2, bic, r2, median_relative_error, specular_energy;
    double condition;   /* of the column-normalised weighted Jacobian; 0: not known */
    int iterations;     /* of the solver, over all its starts and passes */
    double n_effective; /* points the residuals are worth, as bic counts them; 0: not known */
    double loio;        /* rms error of an incidence left out, in u (fit/crossval.h); 0: not known */
    enum material_loss minimised;
    double loss[MATERIAL_LOSSES]; /* sums of squares at value; NaN: not known */
    bool has_spectrum;
    int band_first, band_last; /* bands actually measured */
    double s_lambda[BANDS], u_s_lambda[BANDS];
    double theta_i_low_deg, theta_i_high_deg, theta_v_low_deg, theta_v_high_deg; /* range measured */
    double source_width_deg, sensor_width_deg; /* what the points were seen through */
    bool beam_in_view;
    double mirror_offset_deg, u_mirror_offset_deg; /* zero_source / 2 - zero_sample; 0, 0: not fitted */
    double zero_source_deg, zero_sample_deg;       /* the likeliest at that offset: the model stands there */
    double polarisation, u_polarisation;    /* P as stated, or as fitted from that; 0, 0: depolarised */
    struct material_span polarisation_span; /* where P is unknown */
    int n_warnings;
    char warning[MATERIAL_WARNINGS][256];
};

/* "S", "sigma", ... "tail"; NULL where the model has no such parameter or there is no such model. */
const char *material_parameter_name(const char *model, int index);
int material_parameter_find(const char *model, const char *name); /* its index; -1: none, or no name */
extern const char
    *const material_losses[MATERIAL_LOSSES + 1]; /* "ml", "ols", "log", "cuberoot", "cosine", NULL */
const char *material_loss_name(enum material_loss loss);
enum material_loss material_loss_find(const char *name);   /* MATERIAL_LOSSES: there is none of that name */
json_t *estimate_to_json(const struct estimate *estimate); /* NULL when out of memory */
int estimate_from_json(const json_t *json, struct estimate *estimate, struct err *e);
/* The "parameters" object alone: {"S", "sigma", ..., "kappa", "q", "mean_nm"} into value, kappa, q and the
 * wavelength range. estimate->model says which are required; kappa and q default to 1, mean_nm to 400-700. */
int estimate_parameters_from_json(const json_t *parameters, struct estimate *estimate, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
