#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "proto/session_linearity.h"
#include "tests/support/flat_bench.h"

/* Flat spectra of known levels, so that ratio, noise and what the reduction takes from them are a few lines by hand. */

static struct linearity last;
static int n_seen;

static int see(void *arg, struct linearity *l, struct err *e) {
    (void)arg;
    (void)e;
    last = *l;
    n_seen++;
    return 0;
}

static void open_bench(struct fixture *f, double prior_rel) {
    n_seen = 0;
    start(f, FLAT);
    f->setup.without_dark = true;
    f->setup.linearity_rel = prior_rel;
    f->setup.drift_rate_prior = 1e-10;
    f->setup.calibration.electrons_per_count = 1e12;
    f->sink.linearity = see;
    begin(f);
}

static int overlap(struct fixture *f, double level, int exposure_us, int step) {
    struct exposure x;
    flat_exposure(f, &x, EXPOSURE_OVERLAP, level);
    x.exposure_us = exposure_us;
    x.step = step;
    return give(f, &x);
}

static double linearity_part(struct fixture *f) {
    give_flat(f, EXPOSURE_REFERENCE, 40000, 0, 1);
    give_sample(f, 10000, 45, 0, 1);
    return common(last_point(f), "linearity")->sensitivity[BAND_550];
}

/* beta = 0.225; both levels over full scale, sample against reference */
#define PART(rel) (0.225 * (rel) * (10000 - 40000) / 65535)

static void a_straight_path_leaves_the_prior(void **state) {
    (void)state;
    struct fixture f;
    open_bench(&f, 5e-4);
    assert_int_equal(overlap(&f, 40000, 100000, 1), 0);
    assert_int_equal(n_seen, 0);
    assert_int_equal(overlap(&f, 5000, 12500, 1), 0);
    assert_int_equal(n_seen, 1);
    near(last.ratio, 1, 1e-14);
    near(last.level_long, 40000 / 65535.0, 1e-14);
    near(last.level_short, 5000 / 65535.0, 1e-14);
    near(last.u_ratio, sqrt(1e-10 * 10), 1e-6); /* 10 s apart; the light has no noise here */
    assert_int_equal(last.long_id, 1);
    assert_int_equal(last.short_id, 2);
    assert_false(last.beyond);
    near(last.used_rel, 5e-4, 1e-15);
    near(linearity_part(&f), PART(5e-4), 1e-12);
    finish(&f);
}

static void a_bent_path_is_flagged_and_enters_u(void **state) {
    (void)state;
    struct fixture f;
    open_bench(&f, 5e-4);
    assert_int_equal(overlap(&f, 40000, 100000, 1), 0);
    assert_int_equal(overlap(&f, 4950, 12500, 1), 0); /* 1 % less than its share */
    near(last.ratio, 40000 / 100000.0 / (4950 / 12500.0), 1e-14);
    double apart = 35050 / 65535.0, error = (last.ratio - 1) / apart;
    near(last.error_rel, error, 1e-12);
    near(last.pull, error / sqrt(25e-8 + last.u_error_rel * last.u_error_rel), 1e-12);
    assert_true(last.beyond && last.pull > 20);
    near(last.used_rel, sqrt(error * error - last.u_error_rel * last.u_error_rel), 1e-12);
    near(linearity_part(&f), PART(last.used_rel), 1e-12);
    finish(&f);
}

static void counting_noise_and_darks_are_in_u(void **state) {
    (void)state;
    struct fixture f;
    open_bench(&f, 0);
    f.setup.without_dark = false;
    f.setup.calibration.electrons_per_count = 1;
    reducer_free(f.r);
    begin(&f);
    struct exposure x;
    for (int k = 0; k < 2; k++) {
        flat_exposure(&f, &x, EXPOSURE_DARK, 100);
        x.exposure_us = k ? 12500 : 100000;
        assert_int_equal(give(&f, &x), 0);
    }
    assert_int_equal(overlap(&f, 40100, 100000, 1), 0);
    assert_int_equal(overlap(&f, 5100, 12500, 1), 0);
    /* Triangles 5 nm apart and 10 nm wide add up to 1: all pixels of 380..780 nm, and half of 5 nm at either end, in
     * two scans. The weights of neighbours 0.25 nm apart change by 1/20 of a band, so each pixel counts as 1/20. */
    double pixels = (400 + 5) / 0.25, mean_of = 81;
    double variance_slow = (40100 + 100) / 2.0 * pixels / 400,
           variance_fast = (5100 + 100) / 2.0 * pixels / 400;
    double slow = variance_slow / pow(mean_of * 40000, 2), fast = variance_fast / pow(mean_of * 5000, 2);
    near(last.u_ratio, sqrt(slow + fast + 1e-9), 0.003);
    assert_true(last.prior_rel == 0 && last.used_rel >= 0);
    finish(&f);
}

static void a_step_taken_again_begins_with_its_long_reading(void **state) {
    (void)state;
    struct fixture f;
    open_bench(&f, 5e-4);
    assert_int_equal(overlap(&f, 40000, 100000, 1), 0);
    assert_int_equal(overlap(&f, 30000, 100000, 1), 0); /* the campaign was interrupted between the two */
    assert_int_equal(overlap(&f, 3750, 12500, 1), 0);
    assert_int_equal(n_seen, 1);
    assert_int_equal(last.long_id, 2);
    near(last.ratio, 1, 1e-14);
    assert_int_equal(overlap(&f, 3750, 12500, 1), 0); /* one alone says nothing */
    assert_int_equal(n_seen, 1);
    finish(&f);
}

static void a_saturated_long_reading_makes_no_pair(void **state) {
    (void)state;
    struct fixture f;
    struct exposure x;
    open_bench(&f, 5e-4);
    flat_exposure(&f, &x, EXPOSURE_OVERLAP, 60000);
    x.saturated_pixels = 3;
    x.step = 1;
    assert_int_equal(give(&f, &x), 0);
    assert_int_equal(overlap(&f, 5000, 12500, 1), 0);
    assert_int_equal(n_seen, 0);
    finish(&f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_straight_path_leaves_the_prior),
        cmocka_unit_test(a_bent_path_is_flagged_and_enters_u),
        cmocka_unit_test(counting_noise_and_darks_are_in_u),
        cmocka_unit_test(a_step_taken_again_begins_with_its_long_reading),
        cmocka_unit_test(a_saturated_long_reading_makes_no_pair),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
