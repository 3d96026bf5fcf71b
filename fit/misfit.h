/*
 * misfit.h — whether the model describes the points, and what u is worth where it does not.
 *
 * With stated uncertainties: chi-square past its 99.9 % point (of the whole of V, measurement.md 8). Without: neighbours in
 * a sweep lie on the same side of the model more often than chance has it (once in 1,000 times). The parameters are then
 * descriptive, and their statistical covariance is the sweep-wise sandwich
 *     C = sum over sweeps g of d_g d_g^T,  d_g = F^-1 (I - F_g F^-1)^(-1/2) J_g^T W_g r_g,
 * raised in every direction to at least the old covariance times scatter * n / n_effective: nothing ever shrinks.
 * Errors     -ERR_NOMEM.
 * Source     measurement.md 10; leverage correction: Bell and McCaffrey 2002 (CR2).
 * Checked    tests/unit/test_misfit.c
 */
#ifndef FIT_MISFIT_H
#define FIT_MISFIT_H

#include "fit/uncertainty.h"

#ifdef __cplusplus
extern "C" {
#endif

struct misfit {
    bool is;
    double limit;       /* the 99.9 % point; 0 without stated uncertainties */
    double scatter;     /* chi2 over its expectation, at least 1 */
    double n_effective; /* independent points the residuals are worth (fit/sweeps.h) */
};

/* chi2 in units of u, of the last evaluation. */
int misfit_judge(struct misfit *m, const struct problem *p, const struct uncertainty *u, double chi2,
                 struct err *e);
/* Where m->is: the covariance u->independent as above (u->drift stays), and u->scatter. */
int misfit_inflate(const struct misfit *m, struct uncertainty *u, const struct problem *p, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
