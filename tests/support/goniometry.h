/*
 * goniometry.h — made-up measurements of the published paints, for the tests of the estimation.
 *
 * Grid and noise of reflection-model.md section 3: theta_i 10..60 by 10, theta_v -80..80 by 5 (198 points);
 * noise sd = sqrt((0.005 beta)^2 + 0.001^2). The S of the published sets are assumed there too.
 */
#ifndef TESTS_GONIOMETRY_H
#define TESTS_GONIOMETRY_H

#include <stdbool.h>

#include "fit/dice.h"
#include "fit/estimate.h"

#define GONIOMETRY_MAX 400
#define GONIOMETRY_SETS 4

extern const char *const goniometry_name[GONIOMETRY_SETS];
extern const double goniometry_set[GONIOMETRY_SETS][MATERIAL_PARAMETERS];

struct goniometry { /* owns what its input points to */
    double theta_i_deg[GONIOMETRY_MAX], theta_v_deg[GONIOMETRY_MAX];
    double truth[GONIOMETRY_MAX], beta[GONIOMETRY_MAX], u[GONIOMETRY_MAX];
    double band_truth[GONIOMETRY_MAX * BANDS], band_beta[GONIOMETRY_MAX * BANDS],
        band_u[GONIOMETRY_MAX * BANDS];
    double s_lambda[BANDS], value[MATERIAL_PARAMETERS], q; /* the truth of the visible mean */
    struct estimate_input input;
};

/* The 198-point grid, or another range by the same steps; no noise yet, weights of the noise model. */
void goniometry_make(struct goniometry *m, const double *value, double theta_i_high_deg,
                     double theta_v_step_deg);
/* Adds bands of a coloured surface: S(lambda) from low to high, the means following from the bands. */
void goniometry_colour(struct goniometry *m, double low, double high);
/* Fresh noise on means and bands; the stated u comes from the noisy value, as an instrument's would. */
void goniometry_noise(struct goniometry *m, struct dice *d);
/* Noise of bands alone, of which the means then are the means; for a relative noise of a band. */
void goniometry_band_noise(struct goniometry *m, struct dice *d, double relative);

#endif
