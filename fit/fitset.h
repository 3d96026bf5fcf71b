/*
 * fitset.h — points, common causes and brackets gathered one by one into the input of an estimation.
 *
 * Filled alike from a request (fit/serve.h), a CSV file (fit/points_csv.h) and a session (fit/points_session.h).
 * A cause is known by its name: the same name at several points is the same cause. Settings (model, kappa,
 * axis uncertainties, mean_nm) are written straight into fitset.input.
 * Promises   fitset_input points into the fitset and holds until the next fitset_add_* or fitset_free.
 * Errors     -ERR_NOMEM.
 * Checked    tests/unit/test_serve.c, tests/unit/test_points.c
 */
#ifndef FIT_FITSET_H
#define FIT_FITSET_H

#include "fit/estimate.h"
#include "fit/mask.h"

struct fitset_point {
    double theta_i_deg, theta_v_deg;
    double delta_phi_deg; /* as struct estimate_input has it: 0 in plane */
    bool mirrored;
    double beta, u_ind;            /* of the visible mean; u_ind NaN = not known */
    const double *bands, *bands_u; /* [BANDS] or NULL */
    const double *bands_cov;       /* [BANDS] covariance with the next band, or NULL */
};

struct fitset_cause {
    char name[48];
    size_t n, capacity, band_capacity;
    bool has_bands;
    int *point;
    double *mean, *bands;
};

struct fitset_bracket {
    size_t n, capacity;
    int *point;
    double *tau_us, *tau_r_us;
    double length_us, rate;
};

struct fitset {
    struct estimate_input input; /* settings; its arrays are set by fitset_input */
    size_t n, capacity, band_capacity;
    double *theta_i_deg, *theta_v_deg, *delta_phi_deg, *beta, *u_ind, *bands, *bands_u, *bands_cov;
    bool *mirrored;
    bool has_u, has_directions, has_bands, has_bands_u, has_bands_cov;
    struct mask mask;          /* what readers of files let in, and counts of what they left out */
    bool independence_assumed; /* only a total uncertainty was given */
    bool all_models;           /* input.model is the first of several wanted */
    struct fitset_cause *cause;
    size_t n_causes, cause_capacity;
    struct fitset_bracket *bracket;
    size_t n_brackets, bracket_capacity;
    struct estimate_common *common;
    struct estimate_bracket *brackets;
};

void fitset_init(struct fitset *d); /* composite, kappa 1, 400-700 nm, P unknown */
void fitset_free(struct fitset *d);
int fitset_add_point(struct fitset *d, const struct fitset_point *point, struct err *e);
/* The cause's change of the last point or of any before it; bands may be NULL. */
int fitset_add_cause(struct fitset *d, const char *name, size_t point, double mean, const double *bands,
                     struct err *e);
int fitset_add_bracket(struct fitset *d, double length_us, double rate, struct err *e);
int fitset_add_to_bracket(struct fitset *d, size_t bracket, size_t point, double tau_us, double tau_r_us,
                          struct err *e);
int fitset_input(struct fitset *d, const struct estimate_input **input, struct err *e);
/* The estimation, with what the fitset itself has to say among the warnings. */
int fitset_fit(struct fitset *d, struct estimate *estimate, struct err *e);

#endif
