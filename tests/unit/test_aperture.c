#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "fit/aperture.h"
#include "fit/estimate.h"
#include "tests/support/goniometry.h"

#define FINE 100 /* shares of each width in the test's own integral, by midpoints */
#define PER_DEG (M_PI / 180)
#define OPTICS(q_) (&(const struct reflectance_optics){.kappa = 1, .q = (q_)})

static double exact(const double *value, double theta_i_deg, double theta_v_deg) {
    struct reflectance_geometry g;
    double beta, side = theta_i_deg < 0 ? -1 : 1;
    assert_int_equal(reflectance_geometry(&g, side * theta_i_deg, side * theta_v_deg, NULL), 0);
    assert_int_equal(reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, OPTICS(1.4), &beta, NULL, NULL),
                     0);
    return beta;
}

/* Light that arrives from one direction after another and leaves towards one after another. */
static double brute_force(const struct aperture_form *form, const double *value, double theta_i_deg,
                          double theta_v_deg) {
    double light = 0, white = 0;
    for (int a = 0; a < FINE; a++) {
        double i_deg = theta_i_deg + form->source_width_deg * ((a + 0.5) / FINE - 0.5);
        for (int b = 0; b < FINE && fabs(i_deg) < 90; b++) {
            double v_deg = theta_v_deg + form->sensor_width_deg * ((b + 0.5) / FINE - 0.5);
            if (fabs(v_deg) < 90) {
                double share = cos((form->beam_in_view ? v_deg : i_deg) * PER_DEG);
                light += share * exact(value, i_deg, v_deg);
                white += share;
            }
        }
    }
    return light / white;
}

static double seen(const struct aperture_form *form, const double *value, double theta_i_deg,
                   double theta_v_deg) {
    struct aperture a;
    double beta;
    assert_int_equal(aperture_init(&a, form, 1, &theta_i_deg, &theta_v_deg, NULL), 0);
    assert_int_equal(aperture_eval(&a, 0, 1, REFLECTANCE_COMPOSITE, value, OPTICS(1.4), &beta, NULL, NULL),
                     0);
    aperture_free(&a);
    return beta;
}

static const double places[][2] = {{40, 40},  {40, 38.5}, {40, -40}, {60, 57},  {60, 72},   {0, 0},
                                   {0, 3},    {0.2, 1},   {0.2, -5}, {30, 0.3}, {10, 80},   {60, -80},
                                   {55, -55}, {20, 22},   {75, 70},  {70, 80},  {89.8, 20}, {30, 89.7}};
#define PLACES (sizeof places / sizeof *places)

static void check(double source_deg, double sensor_deg, bool beam_in_view) {
    const struct aperture_form form = {source_deg, sensor_deg, beam_in_view};
    double worst = 0, at_retro = 0;
    for (int set = 0; set < GONIOMETRY_SETS; set++) {
        for (size_t k = 0; k < PLACES; k++) {
            const double *at = places[k];
            double whole = brute_force(&form, goniometry_set[set], at[0], at[1]);
            double error = fabs(seen(&form, goniometry_set[set], at[0], at[1]) / whole - 1);
            bool retro = at[0] == -at[1] && at[0] > 0;
            *(retro ? &at_retro : &worst) = fmax(retro ? at_retro : worst, error);
        }
    }
    print_message("# widths %g and %g deg: worst %.1e of the value, %.1e at retro\n", source_deg, sensor_deg,
                  worst, at_retro);
    assert_true(worst < 3e-5);
    assert_true(at_retro < 1e-4); /* Oren and Nayar's term has an edge there */
}

static void it_is_the_integral_over_both_widths(void **state) {
    (void)state;
    check(1, 1, false);
    check(1, 1, true);
    check(0, 2, false);
    check(2, 0.5, false);
    check(4, 3, true);
}

struct direction {
    double x, y, z;
};

static struct direction direction_at(double theta_deg, double azimuth_deg) {
    const double s = sin(theta_deg * PER_DEG);
    return (struct direction){s * cos(azimuth_deg * PER_DEG), s * sin(azimuth_deg * PER_DEG),
                              cos(theta_deg * PER_DEG)};
}

