/*
 * drift.h — covariance of the lamp drift within a bracket (measurement.md 3).
 *
 * Closed bracket of length T: a Brownian bridge, c(t1, t2) = r t1 (T - t2) / T for t1 <= t2; still open: r t1.
 * A sample at tau divided by a reference reading at tau_r carries the difference, so the covariance of two points
 * is c(a, b) - c(a, rb) - c(ra, b) + c(ra, rb), relative to beta_a beta_b.
 * Checked    tests/unit/test_fit_parts.c
 */
#ifndef FIT_DRIFT_H
#define FIT_DRIFT_H

#include "fit/estimate.h"

#ifdef __cplusplus
extern "C" {
#endif

double drift_covariance(const struct estimate_bracket *bracket, size_t a, size_t b);

#ifdef __cplusplus
}
#endif

#endif
