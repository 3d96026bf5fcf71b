#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "fit/reflectance.h"
#include "tests/support/exact_model.h"

#define COLUMNS 5 /* of the composite model */
#define COUNT(array) (sizeof(array) / sizeof *(array))

/* reflection-model.md 2.3: tiny, ordinary and grazing angles, in plane, both sides. */
static const double angles_deg[] = {0,  1e-12, 1e-9, 1e-6,     1e-3,      0.1,       1,
                                    5,  20,    40,   44.9,     45,        45.1,      60,
                                    75, 85,    88,   90 - 1.0, 90 - 1e-3, 90 - 1e-6, 90 - 1e-9};
/* S, sigma, gamma, beta', n: as 2.3, and the published extremes */
static const double sets[][COLUMNS] = {{0.1, 0.35, 0.05, 126, 1.4},
                                       {0.3, 0.01, 0.01, 1, 1 + 1e-8},
                                       {1.2, 0.5, 0.2, 15.7, 1.3},
                                       {0.01, 1e-4, 0.002, 1.6, 2.42},
                                       {0.8, 1.0, 1.0, 0.01, 1 + 1e-12}};
static const char *const slope_name[] = {"d/dS", "d/dsigma", "d/dgamma", "d/dbeta'", "d/dn"};
static const struct reflectance_optics optics = {.kappa = 1.3, .q = 1.7}, plain = {.kappa = 1, .q = 1},
                                       doubled = {.kappa = 1, .q = 2};

static void value_of(const double *set, double *value) {
    memset(value, 0, MATERIAL_PARAMETERS * sizeof *value);
    memcpy(value, set, COLUMNS * sizeof *value);
}

static void assert_close(double got, double expected, double tolerance, const char *what, double theta_i_deg,
                         double theta_v_deg, size_t set) {
    if (!(fabs(got - expected) <= tolerance)) {
        fail_msg("%s at %.17g, %.17g deg, set %zu: %.17g, exactly %.17g, apart %.3g, allowed %.3g", what,
                 theta_i_deg, theta_v_deg, set, got, expected, fabs(got - expected), tolerance);
    }
}

/* Calls check at every geometry of the extreme grid with every parameter set. */
static void each_case(void (*check)(double theta_i_deg, double theta_v_deg, size_t set), size_t stride) {
    size_t count = 0;
    for (size_t i = 0; i < COUNT(angles_deg); i++) {
        for (size_t j = 0; j < 2 * COUNT(angles_deg); j++) {
            double theta_v_deg = j % 2 ? -angles_deg[j / 2] : angles_deg[j / 2];
            for (size_t set = 0; set < COUNT(sets); set++) {
                if (count++ % stride == 0) {
                    check(angles_deg[i], theta_v_deg, set);
                }
            }
        }
    }
    exact_free_caches();
}

static void check_values(double theta_i_deg, double theta_v_deg, size_t set) {
    double value[MATERIAL_PARAMETERS];
    value_of(sets[set], value);
    struct exact_values exact;
    struct exact_case at = exact_in_plane(REFLECTANCE_COMPOSITE, theta_i_deg, theta_v_deg, value, &optics);
    exact_evaluate(&at, &exact);
    struct reflectance_geometry g;
    struct reflectance_parts parts;
    double l1, l2;
    assert_int_equal(reflectance_geometry(&g, theta_i_deg, theta_v_deg, NULL), 0);
    assert_int_equal(reflectance_eval_parts(REFLECTANCE_COMPOSITE, &g, value, &optics, &parts, NULL), 0);
    reflectance_diffuse_factors(&g, value[MATERIAL_SIGMA], &l1, &l2);
    assert_close(g.phi_rad, exact.phi_rad, 4e-15 * exact.phi_rad, "phi", theta_i_deg, theta_v_deg, set);
    assert_close(g.visibility, exact.visibility, 4e-15 * exact.visibility, "G/(cos cos)", theta_i_deg,
                 theta_v_deg, set);
    assert_close(l1, exact.l1, 4e-15 * exact.l1_terms, "L1", theta_i_deg, theta_v_deg, set);
    assert_close(l2, exact.l2, 4e-15 * exact.l2, "L2", theta_i_deg, theta_v_deg, set);
    double s = value[MATERIAL_S];
    assert_close(parts.diffuse, s * exact.l1, 4e-15 * s * exact.l1_terms, "diffuse", theta_i_deg, theta_v_deg,
                 set);
    if (exact.log_d[0] > -700) {
        double lobe = 2e-15 * (1 + 2 * fabs(exact.log_d[0])) + 8e-15; /* D, then F and G/(cos cos) */
        assert_close(parts.specular, exact.specular[0], lobe * exact.specular[0], "specular", theta_i_deg,
                     theta_v_deg, set);
    }
}

