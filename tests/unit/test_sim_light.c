#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/certificate.h"
#include "proto/file.h"
#include "proto/units.h"
#include "sim/diffuser.h"
#include "sim/draw.h"
#include "sim/sim_bench.h"

#define PI 3.14159265358979323846

static void test_view_inside_the_beam(void **state) {
    (void)state;
    struct optics o = {20, 3};
    /* beam ellipse 40 x 20 mm, view ellipse 3.916 x 3 mm: the view is inside */
    assert_true(fabs(optics_overlap_mm2(&o, 60, 40) - PI * 1.5 * 1.5 / cos(rad_from_deg(40))) < 1e-9);
    /* radiance falls with cos theta_i; the longer view spot makes up for its slant */
    assert_true(fabs(optics_throughput(&o, 60, 40) - 0.5) < 1e-12);
    assert_true(fabs(optics_throughput(&o, 60, -70) - 0.5) < 1e-12);
    assert_true(fabs(optics_throughput(&o, 0, 75) - 1) < 1e-12);
    assert_true(optics_throughput(&o, 90, 0) == 0);
}

static void test_beam_inside_the_view(void **state) {
    (void)state;
    struct optics o = {3, 20};
    /* the whole flux falls into the view whatever theta_i; its radiance times the projected area goes as cos
     * theta_v */
    assert_true(fabs(optics_overlap_mm2(&o, 60, 40) - PI * 1.5 * 1.5 / 0.5) < 1e-9);
    assert_true(fabs(optics_throughput(&o, 60, 40) - cos(rad_from_deg(40))) < 1e-12);
    assert_true(fabs(optics_throughput(&o, 20, 60) - 0.5) < 1e-12);
}

static double counted_overlap(double a1, double b1, double a2, double b2) {
    int inside = 0, n = 2000;
    double a = fmin(a1, a2), b = fmin(b1, b2);
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) {
            double x = a * (i + 0.5) / n, y = b * (j + 0.5) / n;
            inside += x * x / (a1 * a1) + y * y / (b1 * b1) < 1 && x * x / (a2 * a2) + y * y / (b2 * b2) < 1;
        }
    return 4 * a * b * inside / ((double)n * n);
}

static void test_spots_that_cross(void **state) {
    (void)state;
    struct optics o = {20, 18}; /* at 20:60 the view is 36 mm long and 18 wide, the beam 21.3 x 20 */
    double beam = 10 / cos(rad_from_deg(20));
    assert_true(fabs(optics_overlap_mm2(&o, 20, 60) / counted_overlap(beam, 10, 18, 9) - 1) < 1e-4);
    struct optics swapped = {18, 20};
    assert_true(fabs(optics_overlap_mm2(&swapped, 60, 20) / optics_overlap_mm2(&o, 20, 60) - 1) < 1e-12);
}

static void test_the_diffuser_is_not_lambertian_but_reciprocal(void **state) {
    (void)state;
    double low = 9, high = 0, beta[BANDS], swapped[BANDS];
    for (int i = 0; i <= 75; i += 5)
        for (int v = -80; v <= 80; v += 5) {
            diffuser_certified(i, v, beta);
            low = fmin(low, beta[40]);
            high = fmax(high, beta[40]);
        }
    assert_true(low > 0.84 && low < 0.88 && high > 1.47 && high < 1.51);
    for (int i = 0; i <= 75; i += 15) /* at the nodes; in between, interpolation keeps it to its own step */
        for (int v = 0; v <= 75; v += 15) {
            diffuser_certified(i, -v, beta);
            diffuser_certified(v, -i, swapped);
            assert_true(fabs(beta[20] - swapped[20]) < 2e-5);
        }
    diffuser_certified(45, 0, beta);
    assert_true(fabs(beta[44] - 0.99) < 0.01);
}

static void test_the_certificate_is_the_table(void **state) {
    (void)state;
    char line[128];
    int rows = 0;
    FILE *in = fopen("docs/examples/demo/ptfe.csv", "r"); /* as written: tests/unit/test_configuration.c */
    assert_non_null(in);
    while (fgets(line, sizeof line, in)) {
        double nm, value, u, i, v, beta[BANDS];
        if (sscanf(line, "%lf,%lf,%lf,%lf,%lf", &nm, &value, &u, &i, &v) != 5)
            continue;
        rows++;
        diffuser_certified(i, v, beta);
        assert_true(fabs(beta[((int)nm - BAND_FIRST_NM) / BAND_STEP_NM] - value) < 1e-8);
        assert_true(fabs(u / value - 0.005) < 1e-6);
    }
    assert_int_equal(rows, 6 * 33 * 5);
    fclose(in);
}

