#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit/render/exr.h"
#include "tests/support/render_scene.h"

#define WHITE "materials: [{name: m, uniform: 1, model: lambert}]\n"
#define ABOVE "camera: {orthographic: {height_mm: 80}}\n"
#define FLOOR "shapes: [rectangle: {material: m, width_mm: 80, height_mm: 80}]\n"

/* Form factor of a corner of a parallel rectangle, a by b, straight over a point at the distance c. */
static double corner(double a, double b, double c) {
    double ra = hypot(a, c), rb = hypot(b, c);
    return (a / ra * atan(b / ra) + b / rb * atan(a / rb)) / (2 * M_PI);
}

static double form_factor(double x0, double x1, double y0, double y1, double c) {
    return corner(x1, y1, c) - corner(x0, y1, c) - corner(x1, y0, c) + corner(x0, y0, c);
}

static void lambert_under_a_panel_is_the_form_factor(void **state) {
    (void)state;
    struct scene *scene =
        scene_of(WHITE FLOOR "lights: [rectangle: {at_mm: [0, 0, 50], width_mm: 60, height_mm: 30}]\n" ABOVE
                             "image: {width: 20, height: 20, grid: 1, samples: 64}\n");
    struct planes planes;
    struct render_report report;
    planes_of(scene, &(struct render_options){0}, &planes, &report);
    double whole = form_factor(-30, 30, -15, 15, 50), sum = 0, noise = 0;
    for (int i = 0; i < 400; i++) {
        double x = (i % 20 + 0.5 - 10) * 4, y = (10 - i / 20 - 0.5) * 4;
        double expected = form_factor(-30 - x, 30 - x, -15 - y, 15 - y, 50) / whole, got = planes.set[0].a[i];
        if (!(fabs(got - expected) < 0.003))
            fail_msg("at %g, %g mm: %.6g, expected %.6g", x, y, got, expected);
        sum += got - expected;
        noise += planes.noise[i];
    }
    assert_true(fabs(sum) < 5 * sqrt(noise));
    assert_int_equal(report.counts.drawn, 400 * 64);
    assert_int_equal(report.counts.shadow_rays, 0);
    assert_int_equal(report.counts.fireflies, 0);
    planes_free(&planes);
    scene_free(scene);
}

static char sky_file[64];

static void fill_sky(void *arg, int y, float *const *row) {
    (void)y;
    for (int x = 0; x < 8; x++)
        row[0][x] = *(float *)arg;
}

static void write_sky(float radiance) {
    static const char channel[1][EXR_NAME_MAX] = {"Y"};
    struct exr_form form = {
        .width = 8, .height = 4, .n_channels = 1, .channel = channel, .fill = fill_sky, .arg = &radiance};
    snprintf(sky_file, sizeof sky_file, "/tmp/test_trace_area-%d.exr", (int)getpid());
    assert_int_equal(exr_save(sky_file, &form, NULL), 0);
}

/* The white furnace: what is lit the same from all around, and returns all, is not seen. */
static void a_white_sphere_in_a_white_sky_is_white(void **state) {
    (void)state;
    write_sky(7);
    struct scene *scene = scene_of(WHITE "shapes: [sphere: {material: m, radius_mm: 30}]\n"
                                         "lights: [environment: {image: %s, turn_deg: [3, 20, 0]}]\n" ABOVE
                                         "image: {width: 40, height: 40, grid: 1, samples: 256}\n",
                                   sky_file);
    unlink(sky_file);
    struct planes planes;
    struct render_report report;
    planes_of(scene, &(struct render_options){0}, &planes, &report);
    double sum = 0, noise = 0;
    int n = 0;
    for (int i = 0; i < 1600; i++)
        if (planes.paint[i] >= 0) {
            assert_true(fabs(planes.set[0].a[i] - 1) < 0.1);
            sum += planes.set[0].a[i] - 1;
            noise += planes.noise[i];
            n++;
        }
    assert_true(n > 600 && noise > 0);
    if (!(fabs(sum) < 5 * sqrt(noise) && sqrt(noise) / n < 1e-3))
        fail_msg("mean off by %g +- %g", sum / n, sqrt(noise) / n);
    planes_free(&planes);
    scene_free(scene);
}

