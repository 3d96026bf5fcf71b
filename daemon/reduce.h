/*
 * reduce.h — exposures in, radiance factors out: the arithmetic of measurement.md 1 to 5 and 8.
 *
 * beta = beta_ref (N_s/t_s) / (N_r/t_r) K per pixel, resampled to 81 bands before the ratio. A pure function
 * of the setup and of the sequence of exposures and bracket events: gonioctl reduce feeds the stored rows
 * through the same calls and gets the same bytes. Only + - * / sqrt and cosine.h: exact on any x86-64.
 *
 * The first point of a geometry is provisional (drift extrapolated); closing its bracket issues the final
 * one. Checked    tests/unit/test_reduce.c
 */
#ifndef DAEMON_REDUCE_H
#define DAEMON_REDUCE_H

#include "daemon/job.h"
#include "proto/calibration.h"
#include "proto/certificate.h"
#include "proto/session.h"

struct reduce_setup {
    struct calibration calibration;
    const struct certificate *certificate;
    enum job_reference_mode mode;
    double reference_theta_i_deg, reference_theta_v_deg;
    double angular_u_rel;
    bool beam_in_view;
    int mean_nm[2];
    double
        drift_rate_prior; /* relative variance per second until successive references tell; with its weight */
    double stray_light_rel, linearity_rel;
    double bracket_max_us;
    int32_t source_zero_udeg,
        sample_zero_udeg; /* readbacks are user coordinates: theta_v = sample, theta_i = source - sample */
};

struct reducer;

int reducer_new(struct reducer **r, const struct reduce_setup *setup, struct err *e);
void reducer_free(struct reducer *r);
/* Takes one exposure; emit is called for each new point (provisional or final) and each closed bracket. */
struct reduce_sink {
    void *arg;
    int (*point)(void *arg, struct point *p, struct err *e); /* sets p->id */
    int (*bracket)(void *arg, const struct bracket *b, struct err *e);
};
int reducer_add(struct reducer *r, const struct exposure *x, const struct reduce_sink *sink, struct err *e);
/* An unplanned hold, a long pause, a lamp change or a resume: the open bracket ends here. The exposure ids of
 * the sample readings since its last reference, which must be measured again, are reported through `again`.
 */
int reducer_end_bracket(struct reducer *r, int64_t now_us, const char *why, const struct reduce_sink *sink,
                        void (*again)(void *arg, int step), void *arg, struct err *e);

/* Auto-exposure: peak fraction of saturation over active pixels of one raw scan (electric dark taken off
 * both). */
double reduce_peak(const struct calibration *c, const uint16_t *counts);

#endif
