/*
 * nuisance.h — what the instrument does not know of itself and the points tell: mirror offset and polarisation.
 *
 * delta = zero_source / 2 - zero_sample shifts the mirror direction; it is what the data show of both axis zeros
 * (measurement.md 6). P is the polarisation that source and sensor together prefer. Each has a prior (mean and u) and
 * is free beside the parameters; being linear over its prior it is never a coordinate: with slopes g = d beta / d z,
 * scaled by u and weighted into G, the cost over the best z of every model is that of the residuals times
 *     B = (I + G G^T)^(-1/2) = I - sum_j shrink_j axis_j axis_j^T,
 * a free column with a prior residual, eliminated exactly. (J^T W' J)^-1 J^T W' with W' = W^1/2 B B W^1/2 are then the
 * weights of measurement.md 8. Between two minimisations the model moves to the z found, so that no linearisation is
 * left in the end.
 * A zero of the source at given delta, u_source u_sample / u_delta, is invisible and stays a common part. In a joint fit
 * they are shared by all bands, and told by all of them (fit/joint_form.h).
 *
 * Free       where the points carry weights of their own and the model has a lobe, and not held; else common parts.
 * Shapes     n points of the problem; vectors are weighted (root_weight) rows.
 * Errors     -ERR_NOMEM; those of fit/aperture.h.
 * Checked    tests/unit/test_nuisance.c, tests/unit/test_joint_nuisance.c
 */
#ifndef FIT_NUISANCE_H
#define FIT_NUISANCE_H

#include "fit/estimate.h"
#include "fit/reflectance.h"

#ifdef __cplusplus
extern "C" {
#endif

#define NUISANCES_MAX 2

enum nuisance_kind { NUISANCE_OFFSET, NUISANCE_POLARISATION };

struct nuisance {
    enum nuisance_kind kind;
    double mean, u; /* of the prior; deg, or P */
    double at;      /* where the model stands */
    double *slope;  /* [n] d beta / d z, there */
};

struct nuisances {
    int m;
    struct nuisance of[NUISANCES_MAX];
    double *axis[NUISANCES_MAX]; /* [n] orthogonal, of the span of G */
    double shrink[NUISANCES_MAX];
    double removed[NUISANCES_MAX]; /* B B = I - sum_j removed_j axis_j axis_j^T */
};

struct problem;

int nuisance_init(struct problem *p, struct err *e);
void nuisance_free(struct problem *p);
/* Axes anew, from the slopes and weights of problem_reweigh, which ends with it. */
void nuisance_weigh(struct problem *p);
/* Moves the model to the z that suits the last evaluation best; *moved in units of the prior's u. Evaluates and
 * finds slopes and axes anew. */
int nuisance_adopt(struct problem *p, const double *value, double *moved, struct err *e);
/* Moves the model to where an estimate of the same points found them, and by further steps. */
int nuisance_take(struct problem *p, const struct estimate *estimate, struct err *e);
int nuisance_move(struct problem *p, const double step[NUISANCES_MAX], struct err *e);
/* What nuisance z changes in point i: of the lobe, the same in every band, and through K, in proportion to beta. */
void nuisance_slope(const struct problem *p, int z, size_t i, double *lobe, double *spot);
/* Weighted residuals (model - target) and weighted columns of a Jacobian, in place. */
void nuisance_residuals(const struct problem *p, double *vector);
void nuisance_whiten(const struct problem *p, double *vector);
/* What of point i's weighted residual is there because the model does not stand at the means of the priors. */
double nuisance_taken(const struct problem *p, size_t i);
double nuisance_chi2(const struct problem *p); /* of the priors, where the model stands */
/* How far point i's angles are from its readbacks, and what its value is multiplied by through K. */
void nuisance_shift(const struct problem *p, size_t i, double *di_deg, double *dv_deg, double *factor);
/* The axis zeros and P at their priors, as common causes; slope is the same change in every band, spot in proportion to
 * beta; none: the spot of P, which moves none (NULL, or n zeros). Returns how many. */
#define NUISANCE_CAUSES 3
struct nuisance_cause {
    const double *slope, *spot;
    double u;
    enum nuisance_kind kind; /* of the nuisance that one unit of it moves, and how far */
    double share;
};
int nuisance_causes(const struct problem *p, const double *none,
                    struct nuisance_cause cause[NUISANCE_CAUSES]);
/* What both zeros most likely are where the mirror direction is off by that much. */
void nuisance_zeros(const struct estimate_input *input, double offset_deg, double *source_deg,
                    double *sample_deg);

#ifdef __cplusplus
}
#endif

#endif
