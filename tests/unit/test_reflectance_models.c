#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "tests/support/exact_model.h"

#define COUNT(array) (sizeof(array) / sizeof *(array))

static const double angles_deg[] = {0, 1e-9, 1e-3, 1, 20, 45.1, 60, 75, 88, 89.999, 90 - 1e-6, 90 - 1e-9};
static const double turns_deg[] = {0, 1e-6, 1e-3, 1, 45, 89.9, 90, 135, 179, 180 - 1e-3, 180 - 1e-6, 180};
/* reflection-model.md 2.3, then the extremes of rendering.md 4.4; the extras follow by model */
static const double sets[][5] = {{0.1, 0.35, 0.05, 126, 1.4},     {0.3, 0.01, 0.01, 1, 1 + 1e-8},
                                 {1.2, 0.5, 0.2, 15.7, 1.3},      {0.01, 1e-4, 0.002, 1.6, 2.42},
                                 {0, 1e-8, 1e-6, 1e6, 1 + 1e-12}, {1, 1e8, 1e3, 1e12, 10},
                                 {1.5, 1, 1, 1e-12, 1.0001},      {0.2, 0.3, 1e-3, 0, 2.42}};
static const double extras[REFLECTANCE_MODELS][5][2] = {
    [REFLECTANCE_HEAVY_TAIL] = {{0}, {1e-12}, {0.3}, {1}, {2}},
    [REFLECTANCE_TRANSMITTED] = {{1 + 1e-8}, {1.01}, {1.5}, {3}, {1 + 1e-12}},
    [REFLECTANCE_TWO_LOBE] = {{0.3, 0.5}, {0.02, 40}, {1, 0}, {1e3, 1e-12}, {1e-3, 1e6}},
};
static const double polarisations[] = {0, 0.1, -1, 1};

static struct exact_case at;
static struct reflectance_optics optics;

static void assert_close(double got, double expected, double tolerance, const char *what) {
    if (!(fabs(got - expected) <= tolerance)) {
        fail_msg(
            "%s, %s at %.17g, %.17g, %.17g deg, S %g sigma %g gamma %g beta' %g n - 1 %g extras %g %g, P %g: "
            "%.17g, exactly %.17g, apart %.3g, allowed %.3g",
            reflectance_name(at.model), what, at.theta_i_deg, at.theta_r_deg, at.dphi_deg, at.value[0],
            at.value[1], at.value[2], at.value[3], at.value[4] - 1, at.value[5], at.value[6], at.polarisation,
            got, expected, fabs(got - expected), tolerance);
    }
}

static void set_case(enum reflectance_model model, size_t count) {
    size_t extra = count % 5;
    optics = (struct reflectance_optics){.kappa = 1.3, .q = 1.7, .polarisation = polarisations[count % 4]};
    at = (struct exact_case){
        .model = model, .kappa_q = optics.kappa * optics.q, .polarisation = optics.polarisation};
    memcpy(at.value, sets[count % COUNT(sets)], sizeof sets[0]);
    at.value[MATERIAL_EXTRA_1] = extras[model][extra][0];
    at.value[MATERIAL_EXTRA_2] = extras[model][extra][1];
}

/* Every stride-th of all pairs of angles, turns, sets and models. */
static void each_case(void (*check)(void), size_t stride) {
    static const enum reflectance_model models[] = {REFLECTANCE_COMPOSITE, REFLECTANCE_HEAVY_TAIL,
                                                    REFLECTANCE_TRANSMITTED, REFLECTANCE_TWO_LOBE};
    const size_t n_angles = COUNT(angles_deg), n_turns = COUNT(turns_deg);
    const size_t all = n_angles * n_angles * n_turns * COUNT(models) * 40; /* 40: sets and extras */
    for (size_t i = 0; i < all; i += stride) {
        size_t geometry = i / (40 * COUNT(models));
        set_case(models[i / 40 % COUNT(models)], i % 40);
        at.theta_i_deg = angles_deg[geometry % n_angles];
        at.theta_r_deg = angles_deg[geometry / n_angles % n_angles];
        at.dphi_deg = turns_deg[geometry / (n_angles * n_angles)];
        check();
    }
    exact_free_caches();
}

static struct reflectance_geometry geometry_of_case(void) {
    struct reflectance_geometry g;
    assert_int_equal(reflectance_geometry_general(&g, at.theta_i_deg, at.theta_r_deg, at.dphi_deg, NULL), 0);
    return g;
}