/* F and D apart: a lobe much wider than any angle has D = 1, and F G/(cos cos) / visibility is F. */
static void check_factors(double theta_i_deg, double theta_v_deg, size_t set) {
    double value[MATERIAL_PARAMETERS];
    value_of(sets[set], value);
    struct exact_values exact;
    struct exact_case at = exact_in_plane(REFLECTANCE_COMPOSITE, theta_i_deg, theta_v_deg, value, &optics);
    exact_evaluate(&at, &exact);
    struct reflectance_geometry g;
    struct reflectance_parts with_lobe, without;
    assert_int_equal(reflectance_geometry(&g, theta_i_deg, theta_v_deg, NULL), 0);
    g.visibility = 1;
    value[MATERIAL_BETA_PRIME] = 1;
    assert_int_equal(reflectance_eval_parts(REFLECTANCE_EQ1, &g, value, &optics, &with_lobe, NULL), 0);
    value[MATERIAL_GAMMA] = 1e30;
    assert_int_equal(reflectance_eval_parts(REFLECTANCE_EQ1, &g, value, &optics, &without, NULL), 0);
    assert_close(without.specular, exact.fresnel, 4e-15 * exact.fresnel, "F", theta_i_deg, theta_v_deg, set);
    if (exact.log_d[0] > -600) { /* above the denormal numbers even times F of n - 1 = 1e-12 */
        assert_close(with_lobe.specular / without.specular, exact.lobe[0],
                     (2e-15 * (1 + 2 * fabs(exact.log_d[0])) + 4e-16) * exact.lobe[0], "D", theta_i_deg,
                     theta_v_deg, set);
    }
}

static void check_slopes(double theta_i_deg, double theta_v_deg, size_t set) {
    double value[MATERIAL_PARAMETERS];
    value_of(sets[set], value);
    struct exact_slopes slopes;
    struct exact_case at = exact_in_plane(REFLECTANCE_COMPOSITE, theta_i_deg, theta_v_deg, value, &optics);
    exact_differentiate(&at, &slopes);
    struct reflectance_geometry g;
    double beta, gradient[COLUMNS];
    assert_int_equal(reflectance_geometry(&g, theta_i_deg, theta_v_deg, NULL), 0);
    assert_int_equal(reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, &optics, &beta, gradient, NULL),
                     0);
    for (int j = 0; j < COLUMNS; j++) {
        assert_close(gradient[j], slopes.beta[j], 1e-13 * slopes.terms[j] + EXACT_DENORMAL, slope_name[j],
                     theta_i_deg, theta_v_deg, set);
    }
}

static void values_match_mpfr(void **state) {
    (void)state;
    each_case(check_values, 1);
    each_case(check_factors, 1);
}

static void slopes_match_mpfr(void **state) {
    (void)state;
    each_case(check_slopes, 3); /* 3 is prime to the number of sets: all of them are met */
}

static void check_reciprocity(double theta_i_deg, double theta_v_deg, size_t set) {
    double value[MATERIAL_PARAMETERS], beta[2], gradient[2 * COLUMNS];
    value_of(sets[set], value);
    struct reflectance_geometry g[2];
    assert_int_equal(reflectance_geometry(&g[0], theta_i_deg, theta_v_deg, NULL), 0);
    assert_int_equal(reflectance_geometry(&g[1], fabs(theta_v_deg), copysign(theta_i_deg, theta_v_deg), NULL),
                     0);
    assert_int_equal(reflectance_eval(REFLECTANCE_COMPOSITE, 2, g, value, &optics, beta, gradient, NULL), 0);
    assert_memory_equal(&beta[0], &beta[1], sizeof *beta);
    assert_memory_equal(gradient, gradient + COLUMNS, COLUMNS * sizeof *gradient);
}

