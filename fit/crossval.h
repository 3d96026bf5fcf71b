/*
 * crossval.h — leave-one-incidence-out: how well a model foretells a sweep that it has not seen.
 *
 * Each sweep of one incidence is left out in turn, the others are fitted anew from the best fit, and the residuals of
 * the sweep left out are taken: loio is the root mean square of them all, in the weights of the fit (so in u, or in
 * units of beta where all points count alike). Points within a sweep are no independent witnesses, sweeps are.
 * Errors     -ERR_FIT fewer than CROSSVAL_SWEEPS_MIN incidences, or a fit without a sweep failed; -ERR_NOMEM.
 * Source     reflection-model.md 4.1; measurement.md 10.
 * Checked    tests/unit/test_choice.c
 */
#ifndef FIT_CROSSVAL_H
#define FIT_CROSSVAL_H

#include "fit/solve.h"

#define CROSSVAL_SWEEPS_MIN 3

#ifdef __cplusplus
extern "C" {
#endif

/* p is left as it was, evaluated at best. */
int crossval_loio(struct problem *p, const struct solve_result *best, double *loio, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