/* Whoever reads the certificate and interpolates as measurement.md 2 says sees the diffuser at every angle. */
static void test_the_certificate_reads_as_the_truth(void **state) {
    (void)state;
    char *text;
    size_t size;
    struct certificate c;
    struct err_list errors = {0};
    struct err e = {0};
    assert_int_equal(file_read("docs/examples/demo/ptfe.csv", 1 << 20, &text, &size, &e), 0);
    assert_int_equal(certificate_read_text("ptfe.csv", text, size, &c, &errors), 0);
    for (int i = 0; i <= 75; i += 5)
        for (double v = -80; v <= 80; v += 2.5) {
            double beta[BANDS], u[BANDS], truth[BANDS], angular;
            bool covered[BANDS];
            assert_int_equal(certificate_at(&c, i, v, 0, beta, u, covered, &angular, &e), 0);
            diffuser_certified(i, v, truth);
            for (int k = 0; k < BANDS; k++) {
                assert_true(covered[k] && fabs(beta[k] - truth[k]) < 1e-7);
                assert_true(fabs(u[k] / beta[k] - 0.005) < 1e-6);
            }
        }
    certificate_free(&c);
    free(text);
}

static void test_a_band_is_the_mean_under_its_triangle(void **state) {
    (void)state;
    double value[BANDS], spline[BANDS];
    for (int k = 0; k < BANDS; k++)
        value[k] = 0.04 + 0.4 / (1 + exp((602 - band_nm(k)) / 9.0));
    surface_spline(value, spline);
    for (int k = 0; k < BANDS; k++) {
        double sum = 0, weight = 0;
        for (int i = -499; i < 500; i++) {
            double x = i / 500.0, w = 1 - fabs(x);
            sum += w * surface_between(spline, k + x);
            weight += w;
        }
        assert_true(fabs(sum / weight - value[k]) < 2e-5);
    }
}

/* A quiet bench with axes turned by hand. */
struct rig {
    struct clock clock;
    struct sim_config config;
    struct sim_bench *bench;
    uint16_t counts[DETECTOR_PIXELS_MAX], dark[DETECTOR_PIXELS_MAX];
};

static void rig_new(struct rig *r) {
    clock_init_virtual(&r->clock);
    r->config.quiet = true;
    r->config.n_axes = 0;
    assert_int_equal(sim_bench_new(&r->bench, &r->config, &r->clock, NULL), 0);
}

static void turn(struct rig *r, double theta_i_deg, double theta_v_deg) {
    assert_int_equal(sim_bench_turn(r->bench, "source", theta_i_deg + theta_v_deg, NULL), 0);
    assert_int_equal(sim_bench_turn(r->bench, "sample", theta_v_deg, NULL), 0);
}

static void expose(struct rig *r, int64_t from_us, uint32_t exposure_us, uint16_t *counts) {
    truth_frame(&r->bench->truth, from_us, from_us + exposure_us, exposure_us, counts);
}

/* Scaled, dark-free, linear: what the sheets tell a reader to do (spectrometer-ocean.md 5). */
static double linear(const struct rig *r, int pixel) {
    const struct detector_model *m = r->bench->truth.detector.model;
    double s = (r->counts[pixel] - r->dark[pixel]) * 65535.0 / m->saturation, p = 0;
    for (int k = 7; k >= 0; k--)
        p = p * s + m->nonlinearity[k];
    return s / p;
}

static double at_550(struct rig *r, double theta_i_deg, double theta_v_deg) {
    turn(r, theta_i_deg, theta_v_deg);
    expose(r, 1000000, 60000, r->counts);
    double sum = 0;
    for (int p = 560; p < 570; p++)
        sum += linear(r, p);
    return sum;
}

