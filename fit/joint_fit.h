/*
 * joint_fit.h — one fit of all bands together: shared sigma, gamma, n, ...; free S(lambda); beta' shared or per band.
 *
 * Starts from the estimate of the visible means and needs its axis slopes; weights from each band's u (the independent part)
 * and the axes, recomputed from the model once. See fit/joint_solve.h for the method and fit/joint_covariance.h for the
 * uncertainty. Mirror offset and P are free with their priors, as in the estimate of the means (fit/nuisance.h), and the model
 * moves to where all bands together want them: joint.mirror_offset_deg and joint.polarisation. What the bands cannot tell is
 * an answer (joint.refusal), not an error.
 *
 * Domain     input as in fit/estimate.h with band_beta; beta_prime_per_band only where the model has a beta'.
 * Errors     -ERR_RANGE, -ERR_USAGE of the input; -ERR_NOMEM. *joint then owns nothing; else joint_free frees it.
 * Source     reflection-model.md 3.5, 4.1; measurement.md 5, 8, 10.
 * Checked    tests/unit/test_joint.c, tests/unit/test_joint_nuisance.c
 */
#ifndef FIT_JOINT_FIT_H
#define FIT_JOINT_FIT_H

#include "fit/estimate.h"
#include "proto/joint.h"

#ifdef __cplusplus
extern "C" {
#endif

int joint_fit(const struct estimate_input *input, const struct estimate *start, bool beta_prime_per_band,
              struct joint *joint, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
