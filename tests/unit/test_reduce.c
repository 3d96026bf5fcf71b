#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/reduce.h"

/* Cases small enough for a pencil: flat spectra of 2048 pixels, a straight wavelength scale of 0.25 nm a pixel. */
#define PIXELS 2048
#define OFFSET 1000
#define BAND_550 34

struct seen {
    int n_points, n_brackets, next_id;
    struct point point[40];
    struct bracket bracket[10];
};

static int see_point(void *arg, struct point *p, struct err *e) {
    (void)e;
    struct seen *s = arg;
    p->id = ++s->next_id;
    s->point[s->n_points++] = *p;
    return 0;
}

static int see_bracket(void *arg, const struct bracket *b, struct err *e) {
    (void)e;
    struct seen *s = arg;
    s->bracket[s->n_brackets++] = *b;
    return 0;
}

struct fixture {
    struct certificate certificate;
    struct reduce_setup setup;
    struct reducer *r;
    struct seen seen;
    struct reduce_sink sink;
    int64_t id, now_us;
};

static void read_certificate(struct certificate *c, const char *text) {
    struct err_list errors = {0};
    assert_int_equal(certificate_read_text("test.csv", text, strlen(text), c, &errors), 0);
    err_list_free(&errors);
}

static const char FLAT[] = "# geometry: 45:0\n# k: 2\nlambda_nm,beta,u\n300,0.9,0.018\n900,0.9,0.018\n";

static void start(struct fixture *f, const char *certificate) {
    memset(f, 0, sizeof *f);
    read_certificate(&f->certificate, certificate);
    f->setup = (struct reduce_setup){.certificate = &f->certificate,
                                     .mode = REFERENCE_FIXED,
                                     .mean_nm = {400, 700},
                                     .drift_rate_prior = 1e-9,
                                     .calibration = {.model = "m",
                                                     .serial = "s",
                                                     .pixels = PIXELS,
                                                     .dark_first = 0,
                                                     .dark_last = 9,
                                                     .active_first = 20,
                                                     .active_last = PIXELS - 1,
                                                     .wavelength = {340, 0.25},
                                                     .saturation = 65535,
                                                     .electrons_per_count = 1,
                                                     .read_noise_counts = 0}};
    f->sink = (struct reduce_sink){&f->seen, see_point, see_bracket};
}

static void begin(struct fixture *f) {
    struct err e = {0};
    if (reducer_new(&f->r, &f->setup, &e) < 0)
        fail_msg("%s", e.text);
}

static void finish(struct fixture *f) {
    reducer_free(f->r);
    certificate_free(&f->certificate);
}

/* One set of two equal scans: `level` counts above the electric dark in every active pixel. */
static void flat_exposure(struct fixture *f, struct exposure *x, enum exposure_kind kind, double level) {
    static uint16_t counts[2 * PIXELS];
    for (int i = 0; i < 2 * PIXELS; i++)
        counts[i] = (uint16_t)(i % PIXELS < 20 ? OFFSET : OFFSET + level);
    f->now_us += 10 * 1000000;
    *x = (struct exposure){.id = ++f->id,
                           .step = (int)f->id,
                           .kind = kind,
                           .theta_i_udeg = 45000000,
                           .source_udeg = 45000000,
                           .start_us = f->now_us - 100000,
                           .end_us = f->now_us + 100000,
                           .exposure_us = 100000,
                           .n_scans = 2,
                           .pixels = PIXELS,
                           .counts = counts};
}

static int give(struct fixture *f, const struct exposure *x) {
    struct err e = {0};
    int rc = reducer_add(f->r, x, &f->sink, &e);
    if (rc < 0)
        print_message("# %s\n", e.text);
    return rc;
}

static void give_flat(struct fixture *f, enum exposure_kind kind, double level, int bracket, int opens) {
    struct exposure x;
    flat_exposure(f, &x, kind, level);
    x.bracket = bracket;
    x.opens = opens;
    x.control = kind == EXPOSURE_REFERENCE;
    assert_int_equal(give(f, &x), 0);
}

static void give_sample(struct fixture *f, double level, double theta_i_deg, double theta_v_deg,
                        int bracket) {
    struct exposure x;
    flat_exposure(f, &x, EXPOSURE_SAMPLE, level);
    x.bracket = bracket;
    x.theta_i_udeg = (int32_t)lround(theta_i_deg * 1e6);
    x.theta_v_udeg = x.sample_udeg = (int32_t)lround(theta_v_deg * 1e6);
    x.source_udeg = x.theta_i_udeg + x.theta_v_udeg;
    assert_int_equal(give(f, &x), 0);
}

