/*
 * reduce.h — exposures in, radiance factors out: the arithmetic of measurement.md 1 to 5 and 8.
 *
 * beta = beta_ref (N_s/t_s) / (N_r/t_r) K per pixel, resampled to 81 bands before the ratio. A pure function of
 * the setup and of the sequence of exposures and bracket ends: gonioctl reduce feeds the stored rows through the
 * same calls and gets the same bytes. Only + - * / sqrt and cosine.h: exact on any x86-64.
 *
 * Counts     scaled to 65535 at saturation, electric dark of the same scan taken off, linearised, averaged over
 *            the scans, resampled, stored dark taken off; per scan, not per second.
 * Bands      the ratio of two resampled spectra is beta about the centroid of the light inside the band, as the
 *            diffuser shows it; by the slope of beta between the neighbouring bands it is brought to the centre.
 * Noise      u_ind is the sample reading's own: var = (RN^2 + S/g) / n_scans per pixel, and the noise of the
 *            electric dark, which all bands share; raised to the scatter of the scans where an F test at 99.9 %
 *            says so (point.noisy). All else is a named common part with a signed sensitivity: certificate,
 *            angular/THETA_I/THETA_V (udeg), reference/ID and dark/ID (ID: exposure), stray, linearity,
 *            bench_stray. sensitivity[] holds for each band alone; `mean` is computed with the correlation between
 *            bands, so it is not their average.
 * Drift      the first point of a geometry is provisional: the opening reading stands for its time too. When the
 *            bracket closes, each gets a final one, divided by the straight line between the two control readings;
 *            what is uncertain in that stays with the bracket as its rate.
 * Angles     readbacks: theta_v = sample, theta_i = source - sample, both negated where theta_i < 0 (mirrored). The
 *            certificate is asked at the nominal geometry of the reference reading.
 * Linearity  two overlap readings of one step, a long one and then a shorter one, give a row by linearity_make; from
 *            there on its used_rel stands for linearity_rel.
 * Order      a reading waits for the first dark of its exposure time and scan count when none came before. Control
 *            readings name the bracket they close and the one they open; a bracket number is used once. Saturated
 *            sets and readings of the trap make no point. Of a step's sets in a bracket the last makes the final
 *            point.
 * Errors     -ERR_INPUT exposure and calibration do not fit; -ERR_STATE a bracket or reference is missing;
 *            -ERR_RANGE the certificate does not cover the reference geometry; whatever the sink returns.
 * Checked    tests/unit/test_reduce.c, test_reduce_order.c and test_reduce_linearity.c by hand,
 *            tests/unit/test_reduce_bench.c against light and electrons
 */
#ifndef DAEMON_REDUCE_H
#define DAEMON_REDUCE_H

#include <jansson.h>

#include "daemon/job.h"
#include "proto/calibration.h"
#include "proto/certificate.h"
#include "proto/session.h"

struct config;
struct linearity; /* proto/session_linearity.h */

/* Below it a reference band says less than its neighbours' spread over a paint's edge. */
#define REDUCE_SNR_MIN 10.0

struct reduce_setup {
    struct calibration calibration;
    const struct certificate *certificate; /* outlives the reducer */
    enum job_reference_mode mode;
    double angular_u_rel; /* of the certificate where it is of another geometry; 0 = not stated */
    bool beam_in_view;
    bool without_dark; /* a bench without shutter: only the electric dark is taken off */
    int mean_nm[2];
    double
        drift_rate_prior; /* relative variance per second; alone until two brackets have closed, then it weighs
                                as much as two of them */
    double stray_light_rel; /* of the spectrometer: share of the mean signal (spectrometer-ocean.md 7) */
    double linearity_rel;   /* relative error at full scale that the polynomial leaves */
    double
        bench_stray_beta; /* light that did not come from the sample, as a radiance factor; not subtracted */
    double reference_snr_min; /* 0 = REDUCE_SNR_MIN */
};

struct reducer;

int reducer_new(struct reducer **r, const struct reduce_setup *setup, struct err *e);
void reducer_free(struct reducer *r);
/* Takes one exposure; emit is called for each new point (provisional or final) and each closed bracket. */
struct reduce_sink {
    void *arg;
    int (*point)(void *arg, struct point *p, struct err *e); /* sets p->id */
    int (*bracket)(void *arg, const struct bracket *b, struct err *e);
    int (*linearity)(void *arg, struct linearity *l, struct err *e); /* may be NULL */
};
int reducer_add(struct reducer *r, const struct exposure *x, const struct reduce_sink *sink, struct err *e);
/* An unplanned hold, a long pause, a lamp change or a resume: the open bracket ends here. The steps of the
 * readings that are lost with it, and must be measured again, are reported through `again` (may be NULL). */
int reducer_end_bracket(struct reducer *r, const char *why, const struct reduce_sink *sink,
                        void (*again)(void *arg, int step), void *arg, struct err *e);
/* Number, opening time and present rates of the open bracket, for the drift of provisional points. False: none
 * is open (the rates hold all the same). */
bool reducer_open_bracket(const struct reducer *r, struct bracket *b);
int reducer_waiting(const struct reducer *r); /* readings that still wait for their dark */

/* Auto-exposure: peak fraction of saturation over active pixels of one raw scan (electric dark taken off
 * both). */
double reduce_peak(const struct calibration *c, const uint16_t *counts);

/* What config and job state of it, with the figures for what neither states: all but the calibration. */
void reduce_setup_stated(struct reduce_setup *setup, const struct job *job, const struct config *config);
/* The session text "reduce_setup": all but calibration and certificate, which have their own places. */
json_t *reduce_setup_to_json(const struct reduce_setup *setup);
int reduce_setup_from_json(const json_t *json, struct reduce_setup *setup, struct err *e);
/* The whole setup of a stored session; certificate: the caller's, to be freed after the reducer. */
int reduce_setup_from_session(struct session *s, struct reduce_setup *setup, struct certificate *certificate,
                              struct err *e);
/* Feeds the stored exposures and ends of brackets, in their order, through a reducer. */
int reduce_replay(struct session *s, struct reducer *r, const struct reduce_sink *sink, struct err *e);
/* The same through a reducer as the session's own texts set it up. */
int reduce_anew(struct session *s, const struct reduce_sink *sink, struct err *e);

#endif
