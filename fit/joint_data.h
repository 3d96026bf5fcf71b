/*
 * joint_data.h — the band values of one joint fit, band by band, with the weights they carry.
 *
 * The working struct of joint_solve.cc and joint_covariance.cc. u is the independent standard uncertainty of a band value,
 * without the axes; what the bands of a point share (an angle, the electric dark) is counted once a point and not once a
 * band: weight = 1 / (u^2 (1 - share + m share) + m angle_u2), m = bands of the point.
 *
 * Shapes     row i of the band arrays is band[i]; n values each, 0 weight where missing. share[n]: the part of u^2 that all
 *            bands of a point have in common, told by the stated u of its mean beside those of its bands. rho_next: the
 *            correlation with the band 5 nm up, by the resampling (measurement.md 5), NaN = as any other band.
 * Errors     -ERR_NOMEM.
 * Checked    tests/unit/test_joint.c
 */
#ifndef FIT_JOINT_DATA_H
#define FIT_JOINT_DATA_H

#include "fit/problem.h"

#ifdef __cplusplus
extern "C" {
#endif

struct joint_data {
    struct problem *p;
    size_t n, n_values;
    int n_bands, band[BANDS];
    bool known;                           /* every value states a u; else they all count by the mean's */
    double *beta, *weight, *u, *rho_next; /* [n_bands * n] */
    double *share, *mean_beta;            /* [n]; mean_beta: the model of the mean, at the start */
    int *bands_of;                        /* [n] m */
};

/* p evaluated and reweighed at the estimate of the means. */
int joint_data_init(struct joint_data *d, struct problem *p, struct err *e);
void joint_data_free(struct joint_data *d);
/* u and weights anew from the model's values, [n_bands * n]. */
void joint_data_reweigh(struct joint_data *d, const double *model);

#ifdef __cplusplus
}
#endif

#endif
