/*
 * reduce_internal.h — what the files of daemon/reduce*.c share, and nobody else includes.
 * Checked    tests/unit/test_reduce*.c
 */
#ifndef DAEMON_REDUCE_INTERNAL_H
#define DAEMON_REDUCE_INTERNAL_H

#include "daemon/reduce.h"
#include "proto/session_linearity.h"

/* Noise of 81 bands: neighbours share pixels (cov_next), and all share the electric dark, each by its amount. */
struct band_noise {
    double var[BANDS], cov_next[BANDS]; /* counts^2 */
    double electric[BANDS];             /* counts for one standard uncertainty of the electric dark */
};

struct spectrum { /* counts per scan by band; bands outside the spectrometer's range are 0 */
    double value[BANDS];
    double moment[BANDS]; /* counts nm: the same average of count times distance from the band's centre */
    struct band_noise noise;
    double mean; /* over the active pixels */
    double scan_f;
    bool noisy;
};

struct resampler { /* weights of the pixels in each band, adding up to 1 */
    bool covered[BANDS];
    int first[BANDS], last[BANDS];
    double *weight[BANDS]; /* [last - first + 1] */
    double *memory;
};

int resampler_init(struct resampler *s, const struct calibration *c, struct err *e);
void resampler_free(struct resampler *s);
int spectrum_make(struct spectrum *s, const struct calibration *c, const struct resampler *bands,
                  const struct exposure *x, struct err *e);

/* Variance of sum_b gradient[b] value[b] over the bands from first to last. */
double noise_of_sum(const struct band_noise *noise, const double *gradient, int first, int last);
double noise_of_band(const struct band_noise *noise, int band); /* standard uncertainty, counts */

struct dark {
    struct dark *next;
    int64_t exposure_id;
    int exposure_us, n_scans;
    struct spectrum spectrum;
};

struct reading {
    struct reading *next;
    enum exposure_kind kind;
    int64_t exposure_id;
    int step, bracket, opens;
    bool control, mirrored;
    int32_t nominal_i_udeg, nominal_v_udeg;
    int32_t theta_i_udeg, theta_v_udeg; /* from readbacks */
    double at_us;                       /* the middle of the set */
    int exposure_us, n_scans;
    struct spectrum light;
    const struct dark *dark;   /* NULL: none subtracted */
    double net[BANDS];         /* light - dark, counts per scan */
    double centroid_nm[BANDS]; /* of that light inside the band, from its centre */
    int64_t point_id;          /* of the provisional point, 0 = none yet */
    struct reading *reference; /* of a sample: what it is divided by */
};

/* Between two control readings. While open, `close` is NULL and the opening reading stands for all times. */
struct bridge {
    const struct reading *open, *close;
};

struct drift {                   /* what successive control readings told of the lamp */
    double sum[BANDS], sum_mean; /* of the relative variance per second */
    int n[BANDS], n_mean;
};

void drift_add(struct drift *d, const struct bridge *b, const struct reduce_setup *setup);
void drift_rates(const struct drift *d, double prior, double rate[BANDS], double *mean_rate);

/* False: one of the two shows no light, and nothing is said. */
bool linearity_make(struct linearity *l, const struct reading *slow, const struct reading *fast,
                    const bool *covered, double prior_rel, double drift_rate);

int mean_first_band(const struct reduce_setup *setup);
int mean_last_band(const struct reduce_setup *setup);

/* One point from a sample reading, its reference and the bridge; id and supersedes are left 0. */
int point_make(struct point *p, const struct reduce_setup *setup, const struct resampler *bands,
               const struct reading *sample, const struct bridge *bridge, struct err *e);

#endif
