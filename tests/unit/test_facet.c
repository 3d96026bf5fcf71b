#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/facet.h"
#include "fit/render/paint.h"
#include "fit/render/sampler.h"
#include "proto/units.h"
#include "tests/support/seed.h"

static const struct vec3 normal = {0, 0, 1};

static struct shade_paint paint_of(const char *model, double gamma, double beta_prime, double extra_1,
                                   double extra_2) {
    struct paint p = {.name = "test"};
    struct err e = {0};
    snprintf(p.estimate.model, sizeof p.estimate.model, "%s", model);
    double value[] = {0.5, 0.3, gamma, beta_prime, 1.5, extra_1, extra_2};
    memcpy(p.estimate.value, value, sizeof value);
    p.estimate.kappa = 1;
    for (int k = 0; k < BANDS; k++)
        p.estimate.s_lambda[k] = 0.5;
    if (paint_prepare(&p, &e))
        fail_msg("%s", e.text);
    return p.shade;
}

static struct vec3 toward(double theta, double azimuth) {
    return (struct vec3){sin(theta) * cos(azimuth), sin(theta) * sin(azimuth), cos(theta)};
}

/* All directions l, by the facets that make them: d omega_l = 4 |v.h| d omega_h. Simpson in phi = width sinh t. */
static double integral_of_density(const struct shade_paint *p, struct vec3 v, double width, int around) {
    enum { STEPS = 3000 };
    double top = asinh(M_PI_2 / width), sum = 0;
    for (int i = 0; i <= STEPS; i++) {
        double t = top * i / STEPS, phi = fmin(width * sinh(t), M_PI_2);
        double part = (i == 0 || i == STEPS ? 1 : i % 2 ? 4 : 2) * top / STEPS / 3 * width * cosh(t);
        for (int k = 0; k < around; k++) {
            struct vec3 h = toward(phi, (k + 0.5) * 2 * M_PI / around);
            double along = vec3_dot(v, h);
            struct vec3 l = vec3_sub(vec3_scale(h, 2 * along), v);
            sum += part * sin(phi) * 2 * M_PI / around * 4 * fabs(along) * facet_density(p, normal, v, l);
        }
    }
    return sum;
}

static const double gammas[] = {1e-6, 1e-3, .01, .05, .2, 1, 10, 1000};

static void density_integrates_to_one(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof gammas / sizeof *gammas; i++)
        for (int tilt = 0; tilt < 3; tilt++) {
            static const double theta[] = {0, 0.6, 1.4};
            struct shade_paint p = paint_of("composite", gammas[i], 126, 0, 0);
            double whole = integral_of_density(&p, toward(theta[tilt], 0.3), fmin(gammas[i], 1), 4);
            if (!(fabs(whole - 1) < 1e-9))
                fail_msg("gamma %g, view at %g rad: %.12g", gammas[i], theta[tilt], whole);
        }
}

static const struct {
    const char *model;
    double gamma, beta_prime, extra_1, extra_2;
} relatives[] = {
    {"heavy-tail", .05, 20, 1e-6, 0}, {"heavy-tail", .05, 20, .1, 0}, {"heavy-tail", .2, 20, 1, 0},
    {"heavy-tail", .05, 20, 2, 0},    {"heavy-tail", 1e-4, 20, 2, 0}, {"two-lobe", .02, 126, .3, 2},
    {"two-lobe", .3, 1, .01, 50},     {"two-lobe", .2, 0, .1, 3},     {"transmitted", .1, 5, 1.5, 0},
};
enum { RELATIVES = sizeof relatives / sizeof *relatives };

static struct shade_paint relative(int i) {
    return paint_of(relatives[i].model, relatives[i].gamma, relatives[i].beta_prime, relatives[i].extra_1,
                    relatives[i].extra_2);
}

static void tails_and_second_lobes_integrate_to_one(void **state) {
    (void)state;
    for (int i = 0; i < RELATIVES; i++) {
        struct shade_paint p = relative(i);
        double width = fmin(relatives[i].gamma, i > 4 && i < 8 ? relatives[i].extra_1 : 1);
        double whole = integral_of_density(&p, toward(0.4, 1), width, 4);
        if (!(fabs(whole - 1) < 1e-9))
            fail_msg("%s %d: %.12g", relatives[i].model, i, whole);
    }
}

