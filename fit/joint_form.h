/*
 * joint_form.h — how the parameters of a joint fit answer to its values, at the solution.
 *
 * Shared are the free shared coordinates of the model and, behind them, the free nuisances (fit/nuisance.h): what a zero or
 * P changes is the same in every band where it moves the lobe, in proportion to the value where it acts through K. Their
 * priors are part of the normal matrix, so that shape and nuisances are told apart exactly as far as the points do.
 * Inner are S, and t where beta' is free per band.
 *
 * Shapes     column by column: schur and inverse all * all; of band b shared all * n, own inner * n, block inner * inner,
 *            g inner * all (the inner ones follow by -g shared).
 * Errors     -ERR_FIT the bands cannot tell the shared parameters apart; -ERR_RANGE, -ERR_NOMEM.
 * Checked    tests/unit/test_joint.c, tests/unit/test_joint_nuisance.c
 */
#ifndef FIT_JOINT_FORM_H
#define FIT_JOINT_FORM_H

#include "fit/joint_shape.h"
#include "fit/joint_solve.h"

#ifdef __cplusplus
extern "C" {
#endif

struct joint_form {
    bool free[COORDINATES_MAX]; /* by the model's columns */
    struct joint_shape shape;
    int k, all, inner, bands; /* k: without the nuisances */
    size_t n;
    double *schur, *inverse, *shared, *own, *block, *g;
};

int joint_form_init(struct joint_form *f, const struct joint_data *d, const struct joint_solution *solution,
                    bool beta_prime_per_band, const double *model, struct err *e);
void joint_form_free(struct joint_form *f);
/* Where the nuisances want to go from where the model stands, all else following. model[n_bands * n]. */
void joint_form_step(const struct joint_form *f, const struct joint_data *d, const double *model,
                     double step[NUISANCES_MAX]);

#ifdef __cplusplus
}
#endif

#endif
