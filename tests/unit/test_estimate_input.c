#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/estimate.h"
#include "tests/support/goniometry.h"

static struct goniometry m;

static int try_fit(struct estimate *estimate, struct err *e) {
    err_clear(e);
    int status = estimate_fit(&m.input, estimate, e);
    assert_true(status <= 0);
    if (status) {
        assert_true(strlen(e->text) > 20 && !estimate->converged);
    } else if (estimate->converged) {
        assert_true(estimate->refusal[0] == 0);
        for (int j = 0; j <= MATERIAL_N; j++) {
            assert_true(isfinite(estimate->value[j]) && isfinite(estimate->statistical[j][j]));
            assert_true(estimate->statistical[j][j] >= 0);
        }
    } else {
        assert_true(strlen(estimate->refusal) > 20);
    }
    return status;
}

static void values_outside_the_domain_name_their_point(void **state) {
    (void)state;
    static const double bad[] = {NAN, INFINITY, -INFINITY, 1e300};
    struct estimate estimate;
    struct err e = {0};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        goniometry_make(&m, goniometry_set[0], 60, 5);
        m.beta[7] = bad[i];
        assert_int_equal(try_fit(&estimate, &e), -ERR_RANGE);
        assert_non_null(strstr(e.text, "point 8"));
        goniometry_make(&m, goniometry_set[0], 60, 5);
        m.u[9] = bad[i];
        assert_int_equal(try_fit(&estimate, &e), -ERR_RANGE);
        assert_non_null(strstr(e.text, "point 10"));
        goniometry_make(&m, goniometry_set[0], 60, 5);
        m.theta_v_deg[1] = bad[i];
        assert_int_equal(try_fit(&estimate, &e), -ERR_RANGE);
    }
    goniometry_make(&m, goniometry_set[0], 60, 5);
    m.u[0] = -1e-9;
    assert_int_equal(try_fit(&estimate, &e), -ERR_RANGE);
    m.u[0] = 1e-3;
    m.input.model = "phong";
    assert_int_equal(try_fit(&estimate, &e), -ERR_USAGE);
    m.input.model = "composite";
    m.input.kappa = NAN;
    assert_int_equal(try_fit(&estimate, &e), -ERR_RANGE);
    m.input.kappa = 1;
    m.input.u_zero_source_deg = NAN;
    assert_int_equal(try_fit(&estimate, &e), -ERR_RANGE);
}

static void odd_but_possible_values_are_taken(void **state) {
    (void)state;
    struct estimate estimate;
    struct err e = {0};
    goniometry_make(&m, goniometry_set[2], 60, 5);
    memset(m.u, 0, sizeof m.u); /* a noise-free instrument: the floor keeps the weights finite */
    assert_int_equal(try_fit(&estimate, &e), 0);
    assert_float_equal(estimate.value[MATERIAL_N], 1.7, 1e-6);
    goniometry_make(&m, goniometry_set[2], 60, 5);
    m.beta[3] = 0;
    m.beta[4] = -0.0005; /* dark points scatter about zero */
    assert_int_equal(try_fit(&estimate, &e), 0);
    goniometry_make(&m, goniometry_set[2], 60, 5);
    for (size_t i = 0; i < m.input.n; i++) { /* weights over twelve decades */
        m.u[i] = pow(10, -6 + 12.0 * (double)(i % 7) / 6) * 1e-4;
    }
    assert_int_equal(try_fit(&estimate, &e), 0);
    assert_float_equal(estimate.value[MATERIAL_GAMMA], 0.07, 1e-4);
}

static void senseless_data_end_in_words_not_in_a_crash(void **state) {
    (void)state;
    struct estimate estimate;
    struct err e = {0};
    struct dice d = {3};
    static const double size[] = {0, 1e-30, 1e-6, 1, 1e6, 1e12};
    for (size_t s = 0; s < sizeof size / sizeof *size; s++) {
        for (int kind = 0; kind < 4; kind++) {
            goniometry_make(&m, goniometry_set[2], 60, 10);
            for (size_t i = 0; i < m.input.n; i++) {
                m.beta[i] = kind == 0   ? size[s]
                            : kind == 1 ? -size[s]
                            : kind == 2 ? size[s] * dice_normal(&d) * 0.1
                                        : size[s] * (double)(i == 50);
                m.u[i] = 0.01;
            }
            try_fit(&estimate, &e);
        }
    }
}

/* A model with one parameter, and that at its bound: nothing is left to search, and the limit is found all the same. */
static void the_only_parameter_may_end_at_its_bound(void **state) {
    (void)state;
    struct estimate estimate;
    struct err e = {0};
    goniometry_make(&m, goniometry_set[2], 60, 10);
    m.input.model = "lambert";
    for (size_t i = 0; i < m.input.n; i++) {
        m.beta[i] = i % 2 ? -0.011 : 0.009;
        m.u[i] = 0.01;
    }
    assert_int_equal(estimate_fit(&m.input, &estimate, &e), 0);
    assert_true(estimate.converged && estimate.at_bound[MATERIAL_S]);
    /* mean -0.001, u 0.01 / sqrt(n): the limit lies where the cost has risen by 1.645^2 over that at the bound */
    double u2 = 1e-4 / (double)m.input.n, off = 1e-4 + 0.001;
    assert_float_equal(estimate.limit_95[MATERIAL_S], sqrt(off * off + 2.7055 * u2) - 0.001, 2e-6);
}

