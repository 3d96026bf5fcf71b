#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "fit/cholesky.h"
#include "fit/solve.h"
#include "fit/normal_equations.h"
#include "fit/products.h"
#include "tests/support/goniometry.h"
#include "tests/support/seed.h"

#define SEED 20261122

static struct goniometry m; /* large: static */

static void begin(struct problem *p) {
    struct err e = {0};
    if (problem_init(p, &m.input, &e)) {
        fail_msg("%s", e.text);
    }
}

static void solve(enum solve_method method, const struct problem *p, const double *start, const bool *held,
                  struct solve_result *result) {
    struct err e = {0};
    if (solve_by(method, p, start, held, result, NULL, &e)) {
        fail_msg("%s", e.text);
    }
    assert_true(result->converged);
}

/* Every parameter off by up to 15 %, n - 1 by half of that. */
static void perturbed(const struct problem *p, struct dice *d, double *x) {
    double value[MATERIAL_PARAMETERS] = {0};
    for (int j = 0; j < MATERIAL_N; j++) {
        value[j] = m.value[j] * (1 + 0.15 * (2 * dice_uniform(d) - 1));
    }
    value[MATERIAL_N] = 1 + (m.value[MATERIAL_N] - 1) * (1 + 0.075 * (2 * dice_uniform(d) - 1));
    coordinates_from_value(p->model, value, x);
}

static double farthest(const struct solve_result *a, const struct solve_result *b, int k) {
    double worst = 0;
    for (int j = 0; j < k; j++) {
        worst = fmax(worst, fabs(a->x[j] - b->x[j])); /* of logarithms: relative */
    }
    return worst;
}

static void both_solvers_agree_on_the_published_sets(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    for (int set = 0; set < GONIOMETRY_SETS; set++) {
        for (int run = 0; run < 10; run++) {
            struct solve_result tiny, qr, cholesky;
            struct problem p;
            double x[COORDINATES_MAX], truth[COORDINATES_MAX];
            goniometry_make(&m, goniometry_set[set], 60, 5);
            begin(&p);
            perturbed(&p, &d, x);
            coordinates_from_value(p.model, m.value, truth);
            solve(SOLVE_TINY, &p, x, NULL, &tiny);
            solve(SOLVE_QR, &p, x, NULL, &qr);
            solve(SOLVE_CHOLESKY, &p, x, NULL, &cholesky);
            assert_null(tiny.handed_over);
            assert_true(farthest(&tiny, &qr, p.k) < 1e-9);
            assert_true(farthest(&tiny, &cholesky, p.k) < 1e-9);
            memcpy(cholesky.x, truth, sizeof truth);
            assert_true(farthest(&tiny, &cholesky, p.k) < 1e-9);
            problem_free(&p);
        }
    }
}

/* With noise a cost is known to its rounding only, and by it a point to 1e-8 or so: far inside any stated u. */
static void both_solvers_agree_on_noisy_points(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    for (int run = 0; run < 40; run++) {
        struct solve_result tiny, qr;
        struct problem p;
        double x[COORDINATES_MAX];
        goniometry_make(&m, goniometry_set[run % GONIOMETRY_SETS], 60, 5);
        goniometry_noise(&m, &d);
        begin(&p);
        perturbed(&p, &d, x);
        solve(SOLVE_TINY, &p, x, NULL, &tiny);
        solve(SOLVE_QR, &p, x, NULL, &qr);
        assert_true(farthest(&tiny, &qr, p.k) < 3e-8);
        assert_float_equal(tiny.chi2 / qr.chi2, 1, 1e-12);
        problem_free(&p);
    }
}