static void near(double value, double expected, double relative) {
    if (!(fabs(value - expected) <= relative * fabs(expected)))
        fail_msg("%.17g instead of %.17g", value, expected);
}

static const struct point *last_point(const struct fixture *f) {
    assert_true(f->seen.n_points > 0);
    return &f->seen.point[f->seen.n_points - 1];
}

static const struct point_common *common(const struct point *p, const char *name) {
    for (int k = 0; k < p->n_common; k++)
        if (strcmp(p->common[k].name, name) == 0)
            return &p->common[k];
    fail_msg("no common part '%s'", name);
    return NULL;
}

static void a_ratio_by_hand(void **state) {
    (void)state;
    struct fixture f;
    start(&f, FLAT);
    begin(&f);
    give_flat(&f, EXPOSURE_DARK, 100, 0, 0);
    give_flat(&f, EXPOSURE_REFERENCE, 40100, 0, 1);
    give_sample(&f, 10100, 45, 0, 1);
    const struct point *p = last_point(&f);
    /* 0.9 * (10100 - 100) / (40100 - 100), K = 1 */
    near(p->beta[BAND_550], 0.225, 1e-14);
    near(p->mean, 0.225, 1e-14);
    assert_true(p->provisional && p->supersedes == 0 && p->bracket == 1);
    assert_int_equal(p->theta_i_udeg, 45000000);
    near(p->tau_us, 10e6, 1e-12);
    for (int band = 0; band < BANDS; band++)
        assert_true(p->present[band]);
    /* certificate: 0.018 at k = 2 of 0.9 is 1 % */
    near(common(p, "certificate")->sensitivity[10], 0.225 * 0.01, 1e-12);
    near(common(p, "certificate")->mean, 0.225 * 0.01, 1e-12);
    finish(&f);
}

static void noise_by_hand(void **state) {
    (void)state;
    struct fixture f;
    start(&f, FLAT);
    f.setup.calibration.read_noise_counts = 30;
    f.setup.calibration.electrons_per_count = 2;
    begin(&f);
    give_flat(&f, EXPOSURE_DARK, 0, 0, 0);
    give_flat(&f, EXPOSURE_REFERENCE, 40000, 0, 1);
    give_sample(&f, 10000, 45, 0, 1);
    const struct point *p = last_point(&f);
    /* 39 pixels 0.25 nm apart below a triangle of 5 nm: sum w^2 / (sum w)^2 = (2 * sum_1^19 k^2 + 400) / 400^2 */
    double squares = 400;
    for (int k = 1; k < 20; k++)
        squares += 2.0 * k * k;
    double share = squares / (400.0 * 400.0), electric2 = 900.0 / (10 * 2);
    double factor = 0.225 / 10000;
    near(p->u_ind[40], factor * sqrt((900 + 10000 / 2.0) / 2 * share + electric2), 1e-12);
    near(common(p, "reference/2")->sensitivity[40],
         -0.225 / 40000 * sqrt((900 + 20000.0) / 2 * share + electric2), 1e-12);
    /* The dark is under both: -1 on the sample, + beta/beta_ref on the reference. */
    near(common(p, "dark/1")->sensitivity[40],
         (-factor + 0.225 / 40000) * sqrt(900.0 / 2 * share + electric2), 1e-12);
    double neighbours = 0;
    for (int k = 1; k < 20; k++)
        neighbours += k * (20.0 - k);
    near(p->cov_next[40], factor * factor * (5900.0 / 2 * neighbours / 160000 + electric2), 1e-12);
    /* 61 bands of the mean: all covariances between neighbours, the electric dark in all of them. */
    double mean2 = (61 * 2950 * share + 2 * 60 * 2950 * neighbours / 160000) / (61 * 61) + electric2;
    near(p->mean_u_ind, factor * sqrt(mean2), 1e-12);
    finish(&f);
}