/* Not by facets: midpoints over the sphere of l, which knows nothing of h. */
static void density_is_per_solid_angle_of_l(void **state) {
    (void)state;
    struct shade_paint p = paint_of("two-lobe", .5, 3, .8, 1);
    struct vec3 v = toward(0.7, 0.2);
    double sum = 0;
    for (int i = 0; i < 1000; i++)
        for (int k = 0; k < 1000; k++) {
            struct vec3 l = toward(acos(1 - (i + 0.5) / 500), (k + 0.5) * M_PI / 500);
            sum += facet_density(&p, normal, v, l) * 4 * M_PI * 1e-6;
        }
    if (!(fabs(sum - 1) < 2e-3)) /* the density of facets on edge has a pole at l = -v */
        fail_msg("%.9g", sum);
}

enum { LEAN = 24, AROUND = 8, CELLS = LEAN * AROUND, DRAWS = 400000 };

/* Cell of l by the facet: equal steps of asinh(phi / width), and around the normal. */
static int cell_of(struct vec3 v, struct vec3 l, double width) {
    struct vec3 h = vec3_unit(vec3_add(v, l));
    h = h.z < 0 ? vec3_scale(h, -1) : h;
    double t = asinh(atan2(hypot(h.x, h.y), h.z) / width) / asinh(M_PI_2 / width);
    double around = atan2(h.y, h.x) / (2 * M_PI) + 0.5;
    return (int)fmin(t * LEAN, LEAN - 1) * AROUND + (int)fmin(around * AROUND, AROUND - 1);
}

/* Expected share of each cell, from the density at 40 x 8 points of it. */
static void expect_cells(const struct shade_paint *p, struct vec3 v, double width, double share[CELLS]) {
    double top = asinh(M_PI_2 / width);
    memset(share, 0, CELLS * sizeof *share);
    for (int i = 0; i < LEAN * 40; i++)
        for (int k = 0; k < AROUND * 8; k++) {
            double t = top * (i + 0.5) / (LEAN * 40), phi = width * sinh(t);
            struct vec3 h = toward(phi, ((k + 0.5) / (AROUND * 8) - 0.5) * 2 * M_PI);
            double along = vec3_dot(v, h),
                   size = sin(phi) * width * cosh(t) * top / (LEAN * 40) * 2 * M_PI / (AROUND * 8);
            struct vec3 l = vec3_sub(vec3_scale(h, 2 * along), v);
            share[i / 40 * AROUND + k / 8] += 4 * fabs(along) * size * facet_density(p, normal, v, l);
        }
}

static void check_histogram(const struct shade_paint *p, double width, unsigned seed) {
    double share[CELLS], chi2 = 0, rest = DRAWS;
    int cells = 0, drawn[CELLS] = {0};
    struct vec3 v = toward(0.8, 0.5), l;
    unsigned short dice[3] = {(unsigned short)seed, 1, 2};
    expect_cells(p, v, width, share);
    for (int i = 0; i < DRAWS; i++) {
        double u[2] = {erand48(dice), erand48(dice)};
        assert_true(facet_sample(p, normal, v, u, &l));
        drawn[cell_of(v, l, width)]++;
    }
    for (int i = 0; i < CELLS; i++)
        if (share[i] * DRAWS > 10) {
            chi2 += pow(drawn[i] - share[i] * DRAWS, 2) / (share[i] * DRAWS);
            rest -= drawn[i];
            cells++;
        }
    /* mean cells - 1, variance twice that: five standard deviations */
    if (!(cells > AROUND && chi2 < cells + 5 * sqrt(2.0 * cells)) || rest > CELLS * 10)
        fail_msg("chi2 %g of %d cells, %g draws outside; GONIOD_TEST_SEED=%u repeats it", chi2, cells, rest,
                 seed);
}

static void samples_follow_the_density(void **state) {
    (void)state;
    unsigned seed = (unsigned)test_seed(20260102);
    for (size_t i = 0; i < sizeof gammas / sizeof *gammas; i++) {
        struct shade_paint p = paint_of("composite", gammas[i], 126, 0, 0);
        check_histogram(&p, fmin(gammas[i], 1), seed);
    }
    for (int i = 0; i < RELATIVES; i++) {
        struct shade_paint p = relative(i);
        check_histogram(&p, relatives[i].gamma, seed);
    }
}