/* An index of 1.305 in noise of 5 % is drawn to its bound in half of the draws. */
static void a_bound_is_handed_over(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    const double value[MATERIAL_PARAMETERS] = {0.2, 0.3, 0.07, 7.6, 1.305};
    int met = 0, kept = 0;
    for (int run = 0; run < 20; run++) {
        struct solve_result tiny, qr;
        struct problem p;
        double x[COORDINATES_MAX];
        goniometry_make(&m, value, 60, 10);
        for (size_t i = 0; i < m.input.n; i++) {
            m.u[i] = 0.05 * m.truth[i];
            m.beta[i] = m.truth[i] + m.u[i] * dice_normal(&d);
        }
        begin(&p);
        coordinates_from_value(p.model, value, x);
        solve(SOLVE_TINY, &p, x, NULL, &tiny);
        solve(SOLVE_QR, &p, x, NULL, &qr);
        assert_true(farthest(&tiny, &qr, p.k) < 1e-6); /* u is about 0.02 */
        if (tiny.handed_over) {
            met++;
            assert_string_equal(tiny.handed_over, "a step met a bound");
            assert_true(tiny.x[4] >= p.low[4]);
        } else {
            kept++;
            assert_true(tiny.x[4] > p.low[4]);
        }
        problem_free(&p);
    }
    print_message("# %d handed over, %d not\n", met, kept);
    assert_true(met > 0 && kept > 0);
}

/* Two viewing angles at one incidence hold two numbers, not five. */
static void what_normal_equations_cannot_tell_is_handed_over(void **state) {
    (void)state;
    struct solve_result result;
    struct err e = {0};
    struct problem p;
    double x[COORDINATES_MAX];
    goniometry_make(&m, goniometry_set[2], 60, 5);
    for (size_t i = 0; i < 12; i++) {
        m.theta_i_deg[i] = 10;
        m.theta_v_deg[i] = i % 2 ? 20 : 60;
        m.beta[i] = 0.2;
        m.u[i] = 1e-3;
    }
    m.input.n = 12;
    begin(&p);
    coordinates_from_value(p.model, goniometry_set[2], x);
    assert_int_equal(solve_run(&p, x, NULL, &result, NULL, &e), 0);
    assert_non_null(result.handed_over);
    problem_free(&p);
}

static void held_coordinates_stay(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    struct problem p;
    double x[COORDINATES_MAX];
    goniometry_make(&m, goniometry_set[1], 60, 5);
    goniometry_noise(&m, &d);
    begin(&p);
    for (int mask = 0; mask < 32; mask++) {
        struct solve_result tiny, qr;
        bool held[5];
        for (int j = 0; j < 5; j++) {
            held[j] = mask >> j & 1;
        }
        perturbed(&p, &d, x);
        solve(SOLVE_TINY, &p, x, held, &tiny);
        solve(SOLVE_QR, &p, x, held, &qr);
        for (int j = 0; j < 5; j++) {
            assert_true(!held[j] || tiny.x[j] == x[j]);
        }
        if (!tiny.handed_over) { /* held far off, the others may be driven to their bounds */
            assert_true(farthest(&tiny, &qr, p.k) < 1e-6);
        }
    }
    problem_free(&p);
}

/* Each sum of a pass against one formed point by point, and over more points than a block holds. */
static void a_pass_is_the_sum_over_points(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    struct problem p;
    struct normal_equations s;
    struct err e = {0};
    double x[COORDINATES_MAX], value[MATERIAL_PARAMETERS], chain[COORDINATES_MAX * COORDINATES_MAX];
    goniometry_make(&m, goniometry_set[0], 60, 5);
    goniometry_noise(&m, &d);
    begin(&p);
    perturbed(&p, &d, x);
    coordinates_to_value(p.model, x, value);
    coordinates_chain(p.model, value, chain);
    assert_int_equal(normal_equations_form(&p, x, &s, &e), 0);
    assert_int_equal(problem_evaluate(&p, value, &e), 0);
    double chi2 = 0, jtr[5] = {0}, jtj[25] = {0};
    for (size_t i = 0; i < p.n; i++) {
        double row[5], r = (p.model_beta[i] - m.beta[i]) * p.root_weight[i];
        for (int j = 0; j < 5; j++) {
            row[j] = 0;
            for (int c = 0; c < 5; c++) {
                row[j] += p.gradient[i * 5 + (size_t)c] * chain[c * 5 + j] * p.root_weight[i];
            }
            jtr[j] += row[j] * r;
        }
        for (int c = 0; c < 25; c++) {
            jtj[c] += row[c / 5] * row[c % 5];
        }
        chi2 += r * r;
    }
    assert_float_equal(s.chi2 / chi2, 1, 1e-13);
    for (int c = 0; c < 25; c++) {
        assert_true(fabs(s.jtj[c] - jtj[c]) < 1e-12 * sqrt(jtj[c / 5 * 6] * jtj[c % 5 * 6]));
    }
    for (int j = 0; j < 5; j++) {
        assert_true(fabs(s.jtr[j] - jtr[j]) < 1e-12 * sqrt(jtj[j * 6] * chi2));
    }
    problem_free(&p);
}