static void scale_and_linearity(void **state) {
    (void)state;
    struct fixture f;
    start(&f, FLAT);
    struct calibration *c = &f.setup.calibration;
    c->saturation = 50000;
    c->nonlinearity[0] = 1;
    c->nonlinearity[1] = -1e-6;
    c->nonlinearity_order = 1;
    c->nonlinearity_used = true;
    f.setup.without_dark = true;
    begin(&f);
    give_flat(&f, EXPOSURE_REFERENCE, 40000, 0, 1);
    give_sample(&f, 10000, 45, 0, 1);
    double s = 10000 * 65535.0 / 50000, r = 4 * s;
    near(last_point(&f)->beta[7], 0.9 * (s / (1 - 1e-6 * s)) / (r / (1 - 1e-6 * r)), 1e-13);
    assert_int_equal(last_point(&f)->n_common, 2); /* certificate, reference: no dark was taken */
    finish(&f);
}

static void filling_and_time_by_hand(void **state) {
    (void)state;
    for (int beam_in_view = 0; beam_in_view < 2; beam_in_view++) {
        struct fixture f;
        struct exposure x;
        start(&f, FLAT);
        f.setup.beam_in_view = beam_in_view;
        f.setup.without_dark = true;
        begin(&f);
        give_flat(&f, EXPOSURE_REFERENCE, 40000, 0, 1);
        flat_exposure(&f, &x, EXPOSURE_SAMPLE, 10000);
        x.bracket = 1;
        x.exposure_us = 400000;
        x.theta_i_udeg = 60000000;
        x.theta_v_udeg = -30000000;
        x.mirrored = true;
        x.source_udeg = -30000000;
        x.sample_udeg = 30000000;
        assert_int_equal(give(&f, &x), 0);
        double k = beam_in_view ? 1 / cos(M_PI / 6) : cos(M_PI / 4) / 0.5;
        near(last_point(&f)->beta[3], 0.9 * 0.25 * k / 4, 1e-14);
        assert_int_equal(last_point(&f)->theta_i_udeg, 60000000);
        assert_int_equal(last_point(&f)->theta_v_udeg, -30000000);
        finish(&f);
    }
}

static void the_bridge_by_hand(void **state) {
    (void)state;
    struct fixture f;
    start(&f, FLAT);
    f.setup.without_dark = true;
    begin(&f);
    give_flat(&f, EXPOSURE_REFERENCE, 40000, 0, 1);
    give_sample(&f, 10000, 45, 0, 1);
    give_sample(&f, 20000, 45, 0, 1);
    give_flat(&f, EXPOSURE_REFERENCE, 43000, 1, 2);
    give_sample(&f, 10000, 45, 0, 2);
    assert_int_equal(f.seen.n_points, 5);
    assert_int_equal(f.seen.n_brackets, 1);
    const struct point *p = f.seen.point;
    near(p[0].mean, 0.9 * 0.25, 1e-13);
    near(p[2].mean, 0.9 * 10000 / 41000, 1e-13);
    near(p[3].mean, 0.9 * 20000 / 42000, 1e-13);
    near(p[4].mean, 0.9 * 10000 / 43000, 1e-13);
    assert_false(p[2].provisional);
    assert_int_equal(p[2].supersedes, p[0].id);
    assert_int_equal(p[3].supersedes, p[1].id);
    assert_int_equal(p[2].exposure_id, p[0].exposure_id);
    assert_int_equal(p[4].bracket, 2);
    const struct bracket *b = f.seen.bracket;
    assert_string_equal(b->ended_by, "reference");
    assert_int_equal(b->number, 1);
    assert_int_equal(b->close_us - b->open_us, 30 * 1000000);
    near(b->mean_rate, 1e-9, 1e-12); /* one interval: the prior still stands alone */
    /* A third of the way: 2/3 of the opening reading's noise, 1/3 of the closing one's. */
    const struct point_common *open = common(&p[2], "reference/1"), *close = common(&p[2], "reference/4");
    near(open->sensitivity[5] / close->sensitivity[5], 2 * sqrt(40000.0) / sqrt(43000.0), 1e-12);
    finish(&f);
}

