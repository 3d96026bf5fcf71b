/*
 * full_joint.h — the joint spectral fit as one problem over all its parameters, with nothing eliminated: the answer that
 * variable projection has to reach.
 */
#ifndef TESTS_FULL_JOINT_H
#define TESTS_FULL_JOINT_H

#include "fit/joint_data.h"

#ifdef __cplusplus
extern "C" {
#endif

/* held[] by the coordinates, or NULL; it knows no bounds. x[]: the coordinates of the model (that of S unused), start and answer; s[n_bands] and t[n_bands] likewise. Returns chi2,
 * negative where the solver does not converge. */
double full_joint(const struct joint_data *d, bool beta_prime_per_band, const bool *held, double *x,
                  double *s, double *t);

#ifdef __cplusplus
}
#endif

#endif
