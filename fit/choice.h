/*
 * choice.h — which of several models the data need, and what leaving out the others costs.
 *
 * A model is needed only where it beats every converged model nested in it on both counts: the effective BIC, all of
 * them counting the points that the residuals of the best describing model are worth, and leave-one-incidence-out
 * (fit/crossval.h). Of those the lowest BIC is recommended. Without cross-validation nothing beyond the paper's
 * composite is recommended. Where even the best describing model misses, chi-square is in units of its scatter.
 * Shapes     choice[n], one for each model of the same points; estimates that did not converge take no part.
 * Promises   choice_rank sorts: the recommended first, then by BIC, then those without an estimate.
 * Source     measurement.md 10; reflection-model.md 4.1.
 * Checked    tests/unit/test_choice.c
 */
#ifndef FIT_CHOICE_H
#define FIT_CHOICE_H

#include <stddef.h>

#include "fit/reflectance.h"

#ifdef __cplusplus
extern "C" {
#endif

struct choice {
    const struct estimate *estimate; /* with n_effective, bic and loio */
    bool u_stated;                   /* weighted by stated u: bic is of chi-square, else of its logarithm */
    double bic;                      /* filled */
    bool recommended;                /* filled */
    char text[400]; /* filled: what it would change beside the recommended one, and why not */
};

void choice_rank(struct choice *choice, size_t n);

#ifdef __cplusplus
}
#endif

#endif
