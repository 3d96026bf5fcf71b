/*
 * joint.h — what a joint spectral fit says: shape parameters shared by all bands, S(lambda), and their covariance.
 *
 * beta_b = S_b L1 + kappa S_b^2 L2 + specular, with one sigma, gamma, n, ... for all bands; beta' is one number (default)
 * or one a band. Each band is of one wavelength, so q = 1 in every band.
 *
 * Shapes     row[n] says what row and column i of the covariances are: a shared parameter (band -1) or the S or beta' of
 *            a band. Only what was free and measured has a row. covariances n * n, row by row, symmetric; their sum is the
 *            total. value[] by enum material_parameter: shared parameters; NaN for S, and for beta' where it is per band.
 *            s_lambda and beta_prime: NaN = not measured; beta_prime holds the shared value in every band measured
 *            otherwise.
 * JSON       covariances as their upper triangles, row by row. NaN is null.
 * Errors     joint_from_json: -ERR_INPUT naming the key, -ERR_NOMEM; *joint then owns nothing.
 * Checked    tests/unit/test_joint_form.c
 */
#ifndef PROTO_JOINT_H
#define PROTO_JOINT_H

#include <stdbool.h>
#include <stddef.h>

#include <jansson.h>

#include "proto/bands.h"
#include "proto/err.h"
#include "proto/material.h"

#ifdef __cplusplus
extern "C" {
#endif

#define JOINT_ROWS (MATERIAL_PARAMETERS + 2 * BANDS)

struct joint_row {
    int parameter; /* enum material_parameter */
    int band;      /* -1: shared */
};

struct joint {
    char model[16];
    bool converged;
    char refusal[256]; /* why there is no answer; empty when there is one */
    bool beta_prime_per_band;
    bool misfit; /* the model does not fit: u from the scatter of whole sweeps, parameters descriptive */
    int n_points, n_values, n_bands;
    double kappa, chi2, chi2_expected;
    double value[MATERIAL_PARAMETERS];
    bool at_bound[MATERIAL_PARAMETERS];
    double s_lambda[BANDS], beta_prime[BANDS];
    /* As in struct estimate, but told by all bands; u 0: not fitted, P is the stated one. */
    double mirror_offset_deg, u_mirror_offset_deg;
    double polarisation, u_polarisation;
    int n;
    struct joint_row row[JOINT_ROWS];
    double *statistical, *common; /* [n * n], malloc'd; NULL where n is 0 */
};

int joint_allocate(struct joint *joint, int n, struct err *e); /* both covariances, zero */
void joint_free(struct joint *joint);
int joint_copy(struct joint *to, const struct joint *from, struct err *e);
/* Row of a parameter; band -1 for a shared one. -1: it has none. */
int joint_row(const struct joint *joint, int parameter, int band);
/* Total standard uncertainty; NaN without a row. */
double joint_u(const struct joint *joint, int parameter, int band);
size_t joint_triangle(int n); /* numbers in an upper triangle with its diagonal */
void joint_pack(int n, const double *matrix, double *triangle);
void joint_unpack(int n, const double *triangle, double *matrix);
/* What was found of the bench, alone: {"mirror_offset_deg", "u_mirror_offset_deg", "polarisation", "u_polarisation"}. */
json_t *joint_found_to_json(const struct joint *joint);
void joint_found_from_json(const json_t *json, struct joint *joint);
json_t *joint_to_json(const struct joint *joint); /* NULL when out of memory */
int joint_from_json(const json_t *json, struct joint *joint, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
