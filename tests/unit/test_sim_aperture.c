#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "fit/reflectance.h"
#include "proto/units.h"
#include "sim/truth.h"

#define FINE 110 /* shares of each width in the test's own sum */

static struct truth t;
static const double S = 0.3;

static void bench(const struct sim_config *config, const struct sim_surface *surface) {
    static uint16_t counts[DETECTOR_PIXELS_MAX];
    assert_int_equal(truth_init(&t, config, detector_model("usb2000plus"), NULL), 0);
    struct truth_mount *m = (struct truth_mount *)truth_mount_find(&t, "sample");
    m->kind = TRUTH_SURFACE;
    m->surface = *surface;
    lamp_switch(&t.lamp, 0, true);
    truth_frame(&t, 2000000000, 2000004000, 4000, counts);
}

/* The bench turned by hand to a geometry, and looked at once. */
static double seen(double theta_i_deg, double theta_v_deg) {
    static uint16_t counts[DETECTOR_PIXELS_MAX];
    t.axis[TRUTH_SOURCE].manual_deg = theta_i_deg + theta_v_deg;
    t.axis[TRUTH_SAMPLE].manual_deg = theta_v_deg;
    truth_frame(&t, 2000000000, 2000004000, 4000, counts);
    const struct surface_factors *f = &t.sight.factors;
    return S * f->l1 + S * S * f->l2 + f->specular;
}

static double beta_at(const struct sim_surface *s, double polarisation, double theta_i_deg,
                      double theta_v_deg) {
    const struct reflectance_optics optics = {1, 1, polarisation};
    double value[MATERIAL_PARAMETERS] = {S, s->sigma, s->gamma, s->beta_prime, s->n}, beta;
    double side = theta_i_deg < 0 ? -1 : 1;
    struct reflectance_geometry g;
    reflectance_geometry(&g, side * theta_i_deg, side * theta_v_deg, NULL);
    reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, &optics, &beta, NULL, NULL);
    return beta;
}

/* Light that arrives: each direction of the source, its irradiance, each direction of the sensor. */
static double arriving(const struct sim_config *c, const struct sim_surface *s, double theta_i_deg,
                       double theta_v_deg) {
    double sum = 0;
    for (int a = 0; a < FINE; a++)
        for (int b = 0; b < FINE; b++) {
            double i = theta_i_deg + c->source_width_deg * ((a + 0.5) / FINE - 0.5);
            double v = theta_v_deg + c->sensor_width_deg * ((b + 0.5) / FINE - 0.5);
            double share = cos(rad_from_deg(c->filling == SIM_VIEW_IN_BEAM ? i : v));
            sum += share * beta_at(s, c->polarisation, i, v);
        }
    return sum / FINE / FINE;
}

static void light_of_all_directions_adds_up(void **state) {
    (void)state;
    static const double at[][2] = {{40, 40}, {40, 37}, {0.3, 1}, {0, -8}, {60, 66}, {50, -30}, {10, 80}};
    const struct sim_surface glossy = {.sigma = 0.35, .gamma = 0.05, .beta_prime = 126, .n = 1.4};
    for (int filling = 0; filling < 2; filling++) {
        struct sim_config c;
        sim_config_default(&c);
        c.quiet = true;
        c.n_axes = 0;
        c.filling = filling ? SIM_BEAM_IN_VIEW : SIM_VIEW_IN_BEAM;
        c.beam_mm = filling ? 3 : 20;
        c.view_mm = filling ? 20 : 3;
        c.source_width_deg = 1.5;
        c.sensor_width_deg = 1;
        c.polarisation = 0.05;
        bench(&c, &glossy);
        for (size_t k = 0; k < sizeof at / sizeof *at; k++) {
            double expected = arriving(&c, &glossy, at[k][0], at[k][1]), got = seen(at[k][0], at[k][1]);
            assert_float_equal(got / expected, 1, 2e-6);
            assert_float_equal(seen(-at[k][0], -at[k][1]) / got, 1, 1e-12); /* mirrored */
        }
        truth_free(&t);
    }
}

static void without_widths_it_is_the_surface_itself(void **state) {
    (void)state;
    const struct sim_surface paint = {.sigma = 0.3, .gamma = 0.07, .beta_prime = 7.6, .n = 1.7};
    struct sim_config c;
    sim_config_default(&c);
    c.quiet = true;
    c.n_axes = 0;
    bench(&c, &paint);
    assert_float_equal(seen(40, 38) / cos(rad_from_deg(40)) / beta_at(&paint, 0, 40, 38), 1, 1e-14);
    /* another surface in its place is looked at anew */
    ((struct truth_mount *)t.sight.mount)->surface.beta_prime = 0;
    t.sight.mount = NULL;
    assert_true(seen(40, 38) < cos(rad_from_deg(40)) * beta_at(&paint, 0, 40, 38) / 2);
    truth_free(&t);
}

static void polarisation_is_drawn_from_what_is_stated(void **state) {
    (void)state;
    const int benches = 400;
    double sum = 0, square = 0;
    for (int seed = 1; seed <= benches; seed++) {
        struct sim_config c;
        sim_config_default(&c);
        c.seed = (uint64_t)seed;
        c.polarisation = 0.03;
        c.u_polarisation = 0.02;
        assert_int_equal(truth_init(&t, &c, detector_model("usb2000plus"), NULL), 0);
        sum += (t.polarisation - 0.03) / 0.02;
        square += pow((t.polarisation - 0.03) / 0.02, 2);
        truth_free(&t);
    }
    assert_true(fabs(sum / benches) < 4 / sqrt(benches));
    assert_true(fabs(square / benches - 1) < 4 * sqrt(2.0 / benches));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(light_of_all_directions_adds_up),
        cmocka_unit_test(without_widths_it_is_the_surface_itself),
        cmocka_unit_test(polarisation_is_drawn_from_what_is_stated),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
