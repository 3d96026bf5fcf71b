/*
 * point.h — one spectral radiance factor with its uncertainties, and the bracket of reference readings it lies in.
 *
 * beta is dimensionless, 1 for a perfect diffuser. u_ind is independent from point to point; the common parts are named
 * causes that points share, each as the signed change of beta for one standard uncertainty (measurement.md 8).
 * Checked    tests/unit/test_session.c, tests/unit/test_reduce.c
 */
#ifndef PROTO_POINT_H
#define PROTO_POINT_H

#include <stdbool.h>
#include <stdint.h>

#include "proto/bands.h"

#define POINT_COMMON_MAX 12

/* A named common part of a point: the signed change of beta, by band, for one standard uncertainty of its
 * cause. The same cause has the same name in every point: "certificate", "reference/ID", "dark/ID", "stray",
 * "linearity". */
struct point_common {
    char name[40];
    double sensitivity[BANDS];
    double mean; /* of the visible mean */
};

struct point {
    int64_t id;
    int64_t supersedes; /* id of the provisional row this replaces, 0 = none */
    bool provisional;
    int64_t exposure_id; /* of the sample */
    int bracket;
    double tau_us;   /* time since the bracket opened, of the sample reading */
    double tau_r_us; /* and of the reference reading it was divided by (the open reading: 0) */
    int32_t theta_i_udeg, theta_v_udeg; /* from readbacks */
    bool saturated;
    double scan_f;       /* scatter between scans over the count-noise model (F ratio); NaN with one scan */
    bool noisy;          /* the F test says that the scans scatter more than the model allows */
    bool present[BANDS]; /* false: signal too low, never filled; beta and u_ind are then NaN, cov_next 0 */
    double beta[BANDS];
    double u_ind[BANDS];     /* independent part, standard uncertainty */
    double cov_next[BANDS];  /* covariance of band k with k + 1 (independent part) */
    double mean, mean_u_ind; /* unweighted mean of the bands of mean_nm; NaN where one of them is missing */
    int n_common;
    struct point_common common[POINT_COMMON_MAX];
};

struct point_slope { /* d beta / d axis of the visible mean, by the fitted model */
    int64_t point_id;
    double source_per_deg, sample_per_deg;
};

struct bracket { /* drift: covariance r tau1 (T - tau2) / T for tau1 <= tau2 (measurement.md 3) */
    int number;
    int64_t open_us, close_us; /* close_us 0: not closed */
    double rate[BANDS];        /* r, relative variance per second */
    double mean_rate;
    char ended_by[32];        /* "reference", "hold", "pause", "resume", "lamp" */
    int64_t last_exposure_id; /* the last exposure taken before it ended */
};

#endif
