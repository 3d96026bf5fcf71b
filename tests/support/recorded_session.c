#include "tests/support/recorded_session.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/reduce.h"
#include "proto/session_linearity.h"
#include "tests/support/session_rows.h"
#include "tests/support/synthetic_bench.h"

struct recording {
    struct synthetic bench;
    struct certificate certificate;
    struct reduce_setup setup;
    struct reducer *r;
    struct reduce_sink sink;
    struct session *s;
};

static int store_point(void *arg, struct point *p, struct err *e) {
    return session_add_point(((struct recording *)arg)->s, p, e);
}

static int store_bracket(void *arg, const struct bracket *b, struct err *e) {
    return session_add_bracket(((struct recording *)arg)->s, b, e);
}

static int store_linearity(void *arg, struct linearity *l, struct err *e) {
    return session_add_linearity(((struct recording *)arg)->s, l, e);
}

static void store(struct recording *w, struct exposure *x) {
    ROW_OK(session_begin(w->s, e));
    ROW_OK(session_add_exposure(w->s, x, e));
    ROW_OK(reducer_add(w->r, x, &w->sink, e));
    ROW_OK(session_commit(w->s, e));
}

static void take_dark(struct recording *w, int exposure_us) {
    struct exposure x;
    synthetic_expose(&w->bench, EXPOSURE_DARK, 45, 0, exposure_us, &x);
    store(w, &x);
}

static void take_control(struct recording *w, int closes, int opens) {
    struct exposure x;
    synthetic_wait(&w->bench, 30);
    synthetic_expose(&w->bench, EXPOSURE_REFERENCE, 45, 0, 60000, &x);
    x.control = true;
    x.bracket = closes;
    x.opens = opens;
    store(w, &x);
}

static void take_sample(struct recording *w, int bracket, double theta_i_deg, double theta_v_deg,
                        int exposure_us) {
    struct exposure x;
    synthetic_wait(&w->bench, 20);
    synthetic_expose(&w->bench, EXPOSURE_SAMPLE, theta_i_deg, theta_v_deg, exposure_us, &x);
    x.bracket = bracket;
    store(w, &x);
}

/* Last, so that what is before it keeps its numbers. */
static void take_overlap(struct recording *w) {
    struct exposure x;
    synthetic_wait(&w->bench, 1);
    take_dark(w, 15000);
    for (int k = 0; k < 2; k++) {
        synthetic_wait(&w->bench, 1);
        synthetic_expose(&w->bench, EXPOSURE_OVERLAP, 45, 0, k ? 15000 : 60000, &x);
        x.step = 0;
        store(w, &x);
    }
}

static void write_texts(struct recording *w, const char *certificate) {
    json_t *json = reduce_setup_to_json(&w->setup);
    char *setup = json_dumps(json, 0);
    ROW_OK(session_set_calibration(w->s, &w->setup.calibration, e));
    ROW_OK(session_set_text(w->s, "certificate", certificate, e));
    ROW_OK(session_set_text(w->s, "reduce_setup", setup, e));
    ROW_OK(session_set_text(w->s, "sample",
                            "{\"name\":\"hg60\",\"paint\":\"Hooker's Green\",\"support\":\"drawing paper\","
                            "\"water_percent\":60}",
                            e));
    ROW_OK(session_set_text(w->s, "goniod_version", "0.1.0", e));
    ROW_OK(session_set_text(w->s, "seed", "17", e));
    ROW_OK(session_set_text(w->s, "bench", "foobar", e));
    json_decref(json);
    free(setup);
}

static void measure(struct recording *w) {
    take_dark(w, 60000);
    take_dark(w, 150000);
    take_control(w, 0, 1);
    take_sample(w, 1, 15, -30, 150000);
    take_sample(w, 1, 15, 30, 150000);
    take_sample(w, 1, 45, 30, 3000000); /* saturates */
    take_sample(w, 1, 45, 30, 60000);
    take_control(w, 1, 2);
    take_sample(w, 2, 45, -30, 150000);
    ROW_OK(reducer_end_bracket(w->r, "pause", &w->sink, NULL, NULL, e));
    ROW_OK(session_add_event(w->s, w->bench.now_us, "state", "{\"from\":\"running\",\"to\":\"paused\"}", e));
    synthetic_wait(&w->bench, 4000);
    take_control(w, 0, 3);
    take_sample(w, 3, 45, -30, 150000);
    take_sample(w, 3, 60, -45, 150000);
    take_sample(w, 3, 60, 45, 60000);
    take_control(w, 3, 0);
    take_overlap(w);
}

static void add_exchanges(struct recording *w) {
    static const uint8_t poll[] = {1, 3, 0, 0x7E, 0, 2}, answer[] = {1, 3, 4, 0, 0, 0x40, 0x20};
    static const uint8_t write[] = {1, 6, 0, 0x7D, 0, 8}, refused[] = {1, 0x86, 4};
    for (int n = 0; n < 5; n++)
        ROW_OK(session_add_exchange(w->s, 100000 * n, 100000 * n + 4000, n % 2 ? "rtu:B" : "rtu:A", poll,
                                    sizeof poll, answer, sizeof answer, 0, e));
    ROW_OK(session_add_exchange(w->s, 600000, 604000, "rtu:A", write, sizeof write, refused, sizeof refused,
                                -ERR_DEVICE, e));
    ROW_OK(session_add_exchange(w->s, 700000, 900000, "rtu:A", poll, sizeof poll, NULL, 0, -ERR_TIMEOUT, e));
}

void recorded_session_make(const char *path) {
    struct recording w = {0};
    struct err_list errors = {0};
    struct estimate m;
    synthetic_init(&w.bench, 11);
    w.bench.lamp_rate = 1e-9;
    char *certificate = synthetic_certificate(&w.bench, 0.005);
    assert_int_equal(
        certificate_read_text("c.csv", certificate, strlen(certificate), &w.certificate, &errors), 0);
    w.setup = (struct reduce_setup){.calibration = w.bench.calibration,
                                    .certificate = &w.certificate,
                                    .mean_nm = {400, 700},
                                    .stray_light_rel = 5e-4,
                                    .linearity_rel = 1e-3,
                                    .drift_rate_prior = 1e-9};
    w.sink = (struct reduce_sink){
        .arg = &w, .point = store_point, .bracket = store_bracket, .linearity = store_linearity};
    ROW_OK(reducer_new(&w.r, &w.setup, e));
    ROW_OK(session_create(&w.s, path, e));
    write_texts(&w, certificate);
    measure(&w);
    add_exchanges(&w);
    row_estimate(1, &m);
    ROW_OK(session_add_estimate(w.s, w.bench.now_us, 1, &m, e));
    ROW_OK(session_add_event(w.s, w.bench.now_us, "end", "{\"state\":\"done\"}", e));
    ROW_OK(session_close(w.s, e));
    reducer_free(w.r);
    certificate_free(&w.certificate);
    synthetic_free(&w.bench);
    free(certificate);
}