static double general(const double *value, struct direction l, struct direction v) {
    struct reflectance_geometry g;
    double beta, between = atan2(l.x * v.y - l.y * v.x, l.x * v.x + l.y * v.y);
    assert_int_equal(
        reflectance_geometry_general(&g, acos(l.z) / PER_DEG, acos(v.z) / PER_DEG, between / PER_DEG, NULL),
        0);
    assert_int_equal(reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, OPTICS(1.4), &beta, NULL, NULL),
                     0);
    return beta;
}

/* As brute_force, of vectors: each direction turns in the plane through itself and the normal. */
static double brute_force_across(const struct aperture_form *form, const double *value, const double *at) {
    double light = 0, white = 0;
    for (int a = 0; a < FINE; a++) {
        const double i_deg = at[0] + form->source_width_deg * ((a + 0.5) / FINE - 0.5);
        for (int b = 0; b < FINE && fabs(i_deg) < 90; b++) {
            const double r_deg = at[1] + form->sensor_width_deg * ((b + 0.5) / FINE - 0.5);
            if (fabs(r_deg) < 90) {
                const double share = cos((form->beam_in_view ? r_deg : i_deg) * PER_DEG);
                light += share * general(value, direction_at(i_deg, 0), direction_at(r_deg, at[2]));
                white += share;
            }
        }
    }
    return light / white;
}

static double seen_across(const struct aperture_form *form, const double *value, const double *at) {
    struct aperture a;
    double beta;
    assert_int_equal(aperture_init(&a, form, 1, &at[0], &at[1], NULL), 0);
    assert_int_equal(aperture_direct(&a, 0, at[0], at[1], at[2], NULL), 0);
    aperture_refill(&a);
    assert_int_equal(aperture_eval(&a, 0, 1, REFLECTANCE_COMPOSITE, value, OPTICS(1.4), &beta, NULL, NULL),
                     0);
    aperture_free(&a);
    return beta;
}

/* theta_i, theta_r, azimuth between them: near the mirror direction, past the normal, beyond 90 deg. */
static void it_is_the_integral_out_of_plane_too(void **state) {
    (void)state;
    static const double across[][3] = {{40, 40, 175}, {40, 37, 170},  {60, 57, 176},  {30, 50, 90},
                                       {0.2, 1, 120}, {1, 0.3, 60},   {30, 0.3, 150}, {0.4, 0.3, -30},
                                       {70, 80, 178}, {55, 55, -165}, {30, 89.7, 45}, {89.8, 20, 100}};
    const struct aperture_form forms[] = {{1, 1, false}, {2, 0.5, true}, {0, 2, false}, {4, 3, true}};
    double worst = 0;
    for (size_t k = 0; k < sizeof across / sizeof *across; k++) {
        for (size_t f = 0; f < sizeof forms / sizeof *forms; f++) {
            for (int set = 0; set < GONIOMETRY_SETS; set++) {
                const double whole = brute_force_across(&forms[f], goniometry_set[set], across[k]);
                worst = fmax(worst, fabs(seen_across(&forms[f], goniometry_set[set], across[k]) / whole - 1));
            }
        }
    }
    print_message("# out of plane: worst %.1e of the value\n", worst);
    assert_true(worst < 3e-5);
    for (int side = -1; side <= 1; side += 2) { /* where the azimuth says so it is the plane of incidence */
        const double at[] = {40, 38, side > 0 ? 180 : 0};
        assert_float_equal(seen_across(&forms[0], goniometry_set[0], at) /
                               seen(&forms[0], goniometry_set[0], 40, side * 38),
                           1, 1e-13);
    }
}