static void rates_are_learned_from_successive_references(void **state) {
    (void)state;
    struct fixture f;
    struct bracket open;
    start(&f, FLAT);
    f.setup.without_dark = true;
    f.setup.calibration.electrons_per_count = 1e12;
    begin(&f);
    assert_false(reducer_open_bracket(f.r, &open));
    give_flat(&f, EXPOSURE_REFERENCE, 40000, 0, 1);
    give_flat(&f, EXPOSURE_REFERENCE, 40400, 1, 2);
    give_flat(&f, EXPOSURE_REFERENCE, 40400, 2, 3);
    assert_true(reducer_open_bracket(f.r, &open));
    assert_int_equal(open.number, 3);
    /* (400 / 40200)^2 in 10 s, then 0; the prior counts as two more. */
    double rate = (2 * 1e-9 + pow(400.0 / 40200, 2) / 10) / 4;
    near(open.mean_rate, rate, 1e-9);
    near(open.rate[0], rate, 1e-9);
    near(open.rate[80], rate, 1e-9);
    near(f.seen.bracket[0].mean_rate, 1e-9, 1e-12);
    near(f.seen.bracket[1].mean_rate, rate, 1e-9);
    finish(&f);
}

static void every_geometry_uses_its_own_reading(void **state) {
    (void)state;
    struct fixture f;
    struct exposure x;
    start(&f, "# geometry: in-plane table\n# k: 1\nlambda_nm,beta,u,theta_i_deg,theta_v_deg\n"
              "300,0.9,0.009,45,0\n900,0.9,0.009,45,0\n300,0.8,0.008,60,0\n900,0.8,0.008,60,0\n");
    f.setup.mode = REFERENCE_EVERY_GEOMETRY;
    f.setup.without_dark = true;
    begin(&f);
    give_flat(&f, EXPOSURE_REFERENCE, 40000, 0, 1);   /* 0 s of 40 */
    flat_exposure(&f, &x, EXPOSURE_REFERENCE, 30000); /* 10 s */
    x.bracket = 1;
    x.theta_i_udeg = x.source_udeg = 60000000;
    assert_int_equal(give(&f, &x), 0);
    f.now_us += 10 * 1000000;
    give_sample(&f, 10000, 60, 0, 1); /* 30 s */
    give_flat(&f, EXPOSURE_REFERENCE, 44000, 1, 0);
    near(f.seen.point[0].mean, 0.8 / 3, 1e-13);
    near(f.seen.point[0].tau_r_us, 10e6, 1e-12);
    near(f.seen.point[0].tau_us, 30e6, 1e-12);
    near(f.seen.point[1].mean, 0.8 * 10000 / (30000 * 43000.0 / 41000.0), 1e-13);
    /* A geometry without a reading of its own is not divided by another's. */
    give_flat(&f, EXPOSURE_REFERENCE, 40000, 0, 2);
    flat_exposure(&f, &x, EXPOSURE_SAMPLE, 1000);
    x.bracket = 2;
    x.theta_i_udeg = x.source_udeg = 30000000;
    assert_int_equal(give(&f, &x), -ERR_STATE);
    finish(&f);
}

static void note_step(void *arg, int step) {
    *(int *)arg = *(int *)arg * 100 + step;
}

static void an_ended_bracket_is_measured_again(void **state) {
    (void)state;
    struct fixture f;
    struct err e = {0};
    int steps = 0;
    start(&f, FLAT);
    f.setup.without_dark = true;
    begin(&f);
    assert_int_equal(reducer_end_bracket(f.r, "hold", &f.sink, note_step, &steps, &e), 0);
    assert_int_equal(f.seen.n_brackets, 0);
    give_flat(&f, EXPOSURE_REFERENCE, 40000, 0, 1);
    give_sample(&f, 10000, 45, 0, 1);
    give_sample(&f, 10000, 45, 10, 1);
    assert_int_equal(reducer_end_bracket(f.r, "hold", &f.sink, note_step, &steps, &e), 0);
    assert_int_equal(steps, 203);
    assert_int_equal(f.seen.n_brackets, 1);
    assert_string_equal(f.seen.bracket[0].ended_by, "hold");
    assert_int_equal(f.seen.bracket[0].close_us, 0);
    assert_int_equal(f.seen.bracket[0].last_exposure_id, 3);
    give_flat(&f, EXPOSURE_REFERENCE, 40000, 0, 2);
    give_flat(&f, EXPOSURE_REFERENCE, 40000, 2, 0);
    assert_int_equal(f.seen.n_points, 2); /* provisional for good */
    struct exposure x;
    flat_exposure(&f, &x, EXPOSURE_REFERENCE, 40000);
    x.control = true;
    x.opens = 2; /* a number used before */
    assert_int_equal(give(&f, &x), -ERR_STATE);
    finish(&f);
}