/* What is drawn has a finite weight c / density, from every view and at the corners of u. */
static void weights_are_finite(void **state) {
    (void)state;
    static const double us[] = {0x1p-33, 1e-3, 0.5, 0.999, 1 - 0x1p-33};
    static const double theta[] = {0, 1e-9, 0.5, 1.5, 1.5707};
    for (size_t g = 0; g < sizeof gammas / sizeof *gammas + RELATIVES; g++) {
        struct shade_paint p = g < 8 ? paint_of("composite", gammas[g], 1e6, 0, 0) : relative((int)g - 8);
        for (int i = 0; i < 125; i++) {
            double u[2] = {us[i % 5], us[i / 5 % 5]};
            struct vec3 l, v = toward(theta[i / 25], 0.4);
            assert_true(facet_sample(&p, normal, v, u, &l));
            double density = facet_density(&p, normal, v, l);
            struct shade_abc x = shade(SHADE_SPECULAR | SHADE_RELATIVES, &p, NULL, normal, l, v);
            assert_true(fabs(vec3_length(l) - 1) < 1e-12);
            assert_true(x.c == 0 || (density > 0 && isfinite(density) && isfinite(x.c / density)));
            if (l.z < 0)
                assert_true(x.c == 0);
        }
    }
}

static void light_and_eye_may_be_exchanged(void **state) {
    (void)state;
    unsigned short dice[3] = {4, 5, 6};
    for (int i = 0; i < 2000; i++) {
        struct shade_paint p = relative(i % RELATIVES);
        struct vec3 l = toward(1.5 * erand48(dice), 6 * erand48(dice)),
                    v = toward(1.5 * erand48(dice), 6 * erand48(dice));
        assert_true(facet_density(&p, normal, v, l) == facet_density(&p, normal, l, v));
    }
}

/* The mean weight is the specular albedo: the density has the scale it says (rendering.md 4.4: .0504, .235). */
static void mean_weight_is_the_albedo(void **state) {
    (void)state;
    static const struct {
        double gamma, beta_prime, n, theta, albedo;
    } sets[] = {{.05, 126, 1.4, 0, .050},  {.05, 126, 1.4, 60, .132}, {.05, 126, 1.4, 75, .414},
                {.2, 15.7, 1.7, 0, .235},  {.2, 15.7, 1.7, 60, .389}, {.2, 15.7, 1.7, 85, 1.28},
                {.08, 1.6, 2.42, 75, .018}};
    for (size_t i = 0; i < sizeof sets / sizeof *sets; i++) {
        struct shade_paint p = paint_of("composite", sets[i].gamma, sets[i].beta_prime, 0, 0);
        struct vec3 l, v = toward(rad_from_deg(sets[i].theta), 0);
        double sum = 0;
        p.n2_1 = (sets[i].n - 1) * (sets[i].n + 1);
        for (uint32_t k = 0; k < 65536; k++) {
            struct sampler s;
            double u[2];
            sampler_start(&s, 1, 0, k);
            sampler_2d(&s, u);
            assert_true(facet_sample(&p, normal, v, u, &l));
            sum += shade(SHADE_SPECULAR, &p, NULL, normal, l, v).c / facet_density(&p, normal, v, l);
        }
        double albedo = sum / 65536 / M_PI;
        if (!(fabs(albedo - sets[i].albedo) < 0.006 * (1 + sets[i].albedo)))
            fail_msg("set %zu: %.5g, tabled %.3g", i, albedo, sets[i].albedo);
    }
}

static void a_paint_without_a_lobe_has_no_facets(void **state) {
    (void)state;
    struct shade_paint p = paint_of("composite", .1, 0, 0, 0);
    struct vec3 l;
    assert_false(facet_sample(&p, normal, normal, (double[]){0.5, 0.5}, &l));
    assert_true(facet_density(&p, normal, normal, normal) == 0);
    p = paint_of("composite", .1, 2, 0, 0);
    assert_true(facet_density(&p, normal, toward(1, 0), vec3_scale(toward(1, 0), -1)) == 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(density_integrates_to_one),
        cmocka_unit_test(tails_and_second_lobes_integrate_to_one),
        cmocka_unit_test(density_is_per_solid_angle_of_l),
        cmocka_unit_test(samples_follow_the_density),
        cmocka_unit_test(weights_are_finite),
        cmocka_unit_test(light_and_eye_may_be_exchanged),
        cmocka_unit_test(mean_weight_is_the_albedo),
        cmocka_unit_test(a_paint_without_a_lobe_has_no_facets),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