static void without_widths_it_is_the_model_to_the_bit(void **state) {
    (void)state;
    struct goniometry m;
    struct aperture a;
    struct reflectance_parts parts, plain_parts;
    struct reflectance_batch batch;
    double beta[GONIOMETRY_MAX], gradient[GONIOMETRY_MAX * 5], plain, row[5], alone, alone_row[5];
    double wide[REFLECTANCE_BATCH_LANES], wide_slope[5 * REFLECTANCE_BATCH_LANES];
    double memory[2 * REFLECTANCE_BATCH_LANES * REFLECTANCE_BATCH_COLUMNS];
    const double *value = goniometry_set[1];
    goniometry_make(&m, value, 60, 5);
    assert_true(reflectance_batch_size(1) <= sizeof memory / sizeof *memory);
    assert_int_equal(
        aperture_init(&a, &(struct aperture_form){0}, m.input.n, m.theta_i_deg, m.theta_v_deg, NULL), 0);
    aperture_eval(&a, 10, m.input.n - 10, REFLECTANCE_COMPOSITE, value, OPTICS(1.3), beta, gradient, NULL);
    for (size_t i = 10; i < m.input.n; i++) {
        struct reflectance_geometry g;
        reflectance_geometry(&g, m.theta_i_deg[i], m.theta_v_deg[i], NULL);
        reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, OPTICS(1.3), &plain, row, NULL);
        reflectance_batch_fill(&batch, 1, &g, memory);
        reflectance_batch_eval(&batch, 0, 1, REFLECTANCE_COMPOSITE, value, OPTICS(1.3), wide, wide_slope,
                               REFLECTANCE_BATCH_LANES, NULL);
        assert_memory_equal(&wide[0], &beta[i - 10], sizeof wide[0]);
        for (size_t j = 0; j < 5; j++) {
            assert_memory_equal(&wide_slope[j * REFLECTANCE_BATCH_LANES], &gradient[(i - 10) * 5 + j],
                                sizeof wide_slope[0]);
        }
        aperture_parts(&a, i, REFLECTANCE_COMPOSITE, value, OPTICS(1.3), &parts, NULL);
        reflectance_eval_parts(REFLECTANCE_COMPOSITE, &g, value, OPTICS(1.3), &plain_parts, NULL);
        assert_memory_equal(&parts, &plain_parts, sizeof parts);
        aperture_at(&a.form, m.theta_i_deg[i], m.theta_v_deg[i], REFLECTANCE_COMPOSITE, value, OPTICS(1.3),
                    &alone, alone_row, NULL);
        assert_memory_equal(&plain, &alone, sizeof plain);
        assert_memory_equal(row, alone_row, sizeof row);
    }
    aperture_free(&a);
}

/* Light may go the other way: source and sensor, and with them the spots, change places. */
static void exchange_of_source_and_sensor_changes_nothing(void **state) {
    (void)state;
    const struct aperture_form form = {1, 2.5, false}, back = {2.5, 1, true};
    for (size_t k = 0; k < PLACES; k++) {
        double i_deg = places[k][0], v_deg = places[k][1], side = v_deg < 0 ? -1 : 1;
        double there = seen(&form, goniometry_set[0], i_deg, v_deg);
        assert_float_equal(seen(&back, goniometry_set[0], fabs(v_deg), side * i_deg) / there, 1, 1e-12);
    }
}

/* One call for a set, one for a single geometry, and the sum of the parts tell the same; slopes are slopes. */
static void all_ways_to_ask_agree(void **state) {
    (void)state;
    const struct aperture_form form = {1.5, 0.7, false};
    double value[MATERIAL_PARAMETERS], i_deg[PLACES], v_deg[PLACES], beta[PLACES], gradient[PLACES * 5];
    struct aperture a;
    memcpy(value, goniometry_set[3], sizeof value);
    for (size_t k = 0; k < PLACES; k++) {
        i_deg[k] = places[k][0];
        v_deg[k] = places[k][1];
    }
    assert_int_equal(aperture_init(&a, &form, PLACES, i_deg, v_deg, NULL), 0);
    aperture_eval(&a, 0, PLACES, REFLECTANCE_COMPOSITE, value, OPTICS(1.4), beta, gradient, NULL);
    for (size_t k = 0; k < PLACES; k++) {
        struct reflectance_parts parts;
        double alone;
        aperture_parts(&a, k, REFLECTANCE_COMPOSITE, value, OPTICS(1.4), &parts, NULL);
        assert_float_equal((parts.diffuse + parts.interreflection + parts.specular) / beta[k], 1, 1e-14);
        aperture_at(&form, i_deg[k], v_deg[k], REFLECTANCE_COMPOSITE, value, OPTICS(1.4), &alone, NULL, NULL);
        assert_float_equal(alone / beta[k], 1, 1e-14);
        aperture_at(&form, -i_deg[k], -v_deg[k], REFLECTANCE_COMPOSITE, value, OPTICS(1.4), &alone, NULL,
                    NULL);
        assert_float_equal(alone / beta[k], 1, 1e-14);
        for (int j = 0; j < 5; j++) {
            double at = value[j], h = 1e-5 * at, up, down;
            value[j] = at + h;
            aperture_eval(&a, k, 1, REFLECTANCE_COMPOSITE, value, OPTICS(1.4), &up, NULL, NULL);
            value[j] = at - h;
            aperture_eval(&a, k, 1, REFLECTANCE_COMPOSITE, value, OPTICS(1.4), &down, NULL, NULL);
            value[j] = at;
            assert_float_equal((up - down) / (2 * h), gradient[5 * k + (size_t)j], 1e-6 * beta[k] / at);
        }
    }
    aperture_free(&a);
}