/* Products of any number of columns and points, by every width this processor has: the same bits, and the right ones. */
static void every_width_gives_the_same_products(void **state) {
    (void)state;
    enum { ROOM = 72 };
    struct dice d = {test_seed(SEED)};
    double slope[ROOM * COORDINATES_MAX], weight[ROOM], residual[ROOM],
        sum[REFLECTANCE_WIDTHS][PRODUCTS_CELLS];
    for (int k = 1; k <= COORDINATES_MAX; k++) {
        const size_t n = 61 + (size_t)k, room = reflectance_batch_room(n);
        for (size_t i = 0; i < room; i++) {
            weight[i] = i < n ? dice_uniform(&d) : 0;
            residual[i] = i < n ? dice_normal(&d) : 0;
            for (size_t j = 0; j < (size_t)k; j++) {
                slope[j * ROOM + i] = dice_normal(&d);
            }
        }
        memset(sum, 0, sizeof sum);
        for (int w = 0; w <= (int)reflectance_batch_width(); w++) {
            products_add((enum reflectance_width)w, k, n, slope, ROOM, weight, residual, sum[w]);
            assert_memory_equal(sum[w], sum[0], sizeof sum[0]);
        }
        for (int a = 0, cell = 0; a <= k; a++) {
            for (int b = 0; b <= a; b++, cell++) {
                double plain = 0;
                for (size_t i = 0; i < n; i++) {
                    plain += (a < k ? slope[a * ROOM + i] * weight[i] : residual[i]) *
                             (b < k ? slope[b * ROOM + i] * weight[i] : residual[i]);
                }
                assert_float_equal(sum[0][cell], plain, 1e-12);
            }
        }
    }
}

static void small_systems_are_solved(void **state) {
    (void)state;
    const double a[9] = {4, 2, 0.6, 2, 2, 0.5, 0.6, 0.5, 3}, x[3] = {1, -2, 3};
    double l[9], b[3], got[3];
    for (int i = 0; i < 3; i++) {
        b[i] = a[i * 3] * x[0] + a[i * 3 + 1] * x[1] + a[i * 3 + 2] * x[2];
    }
    assert_true(cholesky_factor(3, a, l));
    cholesky_solve(3, l, b, got);
    for (int i = 0; i < 3; i++) {
        assert_float_equal(got[i], x[i], 1e-14);
    }
    const double singular[4] = {1, 1, 1, 1}, unit[4] = {1e-8, 0, 0, 1e8},
                 near[4] = {1, 1 - 1e-6, 1 - 1e-6, 1};
    assert_false(cholesky_factor(2, singular, l));
    assert_true(isinf(cholesky_condition(2, singular)));
    assert_float_equal(cholesky_condition(2, unit), 1, 1e-15); /* units do not matter */
    assert_float_equal(cholesky_condition(2, near) / 2e6, 1, 1e-5);
}

static void nonsense_is_refused_in_words(void **state) {
    (void)state;
    struct solve_result result;
    struct problem p;
    struct err e = {0};
    const double x[COORDINATES_MAX] = {0, NAN};
    goniometry_make(&m, goniometry_set[0], 60, 5);
    begin(&p);
    assert_int_equal(solve_run(&p, x, NULL, &result, NULL, &e), -ERR_FIT);
    assert_non_null(strstr(e.text, "not a number"));
    problem_free(&p);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(both_solvers_agree_on_the_published_sets),
        cmocka_unit_test(both_solvers_agree_on_noisy_points),
        cmocka_unit_test(a_bound_is_handed_over),
        cmocka_unit_test(what_normal_equations_cannot_tell_is_handed_over),
        cmocka_unit_test(held_coordinates_stay),
        cmocka_unit_test(a_pass_is_the_sum_over_points),
        cmocka_unit_test(every_width_gives_the_same_products),
        cmocka_unit_test(small_systems_are_solved),
        cmocka_unit_test(nonsense_is_refused_in_words),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