static double lobe_tolerance(const struct exact_values *exact) {
    double sum = EXACT_DENORMAL;
    for (int i = 0; i < 2; i++) { /* D, then F and G/(cos cos) */
        sum += (2e-15 * (1 + 2 * fabs(exact->log_d[i])) + 8e-15) * exact->specular[i] * exact->unpolarised;
    }
    return sum;
}

static void check_values(void) {
    struct exact_values exact;
    struct reflectance_geometry g = geometry_of_case();
    struct reflectance_parts parts;
    double by_polarisation, s = at.value[MATERIAL_S], diffuse;
    exact_evaluate(&at, &exact);
    diffuse = s * exact.transmission;
    assert_int_equal(reflectance_eval_parts(at.model, &g, at.value, &optics, &parts, NULL), 0);
    assert_int_equal(reflectance_polarisation_slope(at.model, 1, &g, at.value, &by_polarisation, NULL), 0);
    assert_close(g.phi_rad, exact.phi_rad, 4e-15 * exact.phi_rad, "phi");
    assert_close(g.visibility, exact.visibility, 4e-15 * exact.visibility, "G/(cos cos)");
    assert_close(parts.diffuse, diffuse * exact.l1, 8e-15 * diffuse * exact.l1_terms, "diffuse");
    double interreflection = diffuse * s * at.kappa_q * exact.l2;
    assert_close(parts.interreflection, interreflection, 8e-15 * interreflection, "interreflection");
    assert_close(parts.specular, exact.specular[0] + exact.specular[1], lobe_tolerance(&exact), "specular");
    if (exact.fresnel > 0) {
        double share = fabs(exact.by_polarisation) / (exact.specular[0] + exact.specular[1] + EXACT_DENORMAL);
        assert_close(by_polarisation, exact.by_polarisation, lobe_tolerance(&exact) * (1 + share), "d/dP");
    }
}

static void check_slopes(void) {
    struct exact_slopes exact;
    struct reflectance_geometry g = geometry_of_case();
    double beta, gradient[MATERIAL_PARAMETERS];
    exact_differentiate(&at, &exact);
    assert_int_equal(reflectance_eval(at.model, 1, &g, at.value, &optics, &beta, gradient, NULL), 0);
    for (int j = 0; j < reflectance_parameters(at.model); j++) {
        enum material_parameter p = reflectance_parameter(at.model, j);
        assert_close(gradient[j], exact.beta[p], 1e-13 * exact.terms[p] + EXACT_DENORMAL,
                     material_parameter_name(reflectance_name(at.model), (int)p));
    }
}

static void values_match_mpfr(void **state) {
    (void)state;
    each_case(check_values, 13); /* prime to all counts: every pair of values is met */
}

static void slopes_match_mpfr(void **state) {
    (void)state;
    each_case(check_slopes, 307);
}

static void check_symmetry(void) {
    struct reflectance_geometry g = geometry_of_case(), exchanged, other_way, in_plane;
    assert_int_equal(
        reflectance_geometry_general(&exchanged, at.theta_r_deg, at.theta_i_deg, -at.dphi_deg, NULL), 0);
    assert_memory_equal(&g, &exchanged, sizeof g);
    if (at.dphi_deg == 0 || at.dphi_deg == 180) {
        double side = at.dphi_deg == 0 ? -1 : 1;
        assert_int_equal(reflectance_geometry(&in_plane, at.theta_i_deg, side * at.theta_r_deg, NULL), 0);
        assert_memory_equal(&g, &in_plane, sizeof g);
        assert_int_equal(
            reflectance_geometry_general(&other_way, at.theta_i_deg, at.theta_r_deg, 360 - at.dphi_deg, NULL),
            0);
        assert_memory_equal(&g, &other_way, sizeof g);
    }
}

static void source_and_sensor_may_change_places_anywhere(void **state) {
    (void)state;
    each_case(check_symmetry, 7);
}