/* measurement.md 7: 1 deg and 1 deg, neglected, move gamma of the acrylic set by 0.34 %, 8 u, invisibly. */
static void a_neglected_width_moves_gamma_and_a_known_one_does_not(void **state) {
    (void)state;
    static struct goniometry m;
    const struct aperture_form form = {1, 1, false};
    struct estimate neglected, known;
    goniometry_make(&m, goniometry_set[0], 60, 5);
    for (size_t i = 0; i < m.input.n; i++) {
        m.beta[i] = brute_force(&form, goniometry_set[0], m.theta_i_deg[i], m.theta_v_deg[i]);
    }
    m.input.kappa = 1.4; /* stands for kappa q of the integral above */
    assert_int_equal(estimate_fit(&m.input, &neglected, NULL), 0);
    m.input.source_width_deg = m.input.sensor_width_deg = 1;
    assert_int_equal(estimate_fit(&m.input, &known, NULL), 0);
    const double gamma = goniometry_set[0][MATERIAL_GAMMA], u = sqrt(known.statistical[2][2]);
    const double moved = neglected.value[MATERIAL_GAMMA] - gamma, left = known.value[MATERIAL_GAMMA] - gamma;
    print_message("# gamma: neglected %+.3f %%, %.1f u, chi-square %.3g of %zu; known %+.1e, %.3f u\n",
                  100 * moved / gamma, moved / u, neglected.chi2, m.input.n, left / gamma, left / u);
    assert_float_equal(100 * moved / gamma, 0.34, 0.02);
    assert_true(moved > 7 * u && neglected.chi2 < 0.5 * (double)m.input.n);
    for (int j = 0; j < 5; j++) {
        assert_true(fabs(known.value[j] - m.value[j]) < 0.02 * sqrt(known.statistical[j][j]));
    }
    assert_float_equal(known.source_width_deg, 1, 0);
}

static void what_cannot_be_is_refused(void **state) {
    (void)state;
    struct aperture a;
    struct err e = {0};
    double i_deg = 40, v_deg = 95, beta;
    assert_int_equal(
        aperture_init(&a, &(struct aperture_form){.source_width_deg = -1}, 1, &i_deg, &i_deg, &e),
        -ERR_RANGE);
    assert_non_null(strstr(e.text, "angular width"));
    assert_int_equal(aperture_init(&a, &(struct aperture_form){1, 1, false}, 1, &i_deg, &v_deg, NULL),
                     -ERR_RANGE);
    assert_int_equal(aperture_at(&(struct aperture_form){0, 1, true}, i_deg, v_deg, REFLECTANCE_COMPOSITE,
                                 goniometry_set[0], OPTICS(1), &beta, NULL, NULL),
                     -ERR_RANGE);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_is_the_integral_over_both_widths),
        cmocka_unit_test(it_is_the_integral_out_of_plane_too),
        cmocka_unit_test(without_widths_it_is_the_model_to_the_bit),
        cmocka_unit_test(exchange_of_source_and_sensor_changes_nothing),
        cmocka_unit_test(all_ways_to_ask_agree),
        cmocka_unit_test(a_neglected_width_moves_gamma_and_a_known_one_does_not),
        cmocka_unit_test(what_cannot_be_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
