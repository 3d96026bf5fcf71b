#include "tests/support/flat_bench.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

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

static void read_certificate(struct certificate *c, const char *text) {
    struct err_list errors = {0};
    assert_int_equal(certificate_read_text("test.csv", text, strlen(text), c, &errors), 0);
    err_list_free(&errors);
}

const char FLAT[] = "# geometry: 45:0\n# k: 2\nlambda_nm,beta,u\n300,0.9,0.018\n900,0.9,0.018\n";

void start(struct fixture *f, const char *certificate) {
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
    f->sink = (struct reduce_sink){.arg = &f->seen, .point = see_point, .bracket = see_bracket};
}

void begin(struct fixture *f) {
    struct err e = {0};
    if (reducer_new(&f->r, &f->setup, &e) < 0)
        fail_msg("%s", e.text);
}

void finish(struct fixture *f) {
    reducer_free(f->r);
    certificate_free(&f->certificate);
}

void flat_exposure(struct fixture *f, struct exposure *x, enum exposure_kind kind, double level) {
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

int give(struct fixture *f, const struct exposure *x) {
    struct err e = {0};
    int rc = reducer_add(f->r, x, &f->sink, &e);
    if (rc < 0)
        print_message("# %s\n", e.text);
    return rc;
}

void give_flat(struct fixture *f, enum exposure_kind kind, double level, int bracket, int opens) {
    struct exposure x;
    flat_exposure(f, &x, kind, level);
    x.bracket = bracket;
    x.opens = opens;
    x.control = kind == EXPOSURE_REFERENCE;
    assert_int_equal(give(f, &x), 0);
}

void give_sample(struct fixture *f, double level, double theta_i_deg, double theta_v_deg, int bracket) {
    struct exposure x;
    flat_exposure(f, &x, EXPOSURE_SAMPLE, level);
    x.bracket = bracket;
    x.theta_i_udeg = (int32_t)lround(theta_i_deg * 1e6);
    x.theta_v_udeg = x.sample_udeg = (int32_t)lround(theta_v_deg * 1e6);
    x.source_udeg = x.theta_i_udeg + x.theta_v_udeg;
    assert_int_equal(give(f, &x), 0);
}

void near(double value, double expected, double relative) {
    if (!(fabs(value - expected) <= relative * fabs(expected)))
        fail_msg("%.17g instead of %.17g", value, expected);
}

const struct point *last_point(const struct fixture *f) {
    assert_true(f->seen.n_points > 0);
    return &f->seen.point[f->seen.n_points - 1];
}

const struct point_common *common(const struct point *p, const char *name) {
    for (int k = 0; k < p->n_common; k++)
        if (strcmp(p->common[k].name, name) == 0)
            return &p->common[k];
    fail_msg("no common part '%s'", name);
    return NULL;
}
