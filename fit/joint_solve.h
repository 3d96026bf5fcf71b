/*
 * joint_solve.h — the joint spectral fit by variable projection: shared shape outside, S(lambda) inside.
 *
 * Minimises the weighted squares of all band values over the shared coordinates, S of each band (and t, its factor on the
 * specular part, where beta' is free per band) eliminated exactly for each set of shared coordinates. The outer steps are
 * those of Ceres' TinySolver, on the projected problem in k + 1 residuals that have the same cost, gradient and normal matrix
 * (Kaufman's: the Schur complement of the arrow); where a step meets a bound the coordinate is held there and let go
 * again; Ceres' Solver goes on where this does not settle. The work of one
 * evaluation is bands * points * (products of two of the shape's functions); nothing else grows with the bands.
 *
 * Shapes     s[], t[] by the rows of joint_data; model[n_bands * n], or NULL.
 * Domain     bounds of coordinates.h for the shared coordinates, none for S.
 * Errors     -ERR_FIT the solver failed; -ERR_RANGE; -ERR_NOMEM. Never aborts.
 * Source     reflection-model.md 3.5; Golub and Pereyra 1973, Kaufman 1975.
 * Checked    tests/unit/test_joint.c against one Ceres problem over all parameters
 */
#ifndef FIT_JOINT_SOLVE_H
#define FIT_JOINT_SOLVE_H

#include "fit/joint_data.h"

#ifdef __cplusplus
extern "C" {
#endif

struct joint_solution {
    double x[COORDINATES_MAX]; /* all coordinates of the model; that of S is not used */
    double s[BANDS], t[BANDS];
    double chi2;
    bool converged;
    int evaluations;
};

int joint_solve(const struct joint_data *d, const double *start, bool beta_prime_per_band,
                struct joint_solution *solution, double *model, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
