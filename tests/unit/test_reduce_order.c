#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/support/flat_bench.h"

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
        cmocka_unit_test(the_bridge_by_hand),
        cmocka_unit_test(rates_are_learned_from_successive_references),
        cmocka_unit_test(every_geometry_uses_its_own_reading),
        cmocka_unit_test(an_ended_bracket_is_measured_again),
        cmocka_unit_test(saturated_and_repeated_sets),
        cmocka_unit_test(a_reading_waits_for_its_dark),
        cmocka_unit_test(bad_setups_are_refused),
        cmocka_unit_test(the_setup_survives_json),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
