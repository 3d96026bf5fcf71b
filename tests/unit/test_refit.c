#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/cholesky.h"
#include "fit/curvature.h"
#include "fit/solve.h"
#include "tests/support/goniometry.h"
#include "tests/support/seed.h"

#define SEED 20261122
#define FIRST 30 /* points before the refits begin */

static struct goniometry m; /* large */

static void begin(struct problem *p, const char *model) {
    struct err e = {0};
    m.input.model = model;
    if (problem_init(p, &m.input, &e)) {
        fail_msg("%s", e.text);
    }
}

static void measure(int set, struct dice *d) {
    goniometry_make(&m, goniometry_set[set], 60, 5);
    goniometry_noise(&m, d);
}

/* The points in any order: a campaign may begin anywhere. */
static void shuffle(struct dice *d) {
    double *const columns[] = {m.theta_i_deg, m.theta_v_deg, m.beta, m.u};
    for (size_t i = m.input.n; i > 1; i--) {
        const size_t at = (size_t)(dice_uniform(d) * (double)i);
        for (int c = 0; c < 4; c++) {
            const double held = columns[c][i - 1];
            columns[c][i - 1] = columns[c][at];
            columns[c][at] = held;
        }
    }
}

static double farthest(const struct solve_result *a, const struct solve_result *b, int k) {
    double worst = 0;
    for (int j = 0; j < k; j++) {
        worst = fmax(worst, fabs(a->x[j] - b->x[j])); /* of logarithms: relative */
    }
    return worst;
}

/* The same place: 1e-9 of each parameter, or a millionth of its u where the points hardly tell it. */
static void assert_agreement(const struct solve_result *a, const struct solve_result *b, int k) {
    double l[COORDINATES_MAX * COORDINATES_MAX];
    assert_true(cholesky_factor(k, a->last.sums.jtj, l));
    for (int j = 0; j < k; j++) {
        double column[COORDINATES_MAX] = {0};
        column[j] = 1;
        cholesky_solve(k, l, column, column);
        assert_true(fabs(a->x[j] - b->x[j]) < fmax(1e-9, 1e-6 * sqrt(column[j])));
    }
}

static void second_derivatives_are_the_slopes_of_the_gradient(void **state) {
    (void)state;
    static const char *const models[] = {"lambert", "oren-nayar", "eq1", "composite"};
    const double step = 1e-5; /* of central differences: error about 1e-10 */
    struct dice d = {test_seed(SEED)};
    for (int run = 0; run < 16; run++) {
        struct problem p;
        struct normal_equations s, side[2];
        double x[COORDINATES_MAX], value[MATERIAL_PARAMETERS], second[COORDINATES_MAX * COORDINATES_MAX];
        bool known;
        measure(run / 4, &d);
        m.input.polarisation = run % 2 ? 0.3 : 0;
        begin(&p, models[run % 4]);
        for (int j = 0; j < MATERIAL_PARAMETERS; j++) { /* far off: the residuals are large */
            value[j] = m.value[j] * (1 + 0.1 * dice_normal(&d));
        }
        value[MATERIAL_N] = fmax(value[MATERIAL_N], 1.3);
        coordinates_from_value(p.model, value, x);
        assert_int_equal(normal_equations_curved(&p, x, &s, second, &known, NULL), 0);
        assert_true(known);
        for (int j = 0; j < p.k; j++) {
            for (int i = 0; i < 2; i++) {
                double moved[COORDINATES_MAX];
                memcpy(moved, x, sizeof moved);
                moved[j] += i ? step : -step;
                assert_int_equal(normal_equations_form(&p, moved, &side[i], NULL), 0);
            }
            for (int i = 0; i < p.k; i++) {
                const double slope = (side[1].jtr[i] - side[0].jtr[i]) / (2 * step);
                const double size = sqrt(s.jtj[i * p.k + i] * s.jtj[j * p.k + j]) + fabs(second[i * p.k + j]);
                assert_true(fabs(slope - s.jtj[i * p.k + j] - second[i * p.k + j]) < 1e-6 * size);
            }
        }
        problem_free(&p);
    }
}

