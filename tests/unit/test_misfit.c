#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "fit/estimate.h"
#include "fit/reflectance.h"
#include "fit/sweeps.h"
#include "tests/support/goniometry.h"
#include "tests/support/seed.h"

#define SEED 31

static struct goniometry m;
static const struct reflectance_optics plain = {.kappa = 1, .q = 1};

static bool says(const struct estimate *estimate, const char *words) {
    for (int i = 0; i < estimate->n_warnings; i++) {
        if (strstr(estimate->warning[i], words)) {
            return true;
        }
    }
    return false;
}

static void fit(const struct estimate_input *input, struct estimate *estimate) {
    struct err e = {0};
    if (estimate_fit(input, estimate, &e)) {
        fail_msg("%s", e.text);
    }
    assert_true(estimate->converged);
}

/* What the paper's model meets on real paint (reflection-model.md 6): a lobe with the tail
 * D = (1 + (2^(1/a) - 1) phi^2 / gamma^2)^(-a), of the same half width. */
static double with_tail(const double *value, double a, double i_deg, double v_deg) {
    struct reflectance_geometry g;
    double whole, matte, flat[MATERIAL_PARAMETERS];
    memcpy(flat, value, sizeof flat);
    flat[MATERIAL_BETA_PRIME] = 0;
    assert_int_equal(reflectance_geometry(&g, i_deg, v_deg, NULL), 0);
    assert_int_equal(reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, &plain, &whole, NULL, NULL), 0);
    assert_int_equal(reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, flat, &plain, &matte, NULL, NULL), 0);
    double widths = (i_deg - v_deg) / 2 * M_PI / 180 / value[MATERIAL_GAMMA];
    double gauss = exp2(-widths * widths), tail = pow(1 + (exp2(1 / a) - 1) * widths * widths, -a);
    return matte + (whole - matte) / gauss * tail;
}

#define SWEEPS_OF 21 /* theta_v -80 .. 80 by 8 */

/* Incidences from first_deg by 10 up to 60, of the surface with a tail. */
static void make_tailed(double first_deg, double step_deg, struct dice *d) {
    static const double value[MATERIAL_PARAMETERS] = {0.2, 0.3, 0.12, 7.6, 1.6};
    goniometry_make(&m, value, 10, 5);
    m.input.n = 0;
    for (double i_deg = first_deg; i_deg <= 60; i_deg += step_deg) {
        for (int k = 0; k < SWEEPS_OF; k++) {
            size_t at = m.input.n++;
            m.theta_i_deg[at] = i_deg;
            m.theta_v_deg[at] = -80 + 8 * k;
            m.truth[at] = with_tail(value, 1.5, i_deg, m.theta_v_deg[at]);
        }
    }
    goniometry_noise(&m, d);
}

/* u of noise alone at the same geometries: of a surface that is as the model says. */
static void noise_u(const struct estimate *at, double *u) {
    struct estimate clean;
    for (size_t i = 0; i < m.input.n; i++) {
        struct reflectance_geometry g;
        reflectance_geometry(&g, m.theta_i_deg[i], m.theta_v_deg[i], NULL);
        reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, at->value, &plain, &m.beta[i], NULL, NULL);
        m.u[i] = hypot(0.005 * m.beta[i], 0.001);
    }
    fit(&m.input, &clean);
    assert_false(says(&clean, "does not fit"));
    for (int j = 0; j < 5; j++) {
        u[j] = sqrt(clean.statistical[j][j]);
    }
}

/* Two sets of other incidences of one surface that the model does not describe: what the fits make of it must agree
 * within the u they state, which the u of noise alone does not cover. */