static void saturated_and_repeated_sets(void **state) {
    (void)state;
    struct fixture f;
    struct exposure x;
    start(&f, FLAT);
    f.setup.without_dark = true;
    begin(&f);
    give_flat(&f, EXPOSURE_REFERENCE, 40000, 0, 1);
    flat_exposure(&f, &x, EXPOSURE_SAMPLE, 60000);
    x.bracket = 1;
    x.saturated_pixels = 1;
    assert_int_equal(give(&f, &x), 0);
    assert_int_equal(f.seen.n_points, 0);
    flat_exposure(&f, &x, EXPOSURE_SAMPLE, 10000);
    x.bracket = 1;
    x.step = 7;
    assert_int_equal(give(&f, &x), 0);
    flat_exposure(&f, &x, EXPOSURE_SAMPLE, 12000);
    x.bracket = 1;
    x.step = 7;
    assert_int_equal(give(&f, &x), 0);
    give_flat(&f, EXPOSURE_REFERENCE, 40000, 1, 0);
    assert_int_equal(f.seen.n_points, 3);
    near(f.seen.point[2].mean, 0.9 * 0.3, 1e-13);
    assert_int_equal(f.seen.point[2].supersedes, f.seen.point[1].id);
    finish(&f);
}

static void a_reading_waits_for_its_dark(void **state) {
    (void)state;
    struct fixture f;
    struct exposure x;
    start(&f, FLAT);
    begin(&f);
    give_flat(&f, EXPOSURE_REFERENCE, 40100, 0, 1);
    give_sample(&f, 10100, 45, 0, 1);
    assert_int_equal(reducer_waiting(f.r), 2);
    flat_exposure(&f, &x, EXPOSURE_DARK, 100);
    x.exposure_us = 200000;
    assert_int_equal(give(&f, &x), 0);
    flat_exposure(&f, &x, EXPOSURE_DARK, 100);
    x.n_scans = 1;
    assert_int_equal(give(&f, &x), 0);
    assert_int_equal(f.seen.n_points, 0);
    give_flat(&f, EXPOSURE_DARK, 100, 0, 0);
    assert_int_equal(reducer_waiting(f.r), 0);
    near(last_point(&f)->mean, 0.225, 1e-13);
    give_flat(&f, EXPOSURE_DARK, 200, 0, 0);
    give_sample(&f, 10200, 45, 0, 1); /* the newest dark counts */
    near(last_point(&f)->mean, 0.225, 1e-13);
    finish(&f);
}

static void weak_or_uncertified_bands_are_missing(void **state) {
    (void)state;
    struct fixture f;
    struct exposure x;
    start(&f, "# geometry: 45:0\n# k: 1\nlambda_nm,beta,u\n500,0.9,0.009\n900,0.9,0.009\n");
    f.setup.without_dark = true;
    f.setup.calibration.read_noise_counts = 30;
    begin(&f);
    flat_exposure(&f, &x, EXPOSURE_REFERENCE, 40000);
    for (int p = 0; p < 2 * PIXELS; p++)
        if (p % PIXELS > (600 - 340) * 4)
            x.counts[p] = OFFSET + 20;
    x.opens = 1;
    x.control = true;
    assert_int_equal(give(&f, &x), 0);
    give_sample(&f, 10000, 45, 0, 1);
    const struct point *p = last_point(&f);
    for (int band = 0; band < BANDS; band++) {
        bool expected = band_nm(band) >= 500 && band_nm(band) <= 600;
        assert_int_equal(p->present[band], expected);
        assert_int_equal(isnan(p->beta[band]), !expected);
    }
    assert_true(isnan(p->mean) && isnan(p->mean_u_ind) && isnan(p->common[0].mean));
    assert_true(p->cov_next[(600 - 380) / 5] == 0 && p->cov_next[(595 - 380) / 5] > 0);
    finish(&f);
}