static void what_has_none_in_closed_form_says_so(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    struct problem p;
    measure(0, &d);
    begin(&p, "heavy-tail");
    assert_false(curvature_known(&p));
    problem_free(&p);
    m.input.sensor_width_deg = 1;
    begin(&p, "composite");
    assert_false(curvature_known(&p));
    problem_free(&p);
    m.input.sensor_width_deg = 0;
    m.input.loss = MATERIAL_LOSS_LOG;
    begin(&p, "composite");
    assert_false(curvature_known(&p));
    problem_free(&p);
}

/* Every point of a campaign after its first 30, one refit each, against a fit of the same points from afar. */
static void a_refit_is_the_fit_of_all_points(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    int refits = 0, passes = 0, cold_passes = 0;
    for (int set = 0; set < GONIOMETRY_SETS; set++) {
        struct problem p;
        struct solve_result warm, cold;
        double start[COORDINATES_MAX];
        measure(set, &d);
        shuffle(&d);
        begin(&p, "composite");
        const size_t all = p.n;
        coordinates_from_value(p.model, m.value, start);
        p.n = FIRST;
        assert_int_equal(solve_run(&p, start, NULL, &warm, NULL, NULL), 0);
        while (++p.n <= all) {
            assert_int_equal(solve_more(&p, &warm.last, &warm, NULL), 0);
            assert_int_equal(solve_run(&p, start, NULL, &cold, NULL, NULL), 0);
            assert_true(warm.converged && cold.converged);
            if (warm.last.n && cold.last.n) {
                assert_agreement(&warm, &cold, p.k);
            }
            assert_true(fabs(warm.chi2 - cold.chi2) <= 1e-9 * cold.chi2);
            refits++;
            passes += warm.iterations;
            cold_passes += cold.iterations;
        }
        p.n = all;
        problem_free(&p);
    }
    print_message("# %.2f passes a refit, %.2f a fit from the truth\n", (double)passes / refits,
                  (double)cold_passes / refits);
    assert_true(passes < 1.3 * refits);
}

/* Where nothing can be kept, a refit is a fit from where the last one ended. */
static void without_a_pass_it_begins_at_the_last_optimum(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    struct problem p;
    struct solve_result warm, cold;
    const struct solve_pass none = {0};
    measure(1, &d);
    begin(&p, "composite");
    coordinates_from_value(p.model, m.value, warm.x);
    assert_int_equal(solve_run(&p, warm.x, NULL, &cold, NULL, NULL), 0);
    assert_int_equal(solve_more(&p, &none, &warm, NULL), 0);
    assert_memory_equal(warm.x, cold.x, (size_t)p.k * sizeof(double));
    problem_free(&p);
}

/* A point that contradicts all others moves the fit far: no shortcut may be taken. */
static void a_point_that_contradicts_is_fitted_too(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    for (int set = 0; set < GONIOMETRY_SETS; set++) {
        struct problem p;
        struct solve_result warm, cold;
        double start[COORDINATES_MAX];
        measure(set, &d);
        m.beta[m.input.n - 1] *= 1.5;
        begin(&p, "composite");
        coordinates_from_value(p.model, m.value, start);
        p.n--;
        assert_int_equal(solve_run(&p, start, NULL, &warm, NULL, NULL), 0);
        p.n++;
        assert_int_equal(solve_more(&p, &warm.last, &warm, NULL), 0);
        assert_int_equal(solve_run(&p, start, NULL, &cold, NULL, NULL), 0);
        assert_true(warm.iterations > 1);
        assert_true(farthest(&warm, &cold, p.k) < 1e-8);
        problem_free(&p);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(second_derivatives_are_the_slopes_of_the_gradient),
        cmocka_unit_test(what_has_none_in_closed_form_says_so),
        cmocka_unit_test(a_refit_is_the_fit_of_all_points),
        cmocka_unit_test(without_a_pass_it_begins_at_the_last_optimum),
        cmocka_unit_test(a_point_that_contradicts_is_fitted_too),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
