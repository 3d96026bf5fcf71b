/*
 * sweeps.h — the points of a fit by their incidence: what belongs to one sweep of the viewing angle.
 *
 * Points within 1 deg of incidence are one sweep (readbacks scatter by far less, grids step by more). Within a sweep
 * the residuals of a model that misses are correlated; between sweeps they hardly are. So scatter is judged, and
 * cross-validation done, by whole sweeps.
 * Shapes     n points; sweep[n] the sweep of each; order[n] all points, sweep by sweep, each by its viewing angle.
 * Errors     -ERR_NOMEM.
 * Checked    tests/unit/test_misfit.c
 */
#ifndef FIT_SWEEPS_H
#define FIT_SWEEPS_H

#include <stddef.h>

#include "proto/err.h"

#ifdef __cplusplus
extern "C" {
#endif

struct sweeps {
    size_t n, n_sweeps;
    size_t *sweep, *order;
};

int sweeps_find(struct sweeps *s, size_t n, const double *theta_i_deg, const double *theta_v_deg,
                struct err *e);
void sweeps_free(struct sweeps *s);
/* How many independent points the residuals are worth: n / (1 + 2 sum of their correlations along the sweeps), the sum
 * up to the first lag where chance alone would do it (2 / sqrt(n)). residual[n] in units of its u. n_sweeps to n. */
double sweeps_effective(const struct sweeps *s, const double *residual);
/* How far the signs of neighbours agree beyond chance, as a standard normal: blind to the size of each point's noise. */
double sweeps_agreement(const struct sweeps *s, const double *residual);

#ifdef __cplusplus
}
#endif

#endif
