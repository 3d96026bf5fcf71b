/*
 * replay.h — a recorded session against the simulated bench: its own plan, through the real drivers, point by point.
 *
 * A recording is a device (design 3). Its job, certificate and config are run once more in virtual time, on a bench
 * whose sample is the session's fitted estimate or its recorded truth, into a session that is thrown away; then the
 * final points of both are compared at the same nominal geometry. The recording's points are derived again from its
 * counts, never taken as stored.
 *
 *   d = measured - simulated,   V = covariance of d (measurement.md 8),   z = d / u with u^2 its diagonal
 *
 * V          both sides' u_ind; every named common part but the certificate; the drift within brackets; the slopes of
 *            the surface times repeatability (both sides); for an estimate also the zeros, and its own covariance. The
 *            certificate's draw is the same on both sides: the truth is seen past the same diffuser, and the estimate
 *            has taken it in.
 * Neighbours t = a point's difference against what all others and V let expect there, in units of its own standard
 *            deviation; a point that was spoilt alone stands out in t more than in z.
 * Surfaces   REPLAY_TRUTH mounts the text "truth" on the bench of the session's own seed: the same bytes come out where
 *            the session was the first of a fresh goniod and was never interrupted. REPLAY_ESTIMATE mounts the
 *            estimate on a bench without zero errors, of another seed, so that its noise is not the recording's.
 * Agrees     no |z| or |t| above 5, chi2 = d V^-1 d below its 99.9 % point, and every measured geometry simulated.
 * Errors     -ERR_INPUT the session does not hold what is needed; -ERR_STATE the simulated campaign did not end as
 *            done, with its reason; those of session.h.
 * Checked    tests/replay/
 */
#ifndef DAEMON_REPLAY_H
#define DAEMON_REPLAY_H

#include <stdbool.h>
#include <stdint.h>

#include "proto/err.h"

#define REPLAY_SWEEPS 96
#define REPLAY_Z_MAX 5.0 /* of z and t; measurement.md 11 */

enum replay_surface { REPLAY_ESTIMATE, REPLAY_TRUTH };

struct replay_options {
    enum replay_surface surface;
    bool has_seed; /* else as said above */
    uint64_t seed;
};

struct replay_point {
    double theta_i_deg, theta_v_deg; /* nominal */
    bool mirrored;
    int step;            /* of the recording's plan */
    int64_t exposure_id; /* of the recording */
    double measured, simulated;
    double u, z, t;
    int row[2]; /* among the derived points of the recording, of the simulation */
};

struct replay_sweep { /* the points of one incidence */
    double theta_i_deg;
    int n;
    double mean_z, chi2;
};

enum replay_cause {
    REPLAY_AGREES,
    REPLAY_MISSING, /* geometries that the simulated campaign did not measure */
    REPLAY_FACTOR,  /* one factor for all points makes them agree */
    REPLAY_MODEL,   /* the difference goes on from point to point along the sweeps */
    REPLAY_POINTS,  /* a few points alone, their neighbours agree */
    REPLAY_SCATTER  /* more than u says, without any order */
};

struct replay {
    uint64_t seed;
    int n, n_missing;
    struct replay_point *point; /* [n] by theta_i, then theta_v */
    bool identical;             /* every derived row is the same to the last bit */
    double median_z;            /* of |z| */
    double median_relative;     /* of |d| / measured */
    double within_2u;
    double chi2, chi2_limit; /* d V^-1 d; per point: divide by n */
    double along,
        along_limit; /* correlation of neighbours along the sweeps, shared parts apart; its 99 % point */
    double factor;   /* measured / simulated, weighted */
    int n_beyond;    /* points to be taken out until the rest agrees, at most a tenth */
    int n_sweeps;
    struct replay_sweep sweep[REPLAY_SWEEPS];
    enum replay_cause cause;
};

int replay_run(struct replay *replay, const char *path, const struct replay_options *options, struct err *e);
void replay_free(struct replay *replay);

#endif
