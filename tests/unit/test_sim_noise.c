#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "sim/sim_bench.h"

#define FRAMES 300
#define EXPOSURE_US 60000

struct rig {
    struct clock clock;
    struct sim_config config;
    struct sim_bench *bench;
};

static void rig_new(struct rig *r, uint64_t seed) {
    clock_init_virtual(&r->clock);
    sim_config_default(&r->config);
    r->config.seed = seed;
    r->config.lamp_drift_rate = 0;
    assert_int_equal(sim_bench_new(&r->bench, &r->config, &r->clock, NULL), 0);
    struct sim_surface white = {.sigma = 0.2, .gamma = 0.1, .n = 1.5};
    for (int k = 0; k < BANDS; k++)
        white.s_lambda[k] = 0.9;
    sim_bench_mount(r->bench, "sample", &white, NULL);
    lamp_switch(&r->bench->truth.lamp, 0, true);
}

static void go(struct rig *r, int role, int32_t steps, int64_t at_us) {
    plant_move(&r->bench->unit[role].plant, at_us, &(struct plant_order){steps, 9000, 90000, 90000});
}

static void look(struct rig *r, int64_t at_us, uint16_t *counts) {
    truth_frame(&r->bench->truth, at_us, at_us + EXPOSURE_US, EXPOSURE_US, counts);
}

/* Vendor's figures: var = RN^2 + S / g in scaled counts, S linear (spectrometer-ocean.md 7). */
static void test_the_noise_is_that_of_the_sheet(void **state) {
    (void)state;
    static uint16_t counts[FRAMES][2048];
    uint64_t seed = 77;
    struct rig r;
    print_message("# seed %llu\n", (unsigned long long)seed);
    rig_new(&r, seed);
    for (int f = 0; f < FRAMES; f++) /* hours later: lamp and offset are warm */
        look(&r, 20000000000 + f * EXPOSURE_US, counts[f]);
    const struct detector *d = &r.bench->truth.detector;
    double ratio = 0, kurtosis = 0, neighbours = 0;
    int n = 0;
    for (int p = 100; p < 1600; p++) {
        double mean = 0, square = 0, fourth = 0, scale = 65535.0 / d->model->saturation;
        for (int f = 0; f < FRAMES; f++)
            mean += counts[f][p] * scale / FRAMES;
        double signal = mean - d->model->offset_counts - d->pattern[p], factor = 0, slope = 0;
        for (int k = 7; k >= 0; k--) {
            slope = slope * signal + factor;
            factor = factor * signal + d->model->nonlinearity[k];
        }
        double bend = 1 / ((factor - signal * slope) / (factor * factor)); /* dS'/dL */
        double expected = 2500 + bend * bend * (signal / factor) / 0.99;
        for (int f = 0; f < FRAMES; f++) {
            double x = counts[f][p] * scale - mean;
            square += x * x / (FRAMES - 1);
            fourth += x * x * x * x / FRAMES;
            neighbours += f > 0 ? x * (counts[f - 1][p] * scale - mean) / expected : 0;
        }
        ratio += square / expected;
        kurtosis += fourth / (square * square);
        n++;
    }
    print_message("# variance / expected %.4f, kurtosis %.3f\n", ratio / n, kurtosis / n);
    assert_true(fabs(ratio / n - 1) < 4 * sqrt(2.0 / FRAMES / n) + 1e-3); /* 1e-3: rounding to counts */
    assert_true(fabs(kurtosis / n - 3 * (FRAMES - 1.0) / (FRAMES + 1.0)) < 0.03);
    assert_true(fabs(neighbours / n / FRAMES + 1.0 / FRAMES) < 4 / sqrt((double)n * FRAMES));
    sim_bench_free(r.bench);
}

static void test_same_seed_same_bytes(void **state) {
    (void)state;
    uint16_t a[2048], b[2048];
    for (uint64_t other = 0; other < 2; other++) {
        struct rig r, s;
        rig_new(&r, 5);
        rig_new(&s, 5 + other);
        look(&r, 1000000, a);
        look(&s, 1000000, b);
        assert_int_equal(memcmp(a, b, sizeof a) == 0, other == 0);
        sim_bench_free(r.bench);
        sim_bench_free(s.bench);
    }
}

/* What was looked at before, and in which order, does not change a frame: only how often this state was
 * entered. */