static void test_counts_follow_geometry_and_surface(void **state) {
    (void)state;
    struct sim_surface s;
    assert_int_equal(sim_paint_find("Hooker's Green", "drawing paper", 60, &s, NULL), 0);
    for (int k = 0; k < BANDS; k++) /* grey, so that ten pixels say what their band says */
        s.s_lambda[k] = 0.3;
    for (int filling = 0; filling < 2; filling++) {
        static struct rig r;
        sim_config_default(&r.config);
        r.config.stray_light = 0;
        r.config.filling = filling ? SIM_BEAM_IN_VIEW : SIM_VIEW_IN_BEAM;
        r.config.beam_mm = filling ? 3 : 20;
        r.config.view_mm = filling ? 20 : 3;
        rig_new(&r);
        sim_bench_mount(r.bench, "sample", &s, NULL);
        turn(&r, 0, 0);
        expose(&r, 0, 60000, r.dark);
        lamp_switch(&r.bench->truth.lamp, 500000, true);
        int band = (int)lround(r.bench->truth.band_at[565]);
        double base = at_550(&r, 10, 0) / sim_surface_beta(&s, 10, 0, band);
        double expected_30 = filling ? cos(rad_from_deg(35)) : cos(rad_from_deg(30)) / cos(rad_from_deg(10));
        double got = at_550(&r, 30, 35) / sim_surface_beta(&s, 30, 35, band) / base;
        assert_true(fabs(got / expected_30 - 1) < 5e-4); /* rounding of ten pixels of about 9000 counts */
        assert_int_equal(sim_bench_hold(r.bench, "reference", NULL), 0);
        double beta[BANDS];
        diffuser_certified(30, -20, beta);
        double expected =
            (filling ? cos(rad_from_deg(20)) : cos(rad_from_deg(30)) / cos(rad_from_deg(10))) * beta[band];
        got = at_550(&r, 30, -20) / base;
        assert_true(fabs(got / expected - 1) < 5e-4);
        assert_true(fabs(at_550(&r, -30, 20) / base / got - 1) < 1e-9); /* mirrored: the same geometry */
        sim_bench_free(r.bench);
    }
}

static void test_reciprocity_through_the_bench(void **state) {
    (void)state;
    static struct rig r;
    struct sim_surface s;
    sim_config_default(&r.config);
    r.config.stray_light = 0;
    rig_new(&r);
    assert_int_equal(sim_paint_find("Cobalt Blue Hue", "acrylic board", 0, &s, NULL), 0);
    sim_bench_mount(r.bench, "sample", &s, NULL);
    expose(&r, 0, 60000, r.dark);
    lamp_switch(&r.bench->truth.lamp, 500000, true);
    double forth = at_550(&r, 40, -20) / cos(rad_from_deg(40)),
           back = at_550(&r, 20, -40) / cos(rad_from_deg(20));
    assert_true(fabs(forth / back - 1) < 1e-3);
    sim_bench_free(r.bench);
}

static void test_stray_light_and_halo(void **state) {
    (void)state;
    static struct rig r;
    sim_config_default(&r.config);
    r.config.stray_light = 0.01;
    r.config.halo = 0.02;
    rig_new(&r);
    const struct truth *t = &r.bench->truth;
    sim_bench_hold(r.bench, "trap", NULL);
    turn(&r, 30, 0);
    expose(&r, 0, 100000, r.dark);
    lamp_switch(&r.bench->truth.lamp, 500000, true);
    expose(&r, 1000000, 100000, r.counts);
    double mean = 0;
    for (int p = 20; p < 2048; p++)
        mean += t->white[p] * 0.02 * 100000 / 2028;
    for (int p = 300; p < 320; p++) /* the trap reflects nothing: all of it came past the surface */
        assert_true(fabs(linear(&r, p) - t->white[p] * 0.02 * 100000 - 0.01 * mean) < 2.5);
    assert_true(r.counts[10] == r.dark[10]); /* no light falls on the electric dark pixels */
    sim_bench_free(r.bench);
}

static void test_the_lamp_warms_from_its_first_light(void **state) {
    (void)state;
    struct lamp l;
    lamp_init(&l, 1, 0, 30);
    lamp_switch(&l, 100000000, true);
    assert_true(fabs(lamp_level(&l, 100000000) - 0.97) < 1e-12);
    lamp_switch(&l, 160000000, false); /* a dark does not cool it */
    lamp_switch(&l, 400000000, true);
    assert_true(fabs(lamp_level(&l, 400000000) - (1 - 0.03 * exp(-1))) < 1e-12);
    assert_true(1 - lamp_level(&l, 1900000000) < 1e-4);
    assert_true(lamp_is_on(&l, 120000000) && !lamp_is_on(&l, 200000000) && !lamp_is_on(&l, 99999999));
    assert_true(lamp_steady(&l, 161000000, 399000000) && !lamp_steady(&l, 150000000, 170000000));
}

