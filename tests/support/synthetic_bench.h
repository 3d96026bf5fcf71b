/*
 * synthetic_bench.h — raw counts for tests of the reduction, formed from light and electrons.
 *
 * Lamp power -> irradiance on the tilted surface -> radiance beta E / pi -> flux through the inner spot -> electrons
 * in the integration time -> counts through the inverse of the non-linearity -> offset, thermal dark with a pattern
 * -> Gaussian noise -> rounding and clipping. Shares no formula with the reduction.
 * Checked    by the tests that use it: they compare beta with the truth given here.
 */
#ifndef TESTS_SUPPORT_SYNTHETIC_BENCH_H
#define TESTS_SUPPORT_SYNTHETIC_BENCH_H

#include "proto/session.h"

struct synthetic {
    uint64_t seed;
    bool beam_in_view;
    bool noise; /* counting, reading and rounding */
    double
        extra_noise; /* factor on the noise's standard deviation that the spectrometer's figures do not tell */
    double lamp_rate;   /* relative variance per second of its Brownian motion */
    double lamp;        /* power now, 1 at the start */
    double slope_per_s; /* and a steady drift */
    double full; /* counts per millisecond of a perfect diffuser at 45:0 in the middle of the spectrum */
    int64_t now_us;
    int64_t next_id;
    double sample_level; /* beta of the sample = level (0.5 + 0.5 lambda share) (1 + tilt sin theta_v) */
    double reference_tilt;
    struct calibration calibration;
    uint16_t *counts;
    int n_scans;
    double gauss_left;
    bool has_gauss;
};

void synthetic_init(struct synthetic *s, uint64_t seed);
void synthetic_free(struct synthetic *s);

double synthetic_sample_beta(const struct synthetic *s, double theta_i_deg, double theta_v_deg,
                             double lambda_nm);
/* CSV of a certificate that tells the truth: an in-plane table wide enough for all tests. */
char *synthetic_certificate(const struct synthetic *s, double u_rel);

/* Lets time and lamp go on, then takes a set; the counts stay valid until the next. */
void synthetic_expose(struct synthetic *s, enum exposure_kind kind, double theta_i_deg, double theta_v_deg,
                      int exposure_us, struct exposure *x);
void synthetic_wait(struct synthetic *s, double seconds);

#endif