/* So is a white fold, where all that it does not send out at once comes out over its other side. */
static void a_white_fold_in_a_white_sky_is_white(void **state) {
    (void)state;
    write_sky(1);
    struct scene *scene = scene_of(
        WHITE "shapes: [fold: {materials: [m, m], width_mm: 40, length_mm: 50, angle_deg: 90}]\n"
              "lights: [environment: {image: %s}]\n"
              "camera: {orthographic: {height_mm: 50, from: [0.1, 0.2, 1], look_at_mm: [0, 0, 16]}}\n"
              "image: {width: 20, height: 20, grid: 1, samples: 256, bounces: 32}\n",
        sky_file);
    unlink(sky_file);
    struct planes planes;
    struct render_report report;
    planes_of(scene, &(struct render_options){0}, &planes, &report);
    double *xyz = xyz_of(scene, &planes, true), sum = 0, noise = 0, once = 0;
    int n = 0;
    for (int i = 0; i < 400; i++)
        if (planes.paint[i] >= 0) {
            sum += xyz[3 * i + 1] - 1;
            once += planes.set[0].a[i];
            noise += planes.noise[i];
            n++;
        }
    assert_true(n > 200 && once < 0.9 * n); /* a part comes over the other side */
    if (!(fabs(sum) < 5 * sqrt(noise) && sqrt(noise) / n < 3e-3))
        fail_msg("mean off by %g +- %g", sum / n, sqrt(noise) / n);
    free(xyz);
    planes_free(&planes);
    scene_free(scene);
}

#define GREEN                                                                                                \
    "materials: [{name: m, spectrum: green.csv, sigma: 0.3, gamma: 0.07, beta_prime: 7.6, n: 1.7}]\n"
#define TILTED "shapes: [cylinder: {material: m, radius_mm: 20, length_mm: 60, turn_deg: [0, 0, 17]}]\n"

static void a_ball_far_away_is_a_beam(void **state) {
    (void)state;
    static const char *const lights[] = {
        "beam: {theta_deg: 30}", "sphere: {at_mm: [5.0e+5, 0, 866025.4037844386], radius_mm: 5}",
        "rectangle: {at_mm: [5.0e+5, 0, 866025.4037844386], width_mm: 8, height_mm: 8}"};
    struct planes planes[3];
    struct render_report report;
    for (int i = 0; i < 3; i++) {
        struct scene *scene = scene_of(GREEN TILTED "lights: [%s]\n" ABOVE
                                                    "image: {width: 40, height: 40, grid: 1, samples: 4}\n",
                                       lights[i]);
        planes_of(scene, &(struct render_options){0}, &planes[i], &report);
        scene_free(scene);
    }
    for (int i = 0; i < 1600; i++)
        for (int k = 1; k < 3; k++) {
            assert_true(fabs(planes[0].set[0].a[i] - planes[k].set[0].a[i]) < 2e-4);
            assert_true(fabs(planes[0].set[0].b[i] - planes[k].set[0].b[i]) < 2e-4);
            assert_true(fabs(planes[0].set[0].c[i] - planes[k].set[0].c[i]) < 2e-3);
        }
    for (int i = 0; i < 3; i++)
        planes_free(&planes[i]);
}