static void test_independence_of_call_order(void **state) {
    (void)state;
    uint16_t straight[3][2048], detour[3][2048];
    struct rig r, s;
    rig_new(&r, 9);
    rig_new(&s, 9);
    go(&s, 0, -6000, 1000000);
    for (int i = 0; i < 4; i++)
        look(&s, 5000000 + i * EXPOSURE_US, detour[0]);
    go(&r, 0, 3000, 10000000);
    go(&s, 0, 3000, 10000000);
    for (int i = 0; i < 3; i++) {
        look(&r, 30000000 + i * EXPOSURE_US, straight[i]);
        look(&s, 30000000 + i * EXPOSURE_US, detour[i]);
    }
    assert_memory_equal(straight, detour, sizeof straight);
    assert_memory_not_equal(straight[0], straight[1], sizeof straight[0]);
    sim_bench_free(r.bench);
    sim_bench_free(s.bench);
}

static void test_a_second_visit_is_new_and_can_be_resumed(void **state) {
    (void)state;
    uint16_t first[2048], second[2048], resumed[2048];
    struct rig r, s;
    rig_new(&r, 3);
    rig_new(&s, 3);
    look(&r, 30000000, first);
    go(&r, 0, 3000, 40000000);
    look(&r, 50000000, second);
    go(&r, 0, 0, 60000000);
    look(&r, 90000000, second);
    for (int i = 0; i < 2; i++) /* it sets, however often it is said */
        sim_bench_set_visits(s.bench, "sample", 0, 0, EXPOSURE_US, true, 1);
    look(&s, 90000000, resumed);
    int differing = 0;
    for (int p = 0; p < 18; p++) { /* electric dark: noise alone, no geometry */
        assert_int_equal(second[p], resumed[p]);
        differing += first[p] != second[p];
    }
    assert_true(differing > 10);
    sim_bench_free(r.bench);
    sim_bench_free(s.bench);
}

static void test_a_frame_in_motion_is_a_blend(void **state) {
    (void)state;
    static uint16_t before[2048], during[2048], after[2048];
    struct rig r;
    rig_new(&r, 1);
    sim_bench_free(r.bench);
    r.config.quiet = true;
    assert_int_equal(sim_bench_new(&r.bench, &r.config, &r.clock, NULL), 0);
    sim_bench_mount(
        r.bench, "sample",
        &(struct sim_surface){.sigma = 0.2, .gamma = 0.1, .n = 1.5, .s_lambda = {[0 ... 80] = 0.9}}, NULL);
    lamp_switch(&r.bench->truth.lamp, 0, true);
    go(&r, 0, 6000, 1000000); /* 60 deg at 90 deg/s, 0.1 s ramps: 0.7667 s */
    truth_frame(&r.bench->truth, 900000, 960000, 60000, before);
    truth_frame(&r.bench->truth, 1350000, 1410000, 60000, during); /* it passes 30 deg at 1.383 s */
    truth_frame(&r.bench->truth, 1900000, 1960000, 60000, after);
    assert_true(before[565] > during[565] && during[565] > after[565]);
    double share = (during[565] - after[565]) / (double)(before[565] - after[565]);
    assert_true(fabs(share - (cos(0.5236) - 0.5) / 0.5) < 0.05);
    sim_bench_free(r.bench);
}

static void test_a_frame_is_quick(void **state) {
    (void)state;
    uint16_t counts[2048];
    struct rig r;
    struct timespec a, b;
    rig_new(&r, 1);
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &a);
    for (int i = 0; i < 500; i++)
        look(&r, 1000000 + i * EXPOSURE_US, counts);
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &b);
    double us = ((b.tv_sec - a.tv_sec) * 1e9 + (b.tv_nsec - a.tv_nsec)) / 1e3 / 500;
    print_message("# %.1f us a frame of 2048 pixels\n", us);
    assert_true(us < 3000); /* a sanitized build included; the aim is 100 */
    sim_bench_free(r.bench);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_noise_is_that_of_the_sheet),
        cmocka_unit_test(test_same_seed_same_bytes),
        cmocka_unit_test(test_independence_of_call_order),
        cmocka_unit_test(test_a_second_visit_is_new_and_can_be_resumed),
        cmocka_unit_test(test_a_frame_in_motion_is_a_blend),
        cmocka_unit_test(test_a_frame_is_quick),
    };
    return cmocka_run_group_tests_name("sim_noise", tests, NULL, NULL);
}
