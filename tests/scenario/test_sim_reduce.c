/* Counts of the simulated bench through the reduction: what the bench forms from irradiance and etendue must come out
 * as the radiance factor of its surface, in all four reference modes and both filling cases. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/reduce.h"
#include "proto/file.h"
#include "proto/units.h"
#include "sim/sim_bench.h"

#define SCANS 4
#define SEEDS 4
#define BRACKET_GEOMETRIES 12
#define WARM_US (60 * US_PER_MIN)

struct rig {
    struct clock clock;
    struct sim_config config;
    struct sim_bench *bench;
    struct sim_surface surface;
    struct certificate certificate;
    struct reduce_setup setup;
    struct reducer *reducer;
    uint16_t *counts;
    int64_t now_us, id;
    int step;
    /* what came out */
    double sum, square, worst;
    int n;
    double rate;
};

static void score(struct rig *r, const struct point *p) {
    double i = deg_from_udeg(p->theta_i_udeg), v = deg_from_udeg(p->theta_v_udeg), truth = 0, variance;
    for (int k = 4; k <= 64; k++)
        truth += sim_surface_beta(&r->surface, i, v, k) / 61;
    variance = p->mean_u_ind * p->mean_u_ind;
    for (int c = 0; c < p->n_common; c++)
        if (strcmp(p->common[c].name, "certificate") != 0) /* its draw is known here and taken out */
            variance += p->common[c].mean * p->common[c].mean;
    double length_us = 600e6, drift = r->rate * p->tau_us * 1e-6 * (length_us - p->tau_us) / length_us;
    variance += p->mean * p->mean * fmax(0, drift);
    double pull = (p->mean * r->bench->truth.diffuser_factor - truth) / sqrt(variance);
    r->sum += pull;
    r->square += pull * pull;
    r->worst = fmax(r->worst, fabs(pull));
    r->n++;
}

static int see_point(void *arg, struct point *p, struct err *e) {
    (void)e;
    struct rig *r = arg;
    p->id = ++r->id;
    if (!p->provisional)
        score(r, p);
    return 0;
}

static int see_bracket(void *arg, const struct bracket *b, struct err *e) {
    (void)arg;
    (void)b;
    (void)e;
    return 0;
}

static void calibrate(struct calibration *c, const struct detector_model *m) {
    *c = (struct calibration){.pixels = m->pixels,
                              .dark_first = 6,
                              .dark_last = 17,
                              .active_first = m->active_first,
                              .active_last = m->active_last,
                              .nonlinearity_order = 7,
                              .nonlinearity_used = true,
                              .saturation = m->saturation,
                              .read_noise_counts = m->read_noise_counts,
                              .electrons_per_count = m->electrons_per_count};
    memcpy(c->wavelength, m->wavelength, sizeof c->wavelength);
    memcpy(c->nonlinearity, m->nonlinearity, sizeof c->nonlinearity);
}

static void rig_new(struct rig *r, uint64_t seed, bool beam_in_view, enum job_reference_mode mode) {
    struct err_list errors = {0};
    struct err e = {0};
    char *text;
    size_t size;
    memset(r, 0, sizeof *r);
    clock_init_virtual(&r->clock);
    sim_config_default(&r->config);
    r->config.seed = seed;
    r->config.n_axes = 0;
    r->config.filling = beam_in_view ? SIM_BEAM_IN_VIEW : SIM_VIEW_IN_BEAM;
    r->config.beam_mm = beam_in_view ? 3 : 20;
    r->config.view_mm = beam_in_view ? 20 : 3;
    r->rate = r->config.lamp_drift_rate;
    assert_int_equal(sim_bench_new(&r->bench, &r->config, &r->clock, &e), 0);
    assert_int_equal(sim_paint_find("Hooker's Green", "drawing paper", 60, &r->surface, &e), 0);
    assert_int_equal(sim_bench_mount(r->bench, "sample", &r->surface, &e), 0);
    lamp_switch(&r->bench->truth.lamp, 0, true);
    assert_int_equal(file_read("docs/examples/demo/ptfe.csv", 1 << 20, &text, &size, &e), 0);
    assert_int_equal(certificate_read_text("ptfe.csv", text, size, &r->certificate, &errors), 0);
    free(text);
    r->setup = (struct reduce_setup){.certificate = &r->certificate,
                                     .mode = mode,
                                     .beam_in_view = beam_in_view,
                                     .mean_nm = {400, 700},
                                     .drift_rate_prior = r->rate,
                                     .stray_light_rel = r->config.stray_light};
    calibrate(&r->setup.calibration, r->bench->truth.detector.model);
    assert_int_equal(reducer_new(&r->reducer, &r->setup, &e), 0);
    r->counts = calloc((size_t)SCANS * 2048, sizeof *r->counts);
    r->now_us = WARM_US;
}

static void rig_free(struct rig *r) {
    reducer_free(r->reducer);
    certificate_free(&r->certificate);
    sim_bench_free(r->bench);
    free(r->counts);
}