static void test_drift_is_one_path_for_all_who_look(void **state) {
    (void)state;
    uint64_t seed = 20261122;
    print_message("# seed %llu\n", (unsigned long long)seed);
    double square = 0, late = draw_brownian(draw_fold(seed, 0), 7200.25);
    int n = 2000;
    for (int i = 0; i < n; i++) {
        double step = draw_brownian(draw_fold(seed, (uint64_t)i), 1060) -
                      draw_brownian(draw_fold(seed, (uint64_t)i), 1000);
        square += step * step / 60 / n;
    }
    assert_true(fabs(square - 1) < 5 * sqrt(2.0 / n));
    assert_true(draw_brownian(draw_fold(seed, 0), 7200.25) == late);
    double first = 0, second = 0, cross = 0; /* increments over neighbouring times are independent */
    for (int i = 0; i < n; i++) {
        double a = draw_brownian(seed, 10.0 * i + 10) - draw_brownian(seed, 10.0 * i);
        double b = draw_brownian(seed, 10.0 * i + 20) - draw_brownian(seed, 10.0 * i + 10);
        first += a * a;
        second += b * b;
        cross += a * b;
    }
    assert_true(fabs(cross) / sqrt(first * second) < 5 / sqrt(n));
    assert_true(fabs(first / n / 10 - 1) < 5 * sqrt(2.0 / n));
}

static void test_paints_are_coloured_and_published(void **state) {
    (void)state;
    static const char *const paint[] = {"Cadmium Red", "Hooker's Green", "Cobalt Blue Hue"};
    static const char *const support[] = {"acrylic board", "drawing paper"};
    struct sim_surface s;
    struct err e = {0};
    for (int p = 0; p < 3; p++)
        for (int i = 0; i < 2; i++) {
            assert_int_equal(sim_paint_find(paint[p], support[i], 0, &s, NULL), 0);
            double low = 1, high = 0;
            for (int k = 0; k < BANDS; k++) {
                low = fmin(low, s.s_lambda[k]);
                high = fmax(high, s.s_lambda[k]);
            }
            assert_true(low < 0.04 + 1e-3 && high > 0.45 - 1e-3 && high < 1);
        }
    assert_int_equal(sim_paint_find("hooker's green", "acrylic board", 0, &s, NULL), 0);
    assert_true(s.sigma == 0.35 && s.gamma == 0.05 && s.beta_prime == 126 && s.n == 1.40);
    assert_int_equal(sim_paint_find("Hooker's Green", "paper", 90, &s, NULL), 0);
    assert_true(s.sigma == 0.5 && s.gamma == 0.08 && s.beta_prime == 1.6 && s.n == 2.42);
    assert_int_equal(sim_paint_find("Hooker's Green", "paper", 20, &s, NULL), 0);
    assert_true(s.sigma > 0.2 && s.sigma < 0.3 && s.beta_prime > 7.6 && s.beta_prime < 15.7);
    assert_int_equal(sim_paint_find("Hooker Green", "paper", 0, &s, &e), -ERR_INPUT);
    assert_non_null(strstr(e.text, "Hooker's Green"));
    assert_int_equal(sim_paint_find("Cadmium Red", "steel", 0, &s, NULL), -ERR_INPUT);
    assert_int_equal(sim_paint_find("Cadmium Red", "paper", 91, &s, NULL), -ERR_INPUT);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_view_inside_the_beam),
        cmocka_unit_test(test_beam_inside_the_view),
        cmocka_unit_test(test_spots_that_cross),
        cmocka_unit_test(test_the_diffuser_is_not_lambertian_but_reciprocal),
        cmocka_unit_test(test_the_certificate_is_the_table),
        cmocka_unit_test(test_the_certificate_reads_as_the_truth),
        cmocka_unit_test(test_a_band_is_the_mean_under_its_triangle),
        cmocka_unit_test(test_counts_follow_geometry_and_surface),
        cmocka_unit_test(test_reciprocity_through_the_bench),
        cmocka_unit_test(test_stray_light_and_halo),
        cmocka_unit_test(test_the_lamp_warms_from_its_first_light),
        cmocka_unit_test(test_drift_is_one_path_for_all_who_look),
        cmocka_unit_test(test_paints_are_coloured_and_published),
    };
    return cmocka_run_group_tests_name("sim_light", tests, NULL, NULL);
}
