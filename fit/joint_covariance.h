/*
 * joint_covariance.h — covariance of the shared parameters and S(lambda) of a joint fit: H V H^T (measurement.md 8).
 *
 * V holds, over points and bands: the band covariance of each point (its diagonal u^2, neighbours by resampling, the share
 * all bands have in common) with the axis repeatability, which moves all bands alike; the drift of each bracket, which moves
 * them in proportion; and the common causes, the axis zeros among them. A cause whose mean is what its bands give together
 * moves them as one; one whose mean is smaller (the noise of a reference reading) is part of each: how much, its mean tells.
 * Statistical = independent and drift; common = the causes. Where chi-square passes its 99.9 % point the statistical part is
 * that of the scatter of whole sweeps, never smaller than before.
 *
 * Cost       linear in points and causes; quadratic in the bands, for their covariances.
 * Errors     -ERR_FIT the shared parameters cannot be told apart; -ERR_RANGE; -ERR_NOMEM.
 * Checked    tests/unit/test_joint.c and tests/unit/test_joint_nuisance.c: pulls over seeds
 */
#ifndef FIT_JOINT_COVARIANCE_H
#define FIT_JOINT_COVARIANCE_H

#include "fit/joint_solve.h"
#include "proto/joint.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Fills rows, covariances, at_bound, chi2_expected, misfit and the u of the nuisances of joint. model[n_bands * n] is the
 * solution's. */
int joint_covariance(const struct joint_data *d, const struct joint_solution *solution,
                     bool beta_prime_per_band, const double *model, struct joint *joint, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
