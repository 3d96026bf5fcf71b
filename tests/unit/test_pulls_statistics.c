/* The judgement of pulls must be able to say no: to a bias, to uncertainties that are too small or too large. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sim/draw.h"
#include "tests/support/pulls_log.h"

#define SEEDS 500

static struct pulls p;

static void draw(double bias, double spread) {
    p = (struct pulls){.n_samples = 2, .n_seeds = SEEDS, .sample = {"one", "two"}};
    for (int s = 0; s < SEEDS; s++)
        for (int i = 0; i < 2; i++)
            for (int k = 0; k < DATASET_PARAMETERS; k++) {
                double x = bias + spread * draw_normal(draw_fold((uint64_t)s, (uint64_t)(i * 10 + k)));
                p.pull[s][i].of[k] = x;
                p.pull[s][i].distance2 += x * x;
            }
}

static void honest_pulls_pass(void **state) {
    (void)state;
    draw(0, 1);
    assert_int_equal(pulls_judge(&p), 0);
}

static void a_bias_is_found(void **state) {
    (void)state;
    draw(0.5, 1);
    assert_true(pulls_judge(&p) >= DATASET_PARAMETERS);
}

static void a_wrong_uncertainty_is_found(void **state) {
    (void)state;
    draw(0, 1.5);
    assert_true(pulls_judge(&p) >= 2);
    draw(0, 0.6);
    assert_true(pulls_judge(&p) >= 2);
}

/* One parameter alone, its mean and the distances as they should be: too few inside, then too many. */
static void coverage_is_judged(void **state) {
    (void)state;
    draw(0, 1);
    for (int s = 0; s < SEEDS; s++)
        p.pull[s][0].of[2] = (s % 8 ? 0.5 : 2.2) * (s % 2 || s % 16 ? 1 : -1);
    assert_in_range(pulls_judge(&p), 1, 2); /* of the sample, and of all samples together */
    for (int s = 0; s < SEEDS; s++)
        p.pull[s][0].of[2] = s % 2 ? 1 : -1;
    assert_in_range(pulls_judge(&p), 1, 2); /* of the sample, and of all samples together */
}

/* A run that is cut keeps what it has, and knows what is missing. */
static void the_log_is_taken_up_again(void **state) {
    (void)state;
    static struct pulls back;
    const char *const names[2] = {"one", "two"};
    char path[] = "/tmp/goniod-pulls-XXXXXX";
    close(mkstemp(path));
    unlink(path);
    draw(0, 1);
    pulls_log_open(path, "every_geometry view-in-beam");
    pulls_log_add(path, 8, PULLS_WITH, names, p.pull[8], 2);
    pulls_log_add(path, 9, PULLS_WITHOUT, names, p.pull[9], 2);
    pulls_log_open(path, "every_geometry view-in-beam");
    pulls_log_add(path, 7, PULLS_WITH, names, p.pull[7], 2);
    assert_true(pulls_log_has(path, 8, PULLS_WITH));
    assert_false(pulls_log_has(path, 9, PULLS_WITH));
    assert_false(pulls_log_has(path, 10, PULLS_WITHOUT));
    back = (struct pulls){.parts = PULLS_WITH};
    pulls_log_read(path, 7, 10, &back);
    unlink(path);
    assert_int_equal(back.n_seeds, 2);
    assert_int_equal(back.n_samples, 2);
    assert_string_equal(back.sample[1], "two");
    assert_float_equal(back.pull[0][1].of[3], p.pull[8][1].of[3], 1e-5);
    assert_float_equal(back.pull[1][0].distance2, p.pull[7][0].distance2, 1e-4);
}

/* Tables: chi-square of 5 degrees has its median at 4.3515 and its 95 % point at 11.0705; Kolmogorov's 5 % point at
 * n = 20 is 0.2941. */
static void tables_agree(void **state) {
    (void)state;
    assert_float_equal(pulls_chi2_5(4.3515), 0.5, 1e-4);
    assert_float_equal(pulls_chi2_5(11.0705), 0.95, 1e-4);
    double value[20];
    for (int i = 0; i < 20; i++)
        value[i] = (i + 1) / 20.0 - 0.2941 < 0 ? 0 : (i + 1) / 20.0 - 0.2941;
    assert_float_equal(pulls_kolmogorov(value, 20), 0.05, 0.002);
}

/* Two parameters that move together: what looks like two pulls of 2 is one. */
static void the_distance_knows_correlation(void **state) {
    (void)state;
    static struct dataset d;
    struct pull pull;
    memset(&d, 0, sizeof d);
    d.has_estimate = d.has_truth = true;
    for (int k = 0; k < DATASET_PARAMETERS; k++)
        d.estimate.statistical[k][k] = 3;
    for (int k = 0; k < 2; k++) {
        d.estimate.value[k] = 4;
        d.estimate.common[k][k] = 1;
        d.estimate.common[k][1 - k] = 1;
    }
    pulls_of(&d, &pull);
    assert_float_equal(pull.of[0], 2, 1e-12);
    assert_float_equal(pull.of[2], 0, 1e-12);
    assert_float_equal(pull.distance2, 6.4, 1e-12); /* 32 / (4 + 1) */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(honest_pulls_pass),
        cmocka_unit_test(a_bias_is_found),
        cmocka_unit_test(a_wrong_uncertainty_is_found),
        cmocka_unit_test(coverage_is_judged),
        cmocka_unit_test(the_log_is_taken_up_again),
        cmocka_unit_test(tables_agree),
        cmocka_unit_test(the_distance_knows_correlation),
    };
    return cmocka_run_group_tests_name("pulls_statistics", tests, NULL, NULL);
}