/* Planes of drawn light coloured anew: to the last bit the picture of a lamp of that spectrum, drawn the same. */
static void recolouring_is_rendering(void **state) {
    (void)state;
    struct planes planes[2];
    struct render_report report;
    struct scene *scene[2];
    for (int i = 0; i < 2; i++) {
        scene[i] =
            scene_of(GREEN TILTED "lights: [sphere: {at_mm: [50, 50, 80], radius_mm: 20, spd: %s}]\n" ABOVE
                                  "image: {width: 40, height: 40, grid: 2, samples: 16}\n",
                     i ? "A" : "D65");
        planes_of(scene[i], &(struct render_options){0}, &planes[i], &report);
    }
    memcpy(scene[0]->spd[0].power, scene[1]->spd[0].power, sizeof scene[0]->spd[0].power);
    double *recoloured = xyz_of(scene[0], &planes[0], false), *rendered = xyz_of(scene[1], &planes[1], false),
           *summed = xyz_of(scene[1], &planes[1], true);
    assert_memory_equal(recoloured, rendered, 3 * 1600 * sizeof *rendered);
    for (int i = 0; i < 3 * 1600; i++)
        assert_true(fabs(summed[i] - rendered[i]) < 1e-12);
    assert_memory_not_equal(planes[0].noise, planes[1].noise,
                            1600 * sizeof *planes[0].noise); /* of Y under each */
    for (int i = 0; i < 2; i++) {
        planes_free(&planes[i]);
        scene_free(scene[i]);
    }
    free(recoloured);
    free(rendered);
    free(summed);
}

#define THREE_LIGHTS                                                                                         \
    "lights:\n"                                                                                              \
    "  - rectangle: {at_mm: [-60, 40, 90], width_mm: 50, height_mm: 30, weight: 2}\n"                        \
    "  - sphere: {at_mm: [80, 0, 60], radius_mm: 10, spd: A}\n"                                              \
    "  - beam: {theta_deg: 70, azimuth_deg: 90}\n"
#define TWO_SHAPES                                                                                           \
    "shapes:\n"                                                                                              \
    "  - cylinder: {material: m, radius_mm: 20, length_mm: 60, turn_deg: [20, 0, 17]}\n"                     \
    "  - sphere: {material: k, radius_mm: 12, at_mm: [15, 5, 25]}\n"
#define TWO_PAINTS                                                                                           \
    "materials:\n"                                                                                           \
    "  - {name: m, spectrum: green.csv, sigma: 0.3, gamma: 0.02, beta_prime: 60, n: 1.7}\n"                  \
    "  - {name: k, uniform: 0.4, sigma: 0.5, gamma: 0.2, beta_prime: 15.7, n: 1.7}\n"

static void same_bits_for_any_number_of_threads(void **state) {
    (void)state;
    struct scene *scene = scene_of(TWO_PAINTS TWO_SHAPES THREE_LIGHTS ABOVE
                                   "image: {width: 50, height: 45, grid: 2, samples: 16}\n");
    struct planes one, other;
    struct render_report report[2];
    planes_of(scene, &(struct render_options){.threads = 1}, &one, &report[0]);
    assert_true(one.n_extra > 0 && report[0].counts.shadow_rays > 0 && one.n_sets == 2);
    for (int threads = 2; threads <= 3; threads++) {
        size_t size = 50 * 45 * sizeof(double);
        planes_of(scene, &(struct render_options){.threads = threads}, &other, &report[1]);
        for (int j = 0; j < 2; j++) {
            assert_memory_equal(one.set[j].a, other.set[j].a, size);
            assert_memory_equal(one.set[j].b, other.set[j].b, size);
            assert_memory_equal(one.set[j].c, other.set[j].c, size);
        }
        assert_memory_equal(one.noise, other.noise, size);
        assert_memory_equal(&report[0].counts, &report[1].counts, sizeof report[0].counts);
        planes_free(&other);
    }
    planes_free(&one);
    scene_free(scene);
}

