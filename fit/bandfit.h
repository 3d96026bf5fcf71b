/*
 * bandfit.h — the spectrum S(lambda): one diffuse albedo per band, the shared parameters held.
 *
 * Band b obeys beta_b(i) = S_b L1(i) + kappa S_b^2 L2(i) + specular(i) exactly (q = 1 within a band); S_b by
 * weighted least squares over the points that have the band. The mean over wavelengths does not: it needs
 * q = mean(S^2) / mean(S)^2 over the bands of mean_nm (measurement.md 5).
 * Checked    tests/unit/test_estimate.c
 */
#ifndef FIT_BANDFIT_H
#define FIT_BANDFIT_H

#include "fit/problem.h"

#ifdef __cplusplus
extern "C" {
#endif

#define BANDFIT_POINTS_MIN 3 /* a band of fewer points says nothing of S beyond their noise */

struct bandfit_point { /* beta_b = S l1 + S^2 l2 + specular; slopes with respect to sigma */
    double l1, l2, specular, l1_slope, l2_slope;
};

struct bandfit {
    struct bandfit_point *point; /* [n] */
    double s[BANDS];             /* NaN = not measured */
    double variance[BANDS];      /* of s, independent part alone; from the scatter where no u is given */
    double *weight;              /* [n] of the band last solved; 0 where the point lacks it */
    bool known;                  /* each of its points states a u in the band last solved */
};

/* input->band_beta must be there. */
int bandfit_run(struct bandfit *f, const struct problem *p, const double *value, struct err *e);
void bandfit_free(struct bandfit *f);
/* Weights of one band into f->weight; returns the number of points that have it. */
size_t bandfit_weights(struct bandfit *f, const struct problem *p, int band);
double bandfit_q(const struct bandfit *f, int low_nm, int high_nm);

#ifdef __cplusplus
}
#endif

#endif