static void too_few_geometries_are_refused_in_words(void **state) {
    (void)state;
    struct estimate estimate;
    struct err e = {0};
    goniometry_make(&m, goniometry_set[2], 60, 5);
    for (size_t n = 0; n < 7; n++) {
        m.input.n = n;
        assert_int_equal(try_fit(&estimate, &e), 0);
        assert_false(estimate.converged);
        assert_non_null(strstr(estimate.refusal, "needs at least 7"));
    }
    m.input.n = 30; /* all of them the same two geometries */
    for (size_t i = 0; i < m.input.n; i++) {
        m.theta_i_deg[i] = 30;
        m.theta_v_deg[i] = i % 2 ? 30 : -30;
    }
    assert_int_equal(try_fit(&estimate, &e), 0);
    assert_non_null(strstr(estimate.refusal, "2 different geometries"));
    m.input.model = "lambert";
    assert_int_equal(try_fit(&estimate, &e), 0);
    assert_false(estimate.converged); /* a plane of one parameter: three geometries */
    m.theta_v_deg[0] = 0;
    assert_int_equal(try_fit(&estimate, &e), 0);
    assert_true(estimate.converged);
}

/* No parameter that is given with a u, at any size of the set, is far from the truth. */
static void assert_honest(const struct estimate *estimate, size_t n) {
    for (int j = 0; j <= MATERIAL_N; j++) {
        double error = fabs(estimate->value[j] - m.value[j]), u = sqrt(estimate->statistical[j][j]);
        if (!estimate->at_bound[j] && !estimate->not_identifiable[j] && !(error < 5 * u)) {
            fail_msg("%zu points: parameter %d is %g, truly %g, with u %g", n, j, estimate->value[j],
                     m.value[j], u);
        }
    }
}

/* A campaign as it grows: from the first point on every answer is words or a sound estimate. */
static void a_growing_set_is_answered_honestly_at_every_size(void **state) {
    (void)state;
    struct estimate estimate;
    struct err e = {0};
    struct dice d = {11};
    for (int set = 0; set < GONIOMETRY_SETS; set++) {
        int refused = 0;
        goniometry_make(&m, goniometry_set[set], 60, 5);
        goniometry_noise(&m, &d);
        size_t all = m.input.n;
        for (size_t n = 0; n <= all; n += 2) {
            m.input.n = n;
            assert_int_equal(try_fit(&estimate, &e), 0);
            refused += !estimate.converged;
            if (estimate.converged) {
                assert_honest(&estimate, n);
            }
        }
        print_message("# %s: %d of %zu sizes refused\n", goniometry_name[set], refused, all / 2 + 1);
        assert_true(estimate.converged && refused >= 4 && refused < 30);
    }
}

static void diffuse_angles_alone_do_not_make_a_lobe(void **state) {
    (void)state;
    struct estimate estimate;
    struct err e = {0};
    goniometry_make(&m, goniometry_set[0], 60, 5);
    size_t n = 0;
    for (size_t i = 0; i < m.input.n; i++) { /* keep the backscatter side */
        if (m.theta_v_deg[i] < -20) {
            m.theta_i_deg[n] = m.theta_i_deg[i];
            m.theta_v_deg[n] = m.theta_v_deg[i];
            m.beta[n] = m.beta[i];
            m.u[n++] = m.u[i];
        }
    }
    m.input.n = n;
    assert_int_equal(try_fit(&estimate, &e), 0);
    if (estimate.converged) {
        assert_true(estimate.not_identifiable[MATERIAL_N] && estimate.not_identifiable[MATERIAL_GAMMA]);
        assert_true(estimate.gap[MATERIAL_N].has_next);
        assert_true(estimate.gap[MATERIAL_N].next_theta_v_deg > 0); /* the mirror side */
        assert_float_equal(estimate.value[MATERIAL_SIGMA], 0.35, 0.02);
    } else {
        assert_non_null(strstr(estimate.refusal, "measure next at incidence"));
    }
}

static void paper_convention_is_another_fit(void **state) {
    (void)state;
    struct estimate estimate, paper;
    struct err e = {0};
    goniometry_make(&m, goniometry_set[3], 60, 5);
    m.input.unweighted = true;
    assert_int_equal(try_fit(&estimate, &e), 0);
    assert_float_equal(estimate.value[MATERIAL_SIGMA], 0.5, 1e-6);
    m.input.kappa = M_PI;
    assert_int_equal(try_fit(&paper, &e), 0);
    assert_true(paper.kappa == M_PI);
    assert_true(fabs(paper.value[MATERIAL_SIGMA] / 0.5 - 1) > 0.02); /* reflection-model.md 1.5 */
    assert_float_equal(paper.value[MATERIAL_GAMMA], 0.08, 0.001);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_outside_the_domain_name_their_point),
        cmocka_unit_test(odd_but_possible_values_are_taken),
        cmocka_unit_test(senseless_data_end_in_words_not_in_a_crash),
        cmocka_unit_test(the_only_parameter_may_end_at_its_bound),
        cmocka_unit_test(too_few_geometries_are_refused_in_words),
        cmocka_unit_test(a_growing_set_is_answered_honestly_at_every_size),
        cmocka_unit_test(diffuse_angles_alone_do_not_make_a_lobe),
        cmocka_unit_test(paper_convention_is_another_fit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
