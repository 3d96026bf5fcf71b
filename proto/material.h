/*
 * material.h — what an estimation says about a surface: parameters, their covariance, and the spectrum
 * S(lambda).
 *
 * The one struct handed from estimation to session, status and rendering, with its JSON form (design 10).
 * kappa, q and the wavelength range travel with every parameter set. Standard uncertainties are totals unless
 * a name says otherwise. Checked    tests/unit/test_material.c
 */
#ifndef PROTO_MATERIAL_H
#define PROTO_MATERIAL_H

#include <stdbool.h>
#include <jansson.h>

#include "proto/bands.h"
#include "proto/err.h"

#define MATERIAL_PARAMETERS 8
#define MATERIAL_WARNINGS 12

enum material_parameter { /* index into value[] and the covariance rows */
                          MATERIAL_S,
                          MATERIAL_SIGMA,
                          MATERIAL_GAMMA,
                          MATERIAL_BETA_PRIME,
                          MATERIAL_N,
                          MATERIAL_EXTRA_1, /* tail, n_d or gamma_2, as the model says */
                          MATERIAL_EXTRA_2  /* beta_prime_2 */
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
    double kappa, q;
    int mean_low_nm, mean_high_nm;
    double chi2, bic, r2, median_relative_error, specular_energy;
    bool has_spectrum;
    int band_first, band_last; /* bands actually measured */
    double s_lambda[BANDS], u_s_lambda[BANDS];
    double theta_i_low_deg, theta_i_high_deg, theta_v_low_deg, theta_v_high_deg; /* range measured */
    int n_warnings;
    char warning[MATERIAL_WARNINGS][160];
};

const char *material_parameter_name(const char *model, int index); /* "S", "sigma", ... "tail" */
json_t *estimate_to_json(const struct estimate *estimate);
int estimate_from_json(const json_t *json, struct estimate *estimate, struct err *e);

#endif