/* Where only what has no noise is left out, pictures differ by the bound; where facets are, by the noise beside. */
static void left_out_agrees_with_all_features(void **state) {
    (void)state;
    static const char *const materials[] = {
        WHITE, "materials: [{name: m, spectrum: green.csv, sigma: 2.0e-4}]\n", GREEN,
        "materials: [{name: m, uniform: 0.5, gamma: 0.001, beta_prime: 5.0e+4, n: 1.5}]\n"};
    static const char *const lights[] = {
        "sphere: {at_mm: [50, 50, 80], radius_mm: 3}",
        "rectangle: {at_mm: [0, 90, 90], width_mm: 40, height_mm: 9}", "beam: {theta_deg: 40}",
        "rectangle: {at_mm: [0, 90, 90], width_mm: 40, height_mm: 9}, beam: {theta_deg: 3, weight: 0}"};
    for (int i = 0; i < 12; i++) {
        const char *comma = strstr(lights[i % 4], "}, ");
        struct scene *scene = scene_of("%s" TILTED "lights:\n  - %.*s\n%s%s\n" ABOVE
                                       "image: {width: 40, height: 40, grid: 1, samples: 16}\n",
                                       materials[i / 3], comma ? (int)(comma - lights[i % 4]) + 1 : 99,
                                       lights[i % 4], comma ? "  - " : "", comma ? comma + 3 : "");
        struct planes few, all;
        struct render_report report, whole;
        planes_of(scene, &(struct render_options){0}, &few, &report);
        planes_of(scene, &(struct render_options){.all_features = true}, &all, &whole);
        bool facets = report.features.line[FEATURE_FACETS].kept == whole.features.line[FEATURE_FACETS].kept ||
                      scene->paint[0].shade.beta_prime == 0 || !few.noise;
        double *lean = xyz_of(scene, &few, false), *full = xyz_of(scene, &all, true), sum = 0, variance = 0;
        double bound = 1.1 * features_bound(&report.features) + 1e-12;
        for (int k = 0; k < 1600; k++) {
            double apart = lean[3 * k + 1] - full[3 * k + 1];
            sum += apart;
            variance += (few.noise ? few.noise[k] : 0) + all.noise[k];
            if (facets && !(fabs(apart) <= bound))
                fail_msg("case %d, pixel %d: %.3g apart, bound %.3g", i, k, apart, bound);
        }
        if (!(fabs(sum) < 1600 * bound + 5 * sqrt(variance)))
            fail_msg("case %d: %.3g apart, noise %.3g", i, sum, sqrt(variance));
        assert_true((few.noise != NULL) == (strncmp(lights[i % 4], "beam", 4) != 0) && all.noise);
        assert_true((report.counts.drawn > 0) == (few.noise != NULL));
        free(lean);
        free(full);
        planes_free(&few);
        planes_free(&all);
        scene_free(scene);
    }
}

/* Half of the panel is hidden from the middle of the floor, all of it from one side and nothing from the other. */
static void what_hides_a_part_of_a_light_makes_half_shadow(void **state) {
    (void)state;
    struct scene *scene =
        scene_of(WHITE "shapes:\n"
                       "  - rectangle: {material: m, width_mm: 200, height_mm: 10}\n"
                       "  - rectangle: {material: m, width_mm: 100, height_mm: 100, at_mm: [50, 0, 30], "
                       "turn_deg: [180, 0, 0]}\n"
                       "lights: [rectangle: {at_mm: [0, 0, 60], width_mm: 40, height_mm: 40}]\n"
                       "camera: {orthographic: {height_mm: 0.001, from: [-1, 0, 1], look_at_mm: [0, 0, 0]}}\n"
                       "image: {width: 1, height: 1, grid: 1, samples: 1024}\n");
    static const double expected[] = {0, 0.5, 1}, at_mm[] = {45, 0, -45};
    for (int i = 0; i < 3; i++) {
        struct planes planes;
        struct render_report report;
        struct err e = {0};
        scene->camera.look_at_mm[0] = at_mm[i];
        assert_int_equal(camera_prepare(&scene->camera, 1, 1, 500, &e), 0);
        planes_of(scene, &(struct render_options){0}, &planes, &report);
        double open =
            form_factor(-20 - at_mm[i], 20 - at_mm[i], -20, 20, 60) / form_factor(-20, 20, -20, 20, 60);
        if (!(fabs(planes.set[0].a[0] - expected[i] * open) < 0.01))
            fail_msg("at %g mm: %g, expected %g", at_mm[i], planes.set[0].a[0], expected[i] * open);
        planes_free(&planes);
    }
    scene_free(scene);
}

