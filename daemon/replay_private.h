/*
 * replay_private.h — between the files of a replay: what a recording says of itself, and points derived from counts.
 *
 * Files      replay_recording.c reads texts and surfaces; replay_points.c derives points; replay_bench.c measures once
 *            more; replay_covariance.c says what their difference may be; replay_compare.c judges it; replay.c joins them.
 * Checked    tests/replay/
 */
#ifndef DAEMON_REPLAY_PRIVATE_H
#define DAEMON_REPLAY_PRIVATE_H

#include <limits.h>

#include "daemon/job.h"
#include "daemon/replay.h"
#include "daemon/simulate_surface.h"
#include "proto/session.h"

struct recording {
    char path[PATH_MAX];
    char *job, *certificate, *config;          /* texts */
    char job_file[128], certificate_file[128]; /* their names */
    char sample[48];
    uint64_t seed;
    int64_t utc_start_us; /* UTC at time 0 of the session */
    int mean_nm[2];
    double u_repeat_deg[2], u_zero_deg[2]; /* source, sample axis */
    struct aperture_form form;             /* what its points were seen through */
    struct estimate estimate;              /* where that is the surface */
    int n_surfaces; /* [0] is the sample's own, then those of the job's other samples */
    struct {
        char sample[48];
        struct simulate_surface surface;
    } surface[JOB_SAMPLES];
};

struct derived_point {
    int32_t theta_i_udeg, theta_v_udeg; /* nominal */
    bool mirrored;
    int nth; /* of its geometry */
    int step, bracket;
    int64_t exposure_id;
    double mean, variance; /* independent part */
    int n_common;
    struct {
        int cause; /* index into the names of this side */
        double mean;
    } common[POINT_COMMON_MAX];
    double rate, length_us; /* of its bracket */
    double tau_us, tau_r_us;
};

struct derived {
    int n, capacity;
    struct derived_point *point;
    int n_causes;
    char (*cause)[40];
    char *rows; /* points and brackets as the dump prints them */
    size_t size;
};

int recording_read(struct recording *r, const char *path, enum replay_surface surface, struct err *e);
void recording_free(struct recording *r);

/* Final points of a session, from its counts. */
int derived_read(struct derived *d, const char *path, struct err *e);
void derived_free(struct derived *d);

/* Measures the recording's job, on the bench of options->seed, into the folder dir; path: of the session of its sample. */
int replay_measure(const struct recording *r, const struct replay_options *options, const char *dir,
                   char path[PATH_MAX], struct err *e);

/* V of the differences r->point[] into v[n * n], and u and z of each point. */
int replay_covariance(double *v, struct replay *r, const struct recording *recording,
                      enum replay_surface surface, const struct derived *measured,
                      const struct derived *simulated, struct err *e);
/* v (lower triangle) becomes the inverse of its Cholesky factor: root v root^T = 1. -ERR_RANGE: not positive. */
int replay_whiten(double *v, int n, struct err *e);

int replay_compare(struct replay *replay, const struct recording *r, enum replay_surface surface,
                   const struct derived *measured, const struct derived *simulated, struct err *e);

#endif
