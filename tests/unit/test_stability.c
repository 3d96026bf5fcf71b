#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/stability.h"
#include "tests/support/seed.h"

#define LIMIT_S 60

/* Every case of the table: none hangs, crashes or lies, and both solvers end at the same place. */
static void no_case_lies(void **state) {
    (void)state;
    struct stability_case *cases;
    size_t n, good = 0, refused = 0;
    struct err e = {0};
    const uint64_t seed = test_seed(1); /* or: goniofit stability --seed N */
    assert_int_equal(stability_cases(false, &cases, &n, &e), 0);
    assert_int_equal(n, 135); /* docs/fit.md */
    for (size_t i = 0; i < n; i++) {
        struct stability_result r;
        assert_int_equal(stability_run(&cases[i], seed, LIMIT_S, &r, &e), 0);
        good += r.verdict == STABILITY_GOOD;
        refused += r.verdict == STABILITY_REFUSED;
        if (r.verdict != STABILITY_GOOD && r.verdict != STABILITY_REFUSED) {
            fail_msg("%s, %s: %s: %s", cases[i].group, cases[i].name, stability_word(r.verdict), r.why);
        }
        if (r.verdict == STABILITY_REFUSED && r.why[0] == '\0') {
            fail_msg("%s, %s: refused without a reason", cases[i].group, cases[i].name);
        }
        if (r.apart_u > 1e-3) {
            fail_msg("%s, %s: the solvers end %g u apart", cases[i].group, cases[i].name, r.apart_u);
        }
    }
    print_message("# %zu cases: %zu good, %zu refused\n", n, good, refused);
    assert_true(good > n * 3 / 4); /* a refusal is honest, but no way out for what can be told */
    free(cases);
}

static struct stability_case plain(void) {
    return (struct stability_case){.group = "test",
                                   .name = "plain",
                                   .value = {0.2, 0.3, 0.07, 7.6, 1.7},
                                   .truth = {0.2, 0.3, 0.07, 7.6, 1.7},
                                   .theta_i_low_deg = 10,
                                   .theta_i_high_deg = 60,
                                   .theta_i_step_deg = 10,
                                   .theta_v_first_deg = -80,
                                   .theta_v_step_deg = 5,
                                   .noise_relative = 0.005,
                                   .noise_absolute = 0.001};
}

static void loop_forever(struct stability_points *p, struct dice *dice) {
    (void)p;
    for (volatile uint64_t i = 0; dice; i++) {
    }
}

static void fall_over(struct stability_points *p, struct dice *dice) {
    (void)p;
    (void)dice;
    _Exit(3);
}

static void halve(struct stability_points *p, struct dice *dice) {
    (void)dice;
    for (size_t i = 0; i < p->n; i++) {
        p->beta[i] /= 2;
        p->u[i] /= 2;
    }
}

/* The table would see it: what hangs, what ends its process, what is stated wrongly. */
static void what_is_wrong_is_seen(void **state) {
    (void)state;
    struct stability_case c = plain();
    struct stability_result r;
    assert_int_equal(stability_run(&c, 1, LIMIT_S, &r, NULL), 0);
    assert_int_equal(r.verdict, STABILITY_GOOD);
    assert_true(r.worst_u < STABILITY_LIE_U && r.n == 198 && r.estimate.condition > 1);
    c.spoil = loop_forever;
    assert_int_equal(stability_run(&c, 1, 1, &r, NULL), 0);
    assert_int_equal(r.verdict, STABILITY_HANGS);
    c.spoil = fall_over;
    assert_int_equal(stability_run(&c, 1, LIMIT_S, &r, NULL), 0);
    assert_int_equal(r.verdict, STABILITY_CRASHES);
    c.spoil = halve;
    assert_int_equal(stability_run(&c, 1, LIMIT_S, &r, NULL), 0);
    assert_int_equal(r.verdict, STABILITY_LIES);
    assert_non_null(strstr(r.why, "is said to be"));
}

static void judge(double limit, bool at_bound, bool unknown, enum stability_verdict expected) {
    struct stability_case c = plain();
    struct stability_result r = {.estimate = {.model = "oren-nayar", .converged = true}};
    for (int p = 0; p < MATERIAL_PARAMETERS; p++) {
        r.estimate.value[p] = c.truth[p];
        r.estimate.statistical[p][p] = 1e-6;
        r.estimate.not_identifiable[p] = p > MATERIAL_SIGMA;
    }
    r.estimate.value[MATERIAL_SIGMA] = at_bound ? 0.01 : 0.5;
    r.estimate.at_bound[MATERIAL_SIGMA] = at_bound;
    r.estimate.limit_95[MATERIAL_SIGMA] = limit;
    r.estimate.not_identifiable[MATERIAL_SIGMA] = unknown;
    stability_judge(&c, &r);
    assert_int_equal(r.verdict, expected);
}

static void limits_may_miss_by_a_little(void **state) {
    (void)state;
    judge(0.4, true, false, STABILITY_GOOD);
    judge(0.2, true, false, STABILITY_GOOD); /* 1 in 20 may */
    judge(0.02, true, false, STABILITY_LIES);
    judge(0.02, true, true, STABILITY_GOOD); /* nothing is claimed */
    judge(0, false, false, STABILITY_LIES);
    judge(0, false, true, STABILITY_GOOD);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_case_lies),
        cmocka_unit_test(what_is_wrong_is_seen),
        cmocka_unit_test(limits_may_miss_by_a_little),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