static const char *const extreme_paints[] = {
    "sigma: 0.3, gamma: 1.0e-6, beta_prime: 1.0e+12, n: 1.5",
    "sigma: 1.0e+8, gamma: 1.0e-3, beta_prime: 1.0e+6, n: 10",
    "sigma: 1.0e-8, gamma: 1000, beta_prime: 126, n: 2.42",
    "sigma: 1, gamma: 1, beta_prime: 1.0e-12, n: 1.000000000001",
    "sigma: 0.3, gamma: 0.01, beta_prime: 126, n: 1",
    "model: heavy-tail, tail: 2, gamma: 1.0e-6, beta_prime: 1.0e+6",
    "model: two-lobe, gamma: 1.0e-6, beta_prime: 1, gamma_2: 1000, beta_prime_2: 1"};

static void all_is_finite(const struct planes *p) {
    for (int i = 0; i < p->width * p->height; i++)
        assert_true(isfinite(p->set[0].a[i]) && isfinite(p->set[0].b[i]) && isfinite(p->set[0].c[i]) &&
                    isfinite(p->noise[i]) && p->set[0].a[i] >= 0 && p->set[0].c[i] >= 0 && p->noise[i] >= 0);
}

/* Any paint, under light from a grain to the whole sky, nearly touching and far away: numbers, none below 0. */
static void extremes_are_numbers(void **state) {
    (void)state;
    static const char *const lights[] = {
        "rectangle: {at_mm: [0, 0, 20.000001], width_mm: 1.0e+5, height_mm: 1.0e-3}",
        "rectangle: {at_mm: [0, 1.0e+6, 1.0e+6], width_mm: 1.0e-6, height_mm: 1.0e-6}",
        "rectangle: {at_mm: [20, 0, 30], width_mm: 9, height_mm: 9, look_at_mm: [100, 0, -300]}",
        "sphere: {at_mm: [0, 0, 40], radius_mm: 19.999999}",
        "sphere: {at_mm: [900000, 0, 1], radius_mm: 1.0e-6}",
        "environment: {image: %s}",
    };
    write_sky(1e30f);
    for (size_t i = 0; i < sizeof lights / sizeof *lights; i++)
        for (size_t k = 0; k < sizeof extreme_paints / sizeof *extreme_paints; k++) {
            char light[256];
            struct planes planes;
            struct render_report report;
            snprintf(light, sizeof light, lights[i], sky_file);
            struct scene *scene =
                scene_of("materials: [{name: m, uniform: 1.3, %s}]\n"
                         "shapes:\n  - sphere: {material: m, radius_mm: 20}\n"
                         "  - rectangle: {material: m, width_mm: 60, height_mm: 60}\nlights: [%s]\n"
                         "camera: {perspective: {position_mm: [0, -80, 1], look_at_mm: [0, 0, 1], up: [0, 0, "
                         "1], height_deg: 60}}\n"
                         "image: {width: 8, height: 8, grid: 1, samples: 8}\n",
                         extreme_paints[k], light);
            planes_of(scene, &(struct render_options){.threads = 1, .all_features = true}, &planes, &report);
            all_is_finite(&planes);
            planes_free(&planes);
            scene_free(scene);
        }
    unlink(sky_file);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lambert_under_a_panel_is_the_form_factor),
        cmocka_unit_test(a_white_sphere_in_a_white_sky_is_white),
        cmocka_unit_test(a_white_fold_in_a_white_sky_is_white),
        cmocka_unit_test(a_ball_far_away_is_a_beam),
        cmocka_unit_test(recolouring_is_rendering),
        cmocka_unit_test(same_bits_for_any_number_of_threads),
        cmocka_unit_test(left_out_agrees_with_all_features),
        cmocka_unit_test(what_hides_a_part_of_a_light_makes_half_shadow),
        cmocka_unit_test(extremes_are_numbers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
