/*
 * dataset.h — one session as plots and comparisons want it: newest points, fits over time, truth if known.
 *
 * point holds one row per geometry measured: the final one where there is one, else the provisional. Sorted
 * by theta_i, then theta_v. u_total adds independent and common parts in squares. The truth is present in
 * simulated sessions only.
 * Errors     -ERR_IO, -ERR_INPUT as session_open; -ERR_STATE when it holds no point.
 * Checked    tests/scenario/test_plot.c
 */
#ifndef DAEMON_DATASET_H
#define DAEMON_DATASET_H

#include "proto/session.h"

#define DATASET_SWEEPS 128
#define DATASET_PARAMETERS 5 /* of the composite model: S, sigma, gamma, beta', n; what a truth is known in */

struct dataset_fit {  /* one estimate of the campaign, as it was made */
    double elapsed_s; /* since the first exposure began */
    int exposures;    /* scans taken until then */
    bool provisional;
    double value[MATERIAL_PARAMETERS], u[MATERIAL_PARAMETERS];
};

struct dataset {
    char name[192]; /* of the session */
    char sample[64], paint[64], support[64], series[64];
    bool has_water;
    double water_percent;
    int n;
    struct point *point;
    bool *mirrored; /* [n_exposures] by id - 1: both axes negated */
    int n_exposures;
    bool has_estimate;
    struct estimate estimate;
    int n_fits;
    struct dataset_fit *fit;
    bool has_truth;
    double truth[DATASET_PARAMETERS], truth_q;
};

int dataset_load(struct dataset *d, const char *path, struct err *e);
void dataset_free(struct dataset *d);

bool dataset_mirrored(const struct dataset *d, const struct point *p);
double dataset_u_total(const struct point *p);             /* of the visible mean */
double dataset_u_band(const struct point *p, int band);    /* of one band */
double dataset_u(const struct estimate *m, int parameter); /* total standard uncertainty */
/* Points whose incidence differs by less than 0.25 deg (readback scatter) form one sweep: rows first .. first
 * + n - 1. */
struct dataset_sweep {
    int first, n;
    double theta_i_deg; /* mean */
};
int dataset_sweeps(const struct dataset *d, struct dataset_sweep *sweep, int max);
struct dataset_sweep dataset_sweep_nearest(const struct dataset *d, double theta_i_deg);
/* Value of the fitted model at a geometry and, by its covariance, u: of the surface itself, and as the points were
 * seen: at readbacks whose zeros are off as the fit found, through the angular widths of source and sensor, with their
 * polarisation. What the zeros do through K (fit/spot.h; a few 1e-4) is left out. 0 or a negative code. */
int dataset_model(const struct estimate *m, double theta_i_deg, double theta_v_deg, double *beta, double *u,
                  struct err *e);
int dataset_model_seen(const struct estimate *m, double theta_i_deg, double theta_v_deg, bool mirrored,
                       double *beta, double *u, struct err *e);
/* Ratio of the model at two geometries of one incidence, with its u. */
int dataset_model_ratio(const struct estimate *m, double theta_i_deg, double theta_v_deg,
                        double over_theta_v_deg, double *ratio, double *u, struct err *e);

#endif
