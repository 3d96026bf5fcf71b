/*
 * flat_bench.h — cases of the reduction small enough for a pencil.
 *
 * Flat spectra of 2048 pixels, a straight wavelength scale of 0.25 nm a pixel from 340 nm, no noise unless a test
 * sets it, two equal scans of 100 ms every 10 s, reference geometry 45:0.
 */
#ifndef TESTS_SUPPORT_FLAT_BENCH_H
#define TESTS_SUPPORT_FLAT_BENCH_H

#include "daemon/reduce.h"

#define PIXELS 2048
#define OFFSET 1000 /* electric dark, counts */
#define BAND_550 34

struct seen {
    int n_points, n_brackets, next_id;
    struct point point[40];
    struct bracket bracket[10];
};

struct fixture {
    struct certificate certificate;
    struct reduce_setup setup;
    struct reducer *r;
    struct seen seen;
    struct reduce_sink sink;
    int64_t id, now_us;
};

extern const char FLAT[]; /* certificate: 0.9 at 45:0, u = 1 % of it */

void start(struct fixture *f, const char *certificate);
void begin(struct fixture *f); /* after the test has changed f->setup */
void finish(struct fixture *f);
/* One set: `level` counts above the electric dark in every active pixel. */
void flat_exposure(struct fixture *f, struct exposure *x, enum exposure_kind kind, double level);
int give(struct fixture *f, const struct exposure *x);
void give_flat(struct fixture *f, enum exposure_kind kind, double level, int bracket, int opens);
void give_sample(struct fixture *f, double level, double theta_i_deg, double theta_v_deg, int bracket);

void near(double value, double expected, double relative);
const struct point *last_point(const struct fixture *f);
const struct point_common *common(const struct point *p, const char *name);

#endif