static void take(struct rig *r, struct exposure *x, double theta_i_deg, double theta_v_deg) {
    struct reduce_sink sink = {.arg = r, .point = see_point, .bracket = see_bracket};
    struct err e = {0};
    bool dark = x->kind == EXPOSURE_DARK;
    sim_bench_hold(r->bench, x->kind == EXPOSURE_REFERENCE ? "reference" : "sample", &e);
    sim_bench_turn(r->bench, "source", theta_i_deg + theta_v_deg, &e);
    sim_bench_turn(r->bench, "sample", theta_v_deg, &e);
    lamp_switch(&r->bench->truth.lamp, r->now_us, !dark);
    x->id = ++r->id;
    x->step = r->step++;
    x->theta_i_udeg = udeg_from_deg(theta_i_deg);
    x->theta_v_udeg = x->sample_udeg = udeg_from_deg(theta_v_deg);
    x->source_udeg = x->theta_i_udeg + x->theta_v_udeg;
    x->settled_us = r->now_us;
    x->start_us = r->now_us += 100000;
    x->n_scans = SCANS;
    x->pixels = 2048;
    x->lamp = !dark;
    x->temperature_c = 30;
    x->counts = r->counts;
    for (int s = 0; s < SCANS; s++, r->now_us += x->exposure_us)
        truth_frame(&r->bench->truth, r->now_us, r->now_us + x->exposure_us, (uint32_t)x->exposure_us,
                    r->counts + (size_t)s * 2048);
    x->end_us = r->now_us;
    if (reducer_add(r->reducer, x, &sink, &e) < 0)
        fail_msg("%s", e.text);
}

/* Exposures as an operator would choose them, a dark before each new one. */
static int exposure_for(const struct rig *r, double theta_i_deg, double theta_v_deg, bool reference) {
    double beta = reference ? 1.2 : 0;
    for (int k = 0; k < BANDS && !reference; k++)
        beta = fmax(beta, sim_surface_beta(&r->surface, theta_i_deg, theta_v_deg, k));
    double through = optics_throughput(&r->bench->truth.optics, theta_i_deg, theta_v_deg);
    return (int)(0.8 * TRUTH_FULL_SCALE_US / (beta * through)) / 1000 * 1000;
}

static void take_with_dark(struct rig *r, struct exposure x, double theta_i_deg, double theta_v_deg) {
    x.exposure_us = exposure_for(r, theta_i_deg, theta_v_deg, x.kind == EXPOSURE_REFERENCE);
    struct exposure dark = {.kind = EXPOSURE_DARK, .exposure_us = x.exposure_us};
    take(r, &dark, theta_i_deg, theta_v_deg);
    take(r, &x, theta_i_deg, theta_v_deg);
}

static void take_control(struct rig *r, double theta_i_deg, double theta_v_deg, int closes, int opens) {
    struct exposure x = {.kind = EXPOSURE_REFERENCE, .control = true, .bracket = closes, .opens = opens};
    take_with_dark(r, x, theta_i_deg, theta_v_deg);
}

static void measure(struct rig *r, double theta_i_deg, const double *theta_v_deg, int bracket) {
    bool own = r->setup.mode == REFERENCE_EVERY_GEOMETRY, per = r->setup.mode == REFERENCE_PER_INCIDENCE;
    double control_i = per ? theta_i_deg : 45;
    take_control(r, control_i, 0, 0, bracket);
    int64_t open_us = r->now_us;
    for (int g = 0; g < BRACKET_GEOMETRIES; g++) {
        struct exposure reference = {.kind = EXPOSURE_REFERENCE, .bracket = bracket};
        struct exposure sample = {.kind = EXPOSURE_SAMPLE, .bracket = bracket};
        if (own)
            take_with_dark(r, reference, theta_i_deg, theta_v_deg[g]);
        take_with_dark(r, sample, theta_i_deg, theta_v_deg[g]);
        r->now_us = open_us + (int64_t)(600e6 * (g + 1) / (BRACKET_GEOMETRIES + 1));
    }
    take_control(r, control_i, 0, bracket, 0);
}

static void run(struct rig *r) {
    static const double views[3][BRACKET_GEOMETRIES] = {{-70, -55, -40, -25, -10, 0, 8, 16, 24, 36, 50, 70},
                                                        {-75, -60, -45, -20, -5, 5, 25, 35, 43, 52, 60, 75},
                                                        {-80, -65, -50, -30, 0, 20, 40, 50, 58, 66, 72, 78}};
    static const double incidence[3] = {20, 40, 60};
    for (int i = 0; i < 3; i++)
        measure(r, incidence[i], views[i], i + 1);
}

static void check_mode(enum job_reference_mode mode, bool beam_in_view) {
    static struct rig r;
    double sum = 0, square = 0, worst = 0;
    int n = 0;
    for (uint64_t seed = 1; seed <= SEEDS; seed++) {
        rig_new(&r, seed, beam_in_view, mode);
        run(&r);
        sum += r.sum;
        square += r.square;
        worst = fmax(worst, r.worst);
        n += r.n;
        rig_free(&r);
    }
    print_message("# seeds 1..%d: %d points, mean pull %.2f, mean square %.2f, worst %.1f\n", SEEDS, n,
                  sum / n, square / n, worst);
    assert_int_equal(n, SEEDS * 3 * BRACKET_GEOMETRIES);
    /* common parts make points of a bracket move together: 12 brackets count, not 144 points */
    assert_true(square / n > 0.2 && square / n < 2.5);
    assert_true(fabs(sum / n) < 1.2 && worst < 4.5);
}

static void test_fixed(void **state) {
    (void)state;
    check_mode(REFERENCE_FIXED, false);
    check_mode(REFERENCE_FIXED, true);
}

static void test_per_incidence(void **state) {
    (void)state;
    check_mode(REFERENCE_PER_INCIDENCE, false);
    check_mode(REFERENCE_PER_INCIDENCE, true);
}

static void test_every_geometry(void **state) {
    (void)state;
    check_mode(REFERENCE_EVERY_GEOMETRY, false);
    check_mode(REFERENCE_EVERY_GEOMETRY, true);
}

static void test_start_end(void **state) {
    (void)state;
    check_mode(REFERENCE_START_END, false);
    check_mode(REFERENCE_START_END, true);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_fixed),
        cmocka_unit_test(test_per_incidence),
        cmocka_unit_test(test_every_geometry),
        cmocka_unit_test(test_start_end),
    };
    return cmocka_run_group_tests_name("sim_reduce", tests, NULL, NULL);
}