static void source_and_sensor_may_change_places(void **state) {
    (void)state;
    each_case(check_reciprocity, 1);
    struct reflectance_geometry g[2];
    for (int i = 0; i < 900; i++) { /* angles with no short binary form */
        double a = 0.1 * i, b = 89.9 - 0.0973 * i;
        assert_int_equal(reflectance_geometry(&g[0], a, b, NULL), 0);
        assert_int_equal(reflectance_geometry(&g[1], b, a, NULL), 0);
        assert_memory_equal(&g[0], &g[1], sizeof g[0]);
        assert_int_equal(reflectance_geometry(&g[0], a, -b, NULL), 0);
        assert_int_equal(reflectance_geometry(&g[1], b, -a, NULL), 0);
        assert_memory_equal(&g[0], &g[1], sizeof g[0]);
    }
}

static double beta_at(enum reflectance_model model, double theta_i_deg, double theta_v_deg,
                      const double *value) {
    struct reflectance_geometry g;
    double beta;
    assert_int_equal(reflectance_geometry(&g, theta_i_deg, theta_v_deg, NULL), 0);
    assert_int_equal(reflectance_eval(model, 1, &g, value, &plain, &beta, NULL, NULL), 0);
    return beta;
}

static void limits_are_reached(void **state) {
    (void)state;
    double value[MATERIAL_PARAMETERS] = {0.25, 1e-170, 1e-170, 0, 1.5};
    /* smooth facets without gloss: Lambert, whatever the geometry */
    for (double theta_v = -89; theta_v <= 89; theta_v += 1) {
        assert_true(beta_at(REFLECTANCE_COMPOSITE, 40, theta_v, value) == 0.25);
        assert_true(beta_at(REFLECTANCE_LAMBERT, 40, theta_v, value) == 0.25);
    }
    /* Fresnel at normal incidence on the facet: ((n - 1) / (n + 1))^2, D = 1, G = 1 */
    value[MATERIAL_BETA_PRIME] = 100;
    assert_float_equal(beta_at(REFLECTANCE_EQ1, 0, 0, value), 0.25 + 100 * 0.04, 1e-13);
    /* a lobe far narrower than the distance from the mirror direction is silent, not NaN */
    assert_true(beta_at(REFLECTANCE_EQ1, 30, 31, value) == 0.25);
    /* half width at half maximum: phi = gamma, theta_Q = 0 in retro direction */
    value[MATERIAL_GAMMA] = 20 * M_PI / 180;
    assert_float_equal(beta_at(REFLECTANCE_EQ1, 20, -20, value),
                       0.25 + 100 * 0.04 / 2 / (cos(M_PI / 9) * cos(M_PI / 9)), 1e-12);
    /* forward grazing: sigma's term tends to -0.45 * 6 / pi * k, not to infinity times zero */
    value[MATERIAL_BETA_PRIME] = 0;
    value[MATERIAL_SIGMA] = 0.3;
    double grazing = 90 - 1e-12;
    double expected = 1 - 0.5 * 0.09 / 0.42 - 0.5 * 0.45 * 6 / M_PI;
    struct reflectance_geometry g;
    struct reflectance_parts parts;
    assert_int_equal(reflectance_geometry(&g, grazing, grazing, NULL), 0);
    assert_int_equal(reflectance_eval_parts(REFLECTANCE_COMPOSITE, &g, value, &plain, &parts, NULL), 0);
    assert_float_equal(parts.diffuse, 0.25 * expected, 1e-9);
}

static void models_nest_in_the_composite(void **state) {
    (void)state;
    double value[MATERIAL_PARAMETERS] = {0.2, 0.3, 0.07, 7.6, 1.7};
    struct reflectance_geometry g;
    assert_int_equal(reflectance_geometry(&g, 50, 42, NULL), 0);
    double full, diffuse, eq1, full_row[5], diffuse_row[2], eq1_row[4];
    assert_int_equal(reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, &doubled, &full, full_row, NULL),
                     0);
    assert_int_equal(
        reflectance_eval(REFLECTANCE_OREN_NAYAR, 1, &g, value, &doubled, &diffuse, diffuse_row, NULL), 0);
    assert_int_equal(reflectance_eval(REFLECTANCE_EQ1, 1, &g, value, &doubled, &eq1, eq1_row, NULL), 0);
    assert_float_equal(full, diffuse + eq1 - value[MATERIAL_S], 1e-15);
    assert_true(diffuse_row[0] == full_row[0] && diffuse_row[1] == full_row[1]);
    assert_true(eq1_row[1] == full_row[2] && eq1_row[2] == full_row[3] && eq1_row[3] == full_row[4]);
    for (int m = 0; m < REFLECTANCE_MODELS; m++) {
        enum reflectance_model found;
        assert_int_equal(reflectance_find(reflectance_name((enum reflectance_model)m), &found, NULL), 0);
        assert_int_equal(found, m);
    }
    struct err e = {0};
    enum reflectance_model found;
    assert_int_equal(reflectance_find("phong", &found, &e), -ERR_USAGE);
    assert_non_null(strstr(e.text, "phong"));
}

