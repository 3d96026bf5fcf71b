#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "fit/estimate.h"
#include "fit/reflectance.h"

#define COUNT(array) (sizeof(array) / sizeof *(array))
#define N 198 /* incidence 10 to 60 by 10, viewing -80 to 80 by 5 deg */

static double theta_i_deg[N], theta_v_deg[N], beta[N], u[N];

/* What a surface of this model shows, without noise, at the uncertainty of a good instrument. */
static void measure(enum reflectance_model model, const double *value) {
    static const struct reflectance_optics optics = {.kappa = 1, .q = 1};
    for (int i = 0; i < N; i++) {
        struct reflectance_geometry g;
        theta_i_deg[i] = 10 + 10 * (i / 33);
        theta_v_deg[i] = -80 + 5 * (i % 33);
        assert_int_equal(reflectance_geometry(&g, theta_i_deg[i], theta_v_deg[i], NULL), 0);
        assert_int_equal(reflectance_eval(model, 1, &g, value, &optics, &beta[i], NULL, NULL), 0);
        u[i] = hypot(0.005 * beta[i], 0.001);
    }
}

static void fit(enum reflectance_model model, struct estimate *m) {
    const struct estimate_input input = {.n = N,
                                         .theta_i_deg = theta_i_deg,
                                         .theta_v_deg = theta_v_deg,
                                         .beta = beta,
                                         .u_ind = u,
                                         .kappa = 1,
                                         .mean_low_nm = 400,
                                         .mean_high_nm = 700,
                                         .model = reflectance_name(model)};
    struct err e = {0};
    if (estimate_fit(&input, m, &e) != 0 || !m->converged) {
        fail_msg("%s: %s%s", reflectance_name(model), e.text, m->refusal);
    }
}

static const struct {
    enum reflectance_model model;
    double value[MATERIAL_PARAMETERS];
} truths[] = {
    {REFLECTANCE_HEAVY_TAIL, {0.1, 0.35, 0.08, 30, 1.5, 0.3}},
    {REFLECTANCE_HEAVY_TAIL, {0.2, 0.3, 0.07, 7.6, 1.7, 1.2}},
    {REFLECTANCE_HEAVY_TAIL, {0.3, 0.5, 0.15, 10, 1.4, 1.9}},
    {REFLECTANCE_TRANSMITTED, {0.2, 0.3, 0.07, 7.6, 1.7, 1.5}},
    {REFLECTANCE_TRANSMITTED, {0.5, 0.4, 0.2, 3, 1.5, 1.15}},
    {REFLECTANCE_TWO_LOBE, {0.1, 0.35, 0.05, 60, 1.4, 0.2, 8}},
    {REFLECTANCE_TWO_LOBE, {0.3, 0.3, 0.1, 5, 1.6, 0.4, 3}},
};

static void each_relative_is_found_again(void **state) {
    (void)state;
    for (size_t t = 0; t < COUNT(truths); t++) {
        struct estimate m;
        measure(truths[t].model, truths[t].value);
        fit(truths[t].model, &m);
        for (int j = 0; j < reflectance_parameters(truths[t].model); j++) {
            enum material_parameter p = reflectance_parameter(truths[t].model, j);
            double truth = truths[t].value[p], u_p = sqrt(m.statistical[p][p] + m.common[p][p]);
            if (!(fabs(m.value[p] - truth) <= 1e-6 * truth + 0.01 * u_p) || m.at_bound[p]) {
                fail_msg("%s %zu, %s: %.10g, true %.10g, u %.2g", m.model, t,
                         material_parameter_name(m.model, (int)p), m.value[p], truth, u_p);
            }
        }
    }
}

/* On a surface of the paper's model a richer one finds the paper's parameters, and nothing more. */
static void a_composite_surface_leaves_the_relatives_at_it(void **state) {
    (void)state;
    const double value[MATERIAL_PARAMETERS] = {0.2, 0.3, 0.07, 7.6, 1.7};
    struct estimate m;
    measure(REFLECTANCE_COMPOSITE, value);
    fit(REFLECTANCE_HEAVY_TAIL, &m);
    assert_true(m.at_bound[MATERIAL_EXTRA_1] && m.value[MATERIAL_EXTRA_1] == 0);
    assert_true(m.limit_95[MATERIAL_EXTRA_1] > 0 && m.limit_95[MATERIAL_EXTRA_1] < 0.1);
    assert_float_equal(m.value[MATERIAL_GAMMA], 0.07, 1e-6);
    assert_float_equal(m.value[MATERIAL_N], 1.7, 1e-5);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_relative_is_found_again),
        cmocka_unit_test(a_composite_surface_leaves_the_relatives_at_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
