#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/reflectance.h"
#include "fit/render/paint.h"
#include "proto/units.h"

static struct paint paint_of(double s, double sigma, double gamma, double beta_prime, double n) {
    struct paint p = {.name = "test"};
    struct err e = {0};
    snprintf(p.estimate.model, sizeof p.estimate.model, "composite");
    double value[] = {s, sigma, gamma, beta_prime, n};
    memcpy(p.estimate.value, value, sizeof value);
    p.estimate.kappa = 1;
    for (int k = 0; k < BANDS; k++)
        p.estimate.s_lambda[k] = s;
    if (paint_prepare(&p, &e))
        fail_msg("%s", e.text);
    return p;
}

static struct vec3 toward(double theta, double phi) {
    return (struct vec3){sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)};
}

/* The printed equations in their own form, at 64 bits of fraction, times cos theta_i: a, b, c. */
static void printed(const struct paint *p, double theta_i, double theta_r, double dphi, long double out[3]) {
    const double *v = p->estimate.value;
    long double s2 = (long double)v[MATERIAL_SIGMA] * v[MATERIAL_SIGMA], c = cosl(dphi);
    long double alpha = fmaxl(theta_i, theta_r), beta = fminl(theta_i, theta_r), u = 2 * beta / M_PIl;
    long double c1 = 1 - 0.5L * s2 / (s2 + 0.33L);
    long double c2 = 0.45L * s2 / (s2 + 0.09L) * (sinl(alpha) - (c < 0 ? u * u * u : 0));
    long double c3 = 0.125L * s2 / (s2 + 0.09L) * powl(4 * alpha * beta / (M_PIl * M_PIl), 2);
    long double ci = cosl(theta_i), cr = cosl(theta_r);
    out[0] = ci * (c1 + c * c2 * tanl(beta) + (1 - fabsl(c)) * c3 * tanl((alpha + beta) / 2));
    out[1] = ci * 0.17L * s2 / (s2 + 0.13L) * (1 - c * u * u);
    long double li = sinl(theta_i), lr = sinl(theta_r);
    long double h[3] = {li + lr * c, lr * sinl(dphi), ci + cr};
    long double length = sqrtl(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]), cq = length / 2;
    long double phi = atan2l(hypotl(h[0], h[1]), h[2]), nh = h[2] / length;
    long double g = fminl(1, fminl(2 * nh * cr / cq, 2 * nh * ci / cq));
    long double n = v[MATERIAL_N], root = sqrtl(n * n + cq * cq - 1);
    long double minus = (root - cq) / (root + cq), t = (cq * (root + cq) - 1) / (cq * (root - cq) + 1);
    long double f = 0.5L * minus * minus * (1 + t * t);
    out[2] = v[MATERIAL_BETA_PRIME] * expl(-logl(2) * powl(phi / v[MATERIAL_GAMMA], 2)) * g * f / cr;
}

#define ALL (SHADE_SIGMA | SHADE_SPECULAR)

static const double sets[][5] = {{.9, .35, .05, 126, 1.4}, {.3, .2, .2, 15.7, 1.7}, {1, .5, .08, 1.6, 2.42}};

static void vectors_give_the_printed_equations(void **state) {
    (void)state;
    unsigned short dice[3] = {7, 8, 9};
    struct vec3 n = {0, 0, 1};
    for (int draw = 0; draw < 30000; draw++) {
        const double *set = sets[draw % 3];
        struct paint p = paint_of(set[0], set[1], set[2], set[3], set[4]);
        double theta_i = 1.55 * erand48(dice), theta_r = 1.55 * erand48(dice),
               dphi = 2 * M_PI * erand48(dice);
        long double exact[3];
        struct shade_abc got = shade(ALL, &p.shade, NULL, n, toward(theta_i, 0), toward(theta_r, dphi));
        printed(&p, theta_i, theta_r, dphi, exact);
        double size = 1 + fabs((double)exact[2]) * 20;
        if (!(fabs(got.a - (double)exact[0]) < 2e-14 && fabs(got.b - (double)exact[1]) < 2e-14 &&
              fabs(got.c - (double)exact[2]) < 2e-14 * size))
            fail_msg("draw %d: %.17g %.17g %.17g, exactly %.17Lg %.17Lg %.17Lg at %g %g %g", draw, got.a,
                     got.b, got.c, exact[0], exact[1], exact[2], theta_i, theta_r, dphi);
    }
}