static void outside_the_domain_is_an_error(void **state) {
    (void)state;
    static const double wrong_angles[][2] = {{90, 0},  {-1e-9, 0}, {NAN, 0},     {0, NAN},
                                             {10, 90}, {10, -90},  {INFINITY, 1}};
    struct reflectance_geometry g, untouched;
    memset(&g, 0x5a, sizeof g);
    untouched = g;
    for (size_t i = 0; i < COUNT(wrong_angles); i++) {
        struct err e = {0};
        assert_int_equal(reflectance_geometry(&g, wrong_angles[i][0], wrong_angles[i][1], &e), -ERR_RANGE);
        assert_memory_equal(&g, &untouched, sizeof g);
        assert_true(strlen(e.text) > 20);
    }
    static const double wrong[][COLUMNS] = {{-0.1, 0.3, 0.1, 1, 1.5},     {0.1, 0, 0.1, 1, 1.5},
                                            {0.1, 0.3, 0, 1, 1.5},        {0.1, 0.3, 0.1, -1, 1.5},
                                            {0.1, 0.3, 0.1, 1, 1},        {NAN, 0.3, 0.1, 1, 1.5},
                                            {0.1, 0.3, INFINITY, 1, 1.5}, {0.1, 0.3, 0.1, 1, NAN}};
    assert_int_equal(reflectance_geometry(&g, 30, 30, NULL), 0);
    for (size_t i = 0; i < COUNT(wrong); i++) {
        double value[MATERIAL_PARAMETERS], beta = 7;
        value_of(wrong[i], value);
        assert_int_equal(reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, &plain, &beta, NULL, NULL),
                         -ERR_RANGE);
        assert_true(beta == 7);
    }
    double value[MATERIAL_PARAMETERS] = {0.1, 0, 0, 0, 0}, beta = 7;
    assert_int_equal(reflectance_eval(REFLECTANCE_LAMBERT, 1, &g, value,
                                      &(struct reflectance_optics){.kappa = 1, .q = NAN}, &beta, NULL, NULL),
                     -ERR_RANGE);
    assert_int_equal(reflectance_eval(REFLECTANCE_LAMBERT, 1, &g, value, &plain, &beta, NULL, NULL), 0);
}

static void extreme_parameters_give_no_nan(void **state) {
    (void)state;
    static const double extreme[] = {1e-300, 1e-160, 1e-8, 1, 1e8, 1e50};
    struct reflectance_geometry g[4];
    static const double at[][2] = {{0, 0}, {60, 60}, {60, -60}, {90 - 1e-12, 90 - 1e-12}};
    for (size_t i = 0; i < COUNT(at); i++) {
        assert_int_equal(reflectance_geometry(&g[i], at[i][0], at[i][1], NULL), 0);
    }
    for (int code = 0; code < 7776; code++) { /* 6^5 combinations */
        double value[MATERIAL_PARAMETERS] = {0}, beta[4], gradient[20];
        for (int j = 0, rest = code; j < COLUMNS; j++, rest /= 6) {
            value[j] = extreme[rest % 6];
        }
        value[MATERIAL_N] = fmin(1 + value[MATERIAL_N], 1e50);
        int status = reflectance_eval(REFLECTANCE_COMPOSITE, 4, g, value, &plain, beta, gradient, NULL);
        if (value[MATERIAL_N] == 1) {
            assert_int_equal(status, -ERR_RANGE);
            continue;
        }
        assert_int_equal(status, 0);
        for (int i = 0; i < 20; i++) {
            assert_false(isnan(gradient[i]) || isnan(beta[i / 5]));
        }
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_match_mpfr),
        cmocka_unit_test(slopes_match_mpfr),
        cmocka_unit_test(source_and_sensor_may_change_places),
        cmocka_unit_test(limits_are_reached),
        cmocka_unit_test(models_nest_in_the_composite),
        cmocka_unit_test(outside_the_domain_is_an_error),
        cmocka_unit_test(extreme_parameters_give_no_nan),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
