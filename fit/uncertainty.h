/*
 * uncertainty.h — covariance of the fitted parameters and of S(lambda): H V H^T (measurement.md 8).
 *
 * H = (J^T W J)^-1 J^T W, with the weights that free nuisances leave (fit/nuisance.h), over the parameters that are free (not at a bound), in the coordinates of the fit. V
 * is the independent part u^2 (with axis repeatability), the drift of each bracket, and one outer product for
 * each common cause, the two axis zeros among them. Statistical = independent and drift; common = the causes.
 * chi2_expected and chi2_variance are those of the fit's chi-square under the whole of V.
 * Shapes     k columns of the model; matrices k * k row by row, zero rows for parameters at a bound.
 * Errors     -ERR_FIT the normal matrix is singular; -ERR_NOMEM.
 * Checked    tests/unit/test_estimate_uncertainty.c
 */
#ifndef FIT_UNCERTAINTY_H
#define FIT_UNCERTAINTY_H

#include "fit/bandfit.h"

#ifdef __cplusplus
extern "C" {
#endif

#define UNCERTAINTY_CELLS (COORDINATES_MAX * COORDINATES_MAX)

struct uncertainty {
    bool free[COORDINATES_MAX];
    double condition;                      /* of the column-normalised weighted Jacobian */
    double weakest[COORDINATES_MAX];       /* the direction the data hold least, column-normalised */
    double fisher[UNCERTAINTY_CELLS];      /* J^T W J */
    double independent[UNCERTAINTY_CELLS]; /* in coordinates */
    double drift[UNCERTAINTY_CELLS];
    double common[UNCERTAINTY_CELLS];
    double chi2_expected, chi2_variance;
    double nuisance_u2[NUISANCES_MAX]; /* total */
    double scatter; /* of a misfit: chi-square over its expectation (fit/misfit.h); else 0 */
    double *h;      /* [(k + nuisances) * n], the parameters first */
};

/* p evaluated at value. Condition, weakest and fisher are filled even where the rest is refused with
 * -ERR_FIT. */
int uncertainty_compute(struct uncertainty *u, const struct problem *p, const double *value,
                        const bool *is_free, struct err *e);
void uncertainty_free(struct uncertainty *u);
/* u(S_b), total, of each measured band; NaN where S is. */
int uncertainty_of_bands(const struct uncertainty *u, const struct problem *p, const double *value,
                         struct bandfit *f, double *u_s, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