static void two_halves_agree_within_their_u(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    struct estimate half[2];
    double noise[2][5], worst = 0;
    for (int h = 0; h < 2; h++) {
        make_tailed(h ? 15 : 10, 10, &d);
        fit(&m.input, &half[h]);
        assert_true(says(&half[h], "does not fit") && says(&half[h], "descriptive"));
        noise_u(&half[h], noise[h]);
    }
    for (int j = 0; j < 5; j++) {
        double apart = fabs(half[0].value[j] - half[1].value[j]);
        double stated = sqrt(half[0].statistical[j][j] + half[1].statistical[j][j]);
        for (int h = 0; h < 2; h++) {
            assert_true(sqrt(half[h].statistical[j][j]) > noise[h][j]); /* never below 1 */
        }
        worst = fmax(worst, apart / hypot(noise[0][j], noise[1][j]));
        print_message("# parameter %d: %.2f stated u apart\n", j, apart / stated);
        assert_true(apart < 2 * stated);
    }
    print_message("# %.1f u of noise alone\n", worst);
    assert_true(worst > 4); /* the test can fail */
}

/* The same misfit seen by a file without any uncertainty: the residuals themselves must give it away. */
static void without_u_the_residuals_tell(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    struct estimate estimate;
    make_tailed(10, 10, &d);
    m.input.u_ind = NULL;
    fit(&m.input, &estimate);
    assert_true(says(&estimate, "same side"));
    int false_alarms = 0;
    for (int run = 0; run < 100; run++) {
        goniometry_make(&m, goniometry_set[2], 60, 5);
        goniometry_noise(&m, &d);
        m.input.u_ind = NULL;
        fit(&m.input, &estimate);
        false_alarms += says(&estimate, "does not fit");
    }
    assert_true(false_alarms <= 1);
}

/* The paper's unweighted fit of data of unequal, stated u: chi-square is not n - k, and still no false alarm. */
static void an_unweighted_fit_is_judged_by_its_own_expectation(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    struct estimate estimate;
    int alarms = 0;
    double sum = 0;
    for (int run = 0; run < 100; run++) {
        goniometry_make(&m, goniometry_set[0], 60, 5);
        goniometry_noise(&m, &d);
        m.input.unweighted = true;
        fit(&m.input, &estimate);
        alarms += says(&estimate, "does not fit");
        sum += estimate.chi2 / 100;
    }
    print_message("# mean chi-square %.0f of 193, %d alarms of 100\n", sum, alarms);
    assert_true(sum > 200);
    assert_true(alarms <= 2);
    make_tailed(10, 10, &d);
    m.input.unweighted = true;
    fit(&m.input, &estimate);
    assert_true(says(&estimate, "does not fit"));
}

/* A walk with correlation r from point to point is worth n (1 - r) / (1 + r) of them. */
static void correlated_residuals_count_for_less(void **state) {
    (void)state;
    enum { N = 4000 };
    static double theta_i_deg[N], theta_v_deg[N], residual[N];
    struct dice d = {test_seed(SEED)};
    const double r[] = {0, 0.5, 0.9};
    for (size_t i = 0; i < N; i++) { /* out of order: the sweeps must be found */
        size_t at = (i * 1237) % N;
        theta_i_deg[at] = 10 * (1 + (double)(i / 1000)) + 0.3 * dice_uniform(&d);
        theta_v_deg[at] = -80 + 0.16 * (double)(i % 1000);
    }
    for (int k = 0; k < 3; k++) {
        struct sweeps s;
        assert_int_equal(sweeps_find(&s, N, theta_i_deg, theta_v_deg, NULL), 0);
        assert_int_equal(s.n_sweeps, 4);
        for (size_t i = 0; i < N; i++) {
            double before = i ? residual[s.order[i - 1]] : 0;
            residual[s.order[i]] = r[k] * before + sqrt(1 - r[k] * r[k]) * dice_normal(&d);
        }
        double expected = N * (1 - r[k]) / (1 + r[k]);
        assert_float_equal(sweeps_effective(&s, residual) / expected, 1, 0.25);
        for (size_t i = 0; i < N; i++) {
            residual[i] = 1;
        }
        assert_true(sweeps_effective(&s, residual) < 20); /* four constants; the ends of a sweep blur it */
        sweeps_free(&s);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(two_halves_agree_within_their_u),
        cmocka_unit_test(without_u_the_residuals_tell),
        cmocka_unit_test(an_unweighted_fit_is_judged_by_its_own_expectation),
        cmocka_unit_test(correlated_residuals_count_for_less),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