static void stated_parts_by_hand(void **state) {
    (void)state;
    struct fixture f;
    start(&f,
          "# geometry: 8:di\n# k: 1\n# correlation_nm: 5\nlambda_nm,beta,u\n300,0.9,0.009\n900,0.9,0.009\n");
    f.setup.without_dark = true;
    f.setup.angular_u_rel = 0.03;
    f.setup.stray_light_rel = 1e-3;
    f.setup.linearity_rel = 2e-3;
    f.setup.bench_stray_beta = 1e-4;
    begin(&f);
    give_flat(&f, EXPOSURE_REFERENCE, 40000, 0, 1);
    give_sample(&f, 10000, 45, 0, 1);
    const struct point *p = last_point(&f);
    near(common(p, "angular/45000000/0")->mean, 0.225 * 0.03, 1e-12);
    assert_true(fabs(common(p, "stray")->mean) < 1e-15); /* flat spectra: the same share of both */
    near(common(p, "linearity")->mean, 0.225 * 2e-3 * (10000 - 40000) / 65535, 1e-12);
    near(common(p, "bench_stray")->mean, 1e-4 * (1 - 0.225 / 0.9), 1e-12);
    double sum = 0;
    for (int i = 0; i < 61; i++)
        for (int j = 0; j < 61; j++)
            sum += exp(-abs(i - j));
    near(common(p, "certificate")->mean, 0.225 * 0.01 * sqrt(sum) / 61, 1e-12);
    near(common(p, "certificate")->sensitivity[3], 0.225 * 0.01, 1e-12);
    finish(&f);
}

static void bad_setups_are_refused(void **state) {
    (void)state;
    struct fixture f;
    struct exposure x;
    start(&f, FLAT);
    f.setup.mean_nm[0] = 790;
    assert_int_equal(reducer_new(&f.r, &f.setup, NULL), -ERR_RANGE);
    f.setup.mean_nm[0] = 400;
    f.setup.calibration.wavelength[1] = -0.25;
    assert_int_equal(reducer_new(&f.r, &f.setup, NULL), -ERR_INPUT);
    f.setup.calibration.wavelength[1] = 0.25;
    begin(&f);
    flat_exposure(&f, &x, EXPOSURE_DARK, 100);
    x.pixels = 100;
    assert_int_equal(give(&f, &x), -ERR_INPUT);
    flat_exposure(&f, &x, EXPOSURE_REFERENCE, 100);
    x.bracket = 5; /* neither opened nor opening */
    give_flat(&f, EXPOSURE_DARK, 100, 0, 0);
    assert_int_equal(give(&f, &x), -ERR_STATE);
    finish(&f);
}

static void the_peak_of_a_raw_scan(void **state) {
    (void)state;
    struct fixture f;
    struct exposure x;
    start(&f, FLAT);
    f.setup.calibration.saturation = 61000;
    flat_exposure(&f, &x, EXPOSURE_SAMPLE, 30000);
    x.counts[15] = 65000; /* not an active pixel */
    near(reduce_peak(&f.setup.calibration, x.counts), 0.5, 1e-13);
    certificate_free(&f.certificate);
}

static void the_setup_survives_json(void **state) {
    (void)state;
    struct reduce_setup a = {.mode = REFERENCE_START_END,
                             .angular_u_rel = 0.1 / 3,
                             .beam_in_view = true,
                             .mean_nm = {405, 695},
                             .drift_rate_prior = 1e-9 / 7,
                             .stray_light_rel = 1e-3 / 3,
                             .reference_snr_min = 12},
                        b = {0};
    json_t *json = reduce_setup_to_json(&a);
    char *text = json_dumps(json, 0);
    json_t *again = json_loads(text, 0, NULL);
    assert_int_equal(reduce_setup_from_json(again, &b, NULL), 0);
    assert_memory_equal(&a, &b, sizeof a);
    assert_int_equal(reduce_setup_from_json(json_null(), &b, NULL), -ERR_INPUT);
    json_decref(json);
    json_decref(again);
    free(text);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_ratio_by_hand),
        cmocka_unit_test(noise_by_hand),
        cmocka_unit_test(scale_and_linearity),
        cmocka_unit_test(filling_and_time_by_hand),
        cmocka_unit_test(the_bridge_by_hand),
        cmocka_unit_test(rates_are_learned_from_successive_references),
        cmocka_unit_test(every_geometry_uses_its_own_reading),
        cmocka_unit_test(an_ended_bracket_is_measured_again),
        cmocka_unit_test(saturated_and_repeated_sets),
        cmocka_unit_test(a_reading_waits_for_its_dark),
        cmocka_unit_test(weak_or_uncertified_bands_are_missing),
        cmocka_unit_test(stated_parts_by_hand),
        cmocka_unit_test(bad_setups_are_refused),
        cmocka_unit_test(the_peak_of_a_raw_scan),
        cmocka_unit_test(the_setup_survives_json),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