/* The vector form of each model against the fit's, which is judged against MPFR. */
static void every_model_is_the_fits(void **state) {
    (void)state;
    unsigned short dice[3] = {2, 7, 1};
    struct vec3 n = {0, 0, 1};
    for (int draw = 0; draw < 14000; draw++) {
        enum reflectance_model model = (enum reflectance_model)(draw % REFLECTANCE_MODELS);
        struct paint p = {.name = "test", .estimate.s_lambda = {1}};
        double value[] = {.1 + erand48(dice), .1 + erand48(dice),  .02 + .3 * erand48(dice),
                          20 * erand48(dice), 1.3 + erand48(dice), 0,
                          erand48(dice)};
        struct reflectance_optics optics = {.kappa = 1.5, .q = 1};
        struct reflectance_geometry g;
        struct reflectance_parts parts;
        double theta_i = 88 * erand48(dice), theta_r = 88 * erand48(dice), dphi = 180 * erand48(dice);
        value[MATERIAL_EXTRA_1] = model == REFLECTANCE_HEAVY_TAIL    ? 2 * erand48(dice)
                                  : model == REFLECTANCE_TRANSMITTED ? 1 + erand48(dice)
                                                                     : .3 + erand48(dice);
        snprintf(p.estimate.model, sizeof p.estimate.model, "%s", reflectance_name(model));
        memcpy(p.estimate.value, value, sizeof value);
        p.estimate.kappa = optics.kappa;
        assert_int_equal(paint_prepare(&p, NULL), 0);
        assert_int_equal(reflectance_geometry_general(&g, theta_i, theta_r, dphi, NULL), 0);
        assert_int_equal(reflectance_eval_parts(model, &g, value, &optics, &parts, NULL), 0);
        struct vec3 l = toward(rad_from_deg(theta_i), 0),
                    v = toward(rad_from_deg(theta_r), rad_from_deg(dphi));
        struct shade_abc x = shade(ALL | SHADE_RELATIVES, &p.shade, NULL, n, l, v);
        double s = value[MATERIAL_S], size = 1 + fabs(parts.specular);
        double diffuse = l.z * (parts.diffuse + parts.interreflection), specular = l.z * parts.specular;
        if (!(fabs(x.a * s + x.b * s * s - diffuse) < 1e-13 && fabs(x.c - specular) < 2e-12 * size))
            fail_msg("draw %d, %s at %g %g %g: %.17g + %.17g, the fit has %.17g + %.17g", draw,
                     p.estimate.model, theta_i, theta_r, dphi, x.a * s + x.b * s * s, x.c, diffuse, specular);
    }
}

/* radiance / cos theta_i is symmetric in light and eye. */
static void light_and_eye_may_change_places(void **state) {
    (void)state;
    unsigned short dice[3] = {1, 8, 3};
    struct vec3 n = {0, 0, 1};
    struct paint p = paint_of(.9, .35, .05, 126, 1.4);
    for (int draw = 0; draw < 10000; draw++) {
        struct vec3 l = toward(1.5 * erand48(dice), 6 * erand48(dice)),
                    v = toward(1.5 * erand48(dice), 6 * erand48(dice));
        struct shade_abc there = shade(ALL, &p.shade, NULL, n, l, v),
                         back = shade(ALL, &p.shade, NULL, n, v, l);
        double sum = (there.a + there.b + there.c) / l.z, other = (back.a + back.b + back.c) / v.z;
        assert_true(fabs(sum - other) <= 1e-12 * (1 + sum));
    }
}

static void hoisting_changes_no_bit(void **state) {
    (void)state;
    unsigned short dice[3] = {3, 3, 3};
    struct paint p = paint_of(.9, .3, .07, 7.6, 1.7);
    struct vec3 l = toward(.35, 1), v = toward(.6, 4);
    struct shade_half half = shade_half(&p.shade, l, v);
    half.cut = -INFINITY;
    for (int draw = 0; draw < 10000; draw++) {
        struct vec3 n = toward(1.5 * erand48(dice), 6.3 * erand48(dice));
        struct shade_abc own = shade(ALL, &p.shade, NULL, n, l, v);
        struct shade_abc fixed = shade(ALL | SHADE_HOISTED | SHADE_LOBE_CUT, &p.shade, &half, n, l, v);
        assert_memory_equal(&own, &fixed, sizeof own);
    }
}

/* Whatever is asked: finite, and nothing from behind. */
static void no_extreme_gives_a_nan(void **state) {
    (void)state;
    static const double gammas[] = {1e-6, 1e-3, .01, 1, 1e3}, betas[] = {0, 1e-12, 1e6, 1e12};
    static const double ns[] = {1, 1 + 1e-12, 1.0001, 2.42, 10}, sigmas[] = {0, 1e-8, 1, 1e8};
    static const double thetas_deg[] = {0, 1e-9, 45, 89.999, 90, 91, 179, 180};
    static const double azimuths_deg[] = {0, 90, 180};
    struct vec3 normals[] = {{0, 0, 1}, {0, 0, -1}, {1, 0, 0}, {0, 0, 0}};
    for (int i = 0; i < 5 * 4 * 5 * 4; i++) {
        struct paint p = paint_of(i % 3, sigmas[i / 100], gammas[i % 5], betas[i / 5 % 4], ns[i / 20 % 5]);
        for (int j = 0; j < 8 * 8 * 3 * 4; j++) {
            struct vec3 l = toward(rad_from_deg(thetas_deg[j % 8]), 0);
            struct vec3 v =
                toward(rad_from_deg(thetas_deg[j / 8 % 8]), rad_from_deg(azimuths_deg[j / 64 % 3]));
            struct vec3 n = normals[j / 192];
            struct shade_abc x = shade(ALL, &p.shade, NULL, n, l, v);
            if (!isfinite(x.a) || !isfinite(x.b) || !isfinite(x.c))
                fail_msg("parameters %d, geometry %d: %g %g %g", i, j, x.a, x.b, x.c);
            if (vec3_dot(n, l) <= 0 || vec3_dot(n, v) <= 0)
                assert_true(x.a == 0 && x.b == 0 && x.c == 0);
            assert_true(x.b >= 0 && x.c >= 0);
        }
    }
}

static void sigma_zero_is_lambert(void **state) {
    (void)state;
    struct paint p = paint_of(.5, 0, .1, 0, 1.5);
    struct shade_abc x = shade(ALL, &p.shade, NULL, (struct vec3){0, 0, 1}, toward(.7, 0), toward(.4, 2));
    assert_true(x.a == cos(.7) && x.b == 0 && x.c == 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(vectors_give_the_printed_equations),
        cmocka_unit_test(every_model_is_the_fits),
        cmocka_unit_test(light_and_eye_may_change_places),
        cmocka_unit_test(hoisting_changes_no_bit),
        cmocka_unit_test(no_extreme_gives_a_nan),
        cmocka_unit_test(sigma_zero_is_lambert),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