/* A tail of 0 is the Gaussian, an interface of index 1 is none, a lobe of height 0 is none. */
static void relatives_nest_the_composite(void **state) {
    (void)state;
    static const struct {
        enum reflectance_model model;
        double extra[2];
    } relatives[] = {
        {REFLECTANCE_HEAVY_TAIL, {0}}, {REFLECTANCE_TRANSMITTED, {1}}, {REFLECTANCE_TWO_LOBE, {0.3, 0}}};
    static const struct reflectance_optics plain = {.kappa = 1, .q = 1};
    for (size_t i = 0; i < COUNT(relatives); i++) {
        double value[MATERIAL_PARAMETERS] = {
            0.2, 0.3, 0.07, 7.6, 1.7, relatives[i].extra[0], relatives[i].extra[1]};
        for (double theta_v = -85; theta_v <= 85; theta_v += 5) {
            struct reflectance_geometry g;
            double beta[2], gradient[2][MATERIAL_PARAMETERS];
            reflectance_geometry(&g, 50, theta_v, NULL);
            reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, &plain, &beta[0], gradient[0], NULL);
            reflectance_eval(relatives[i].model, 1, &g, value, &plain, &beta[1], gradient[1], NULL);
            assert_float_equal(beta[1], beta[0], 4e-15 * beta[0]);
            for (int j = 0; j < 5; j++) {
                assert_float_equal(gradient[1][j], gradient[0][j],
                                   1e-14 * (1e-300 + fabs(gradient[0][j])) * 1e2);
            }
        }
    }
}

/* Light that vibrates in the plane of incidence is not reflected at the angle of Brewster: tan theta_Q = n. */
static void brewster_leaves_one_polarisation(void **state) {
    (void)state;
    static const struct reflectance_optics parallel = {.kappa = 1, .q = 1, .polarisation = -1};
    double value[MATERIAL_PARAMETERS] = {0, 0.3, 0.05, 100, 1.5}, beta, brewster_deg = atan(1.5) * 180 / M_PI;
    struct reflectance_geometry g;
    reflectance_geometry(&g, brewster_deg, brewster_deg, NULL);
    reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, &parallel, &beta, NULL, NULL);
    assert_float_equal(beta, 0, 1e-20);
    reflectance_geometry(&g, 0, 0, NULL); /* at normal incidence there is no plane: P is of no account */
    double slope;
    reflectance_polarisation_slope(REFLECTANCE_COMPOSITE, 1, &g, value, &slope, NULL);
    assert_true(slope == 0);
}

static void outside_the_domain_is_an_error(void **state) {
    (void)state;
    static const double wrong_directions[][3] = {{90, 0, 0},    {0, 90, 0},  {-1, 0, 0},    {10, -1, 0},
                                                 {10, 10, 361}, {NAN, 0, 0}, {10, 10, NAN}, {10, 120, 0}};
    struct reflectance_geometry g;
    struct err e = {0};
    for (size_t i = 0; i < COUNT(wrong_directions); i++) {
        const double *w = wrong_directions[i];
        assert_int_equal(reflectance_geometry_general(&g, w[0], w[1], w[2], &e), -ERR_RANGE);
    }
    static const struct {
        enum reflectance_model model;
        double extra[2];
    } wrong[] = {{REFLECTANCE_HEAVY_TAIL, {-1e-9}},     {REFLECTANCE_HEAVY_TAIL, {2.1}},
                 {REFLECTANCE_HEAVY_TAIL, {NAN}},       {REFLECTANCE_TRANSMITTED, {0.99}},
                 {REFLECTANCE_TRANSMITTED, {INFINITY}}, {REFLECTANCE_TWO_LOBE, {0, 1}},
                 {REFLECTANCE_TWO_LOBE, {0.1, -1}},     {REFLECTANCE_TWO_LOBE, {0.1, NAN}}};
    static const struct reflectance_optics plain = {.kappa = 1, .q = 1},
                                           wild = {.kappa = 1, .q = 1, .polarisation = 1.1};
    reflectance_geometry_general(&g, 30, 40, 50, NULL);
    double beta = 7;
    for (size_t i = 0; i < COUNT(wrong); i++) {
        double value[MATERIAL_PARAMETERS] = {0.2, 0.3, 0.07, 7.6, 1.7, wrong[i].extra[0], wrong[i].extra[1]};
        assert_int_equal(reflectance_eval(wrong[i].model, 1, &g, value, &plain, &beta, NULL, NULL),
                         -ERR_RANGE);
    }
    double value[MATERIAL_PARAMETERS] = {0.2, 0.3, 0.07, 7.6, 1.7};
    assert_int_equal(reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, &wild, &beta, NULL, NULL),
                     -ERR_RANGE);
    assert_true(beta == 7);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_match_mpfr),
        cmocka_unit_test(slopes_match_mpfr),
        cmocka_unit_test(source_and_sensor_may_change_places_anywhere),
        cmocka_unit_test(relatives_nest_the_composite),
        cmocka_unit_test(brewster_leaves_one_polarisation),
        cmocka_unit_test(outside_the_domain_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
