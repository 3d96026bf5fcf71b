#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/intersect.h"
#include "fit/render/path.h"
#include "tests/support/render_scene.h"

#define TWO_PAINTS                                                                                           \
    "materials:\n"                                                                                           \
    "  - {name: m, spectrum: green.csv, sigma: 0.3, gamma: 0.1, beta_prime: 7.6, n: 1.7}\n"                  \
    "  - {name: k, uniform: 0.8, sigma: 0.5, gamma: 0.2, beta_prime: 15.7, n: 1.7}\n"

/* Configuration factor of a small piece, t from the edge and y along it, to the square of side 1 that stands upright
 * on that edge (Howell's catalogue, B-5: each half by the rectangle that begins opposite the piece). */
static double seen_square(double t, double y) {
    double sum = 0;
    for (int side = -1; side <= 1; side += 2) {
        double along = 0.5 + side * y, root = hypot(t, 1);
        sum += (atan(along / t) - t / root * atan(along / root)) / (2 * M_PI);
    }
    return sum;
}

/* Means over the square of its factor and of the square of that: midpoints, denser towards the edge. */
static void mean_factors(double *first, double *second) {
    *first = *second = 0;
    for (int i = 0; i < 400; i++)
        for (int j = 0; j < 400; j++) {
            double x = (i + 0.5) / 400, f = seen_square(x * x, (j + 0.5) / 400 - 0.5), part = 2 * x / 160000;
            *first += part * f;
            *second += part * f * f;
        }
}

/* The mean of the indirect light, band 40, over what is shown. */
static double mean_indirect(const struct scene *scene, int threads) {
    struct planes planes;
    struct render_report report;
    planes_of(scene, &(struct render_options){.threads = threads}, &planes, &report);
    double sum = 0, samples = scene->image.grid * scene->image.grid;
    for (int i = 0; i < planes.width * planes.height && planes.set[0].indirect; i++)
        sum += planes.set[0].indirect[i * BANDS + 40];
    planes_free(&planes);
    return sum * samples / (double)report.counts.hits;
}

/* Two perpendicular squares that meet, matt, lit evenly: what each bounce adds is known. The mean over A of light that
 * went A, B, A, is the mean of the squared factor, since the kernel is symmetric. */
static void a_matt_fold_has_the_radiosity_that_is_known(void **state) {
    (void)state;
    struct scene *scene = scene_of("materials: [{name: m, uniform: 0.8, model: lambert}]\n"
                                   "shapes: [fold: {material: m, width_mm: 20, length_mm: 20}]\n"
                                   "lights: [beam: {theta_deg: 0}]\n"
                                   "camera: {orthographic: {height_mm: 30}}\n"
                                   "image: {width: 90, height: 90, grid: 2, bounces: 2}\n");
    double first, second, lit = M_SQRT1_2;
    mean_factors(&first, &second);
    assert_true(fabs(first - 0.20004378) < 2e-6); /* the textbook's two squares */
    double two = mean_indirect(scene, 0);
    scene->image.bounces = 3;
    double three = mean_indirect(scene, 0);
    /* 65,000 paths, spread evenly in each pixel: 0.3 %; of the second bounce 0.6 %. */
    if (!(fabs(two / (0.64 * lit * first) - 1) < 0.01))
        fail_msg("%g, expected %g", two, 0.64 * lit * first);
    if (!(fabs((three - two) / (0.512 * lit * second) - 1) < 0.02))
        fail_msg("%g, expected %g", three - two, 0.512 * lit * second);
    scene_free(scene);
}

struct walk { /* paths from the middle of the picture of a scene */
    struct scene *scene;
    struct trace trace;
    struct hit hit;
    struct vec3 v;
    struct render_counts counts;
};

static void walk_from(struct walk *w, struct scene *scene, enum energy_policy policy) {
    struct energy *energy = calloc(SCENE_PAINTS, sizeof *energy);
    struct aim *aim = calloc(1, sizeof *aim);
    struct glints *glints = calloc(1, sizeof *glints);
    *w = (struct walk){.scene = scene};
    for (int p = 0; p < scene->n_paints; p++)
        energy_make(&energy[p], &scene->paint[p], policy);
    w->trace = (struct trace){.scene = scene,
                              .shade_features = PATH_FEATURES,
                              .shadow_rays = true,
                              .half = calloc(SCENE_PAINTS, sizeof *w->trace.half),
                              .energy = energy,
                              .aim = aim,
                              .glints = glints};
    aim_make(aim, scene);
    glint_make(glints, scene, aim, energy);
    struct ray ray = camera_ray(&scene->camera, 0.4 * scene->image.width, 0.5 * scene->image.height);
    assert_true(intersect_nearest(scene, &ray, &w->hit));
    w->v = vec3_scale(ray.direction, -1);
}

static void walk_free(struct walk *w) {
    free((void *)w->trace.energy);
    free((void *)w->trace.aim);
    free((void *)w->trace.glints);
    free(w->trace.half);
    scene_free(w->scene);
}

static void walk_path(struct walk *w, uint32_t sample, struct path *path) {
    struct sampler sampler;
    struct path_place place;
    sampler_start(&sampler, 1, 0, sample);
    path_begin(&w->trace, &w->hit, w->v, &place);
    path_find(&w->trace, &place, &sampler, path, &w->counts);
}

#define GLOSSY_FOLD(material, bounces)                                                                       \
    scene_of(TWO_PAINTS "shapes: [fold: {" material ", width_mm: 20, length_mm: 30, angle_deg: 70}]\n"       \
                        "lights: [beam: {theta_deg: 10}]\n"                                                  \
                        "camera: {orthographic: {height_mm: 20}}\n"                                          \
                        "image: {width: 60, height: 60, grid: 1, bounces: " #bounces "}\n")

/* Of one paint a path is a polynomial in S, of a degree of 2 for each surface: its numbers, multiplied out, say at every
 * band what the 81 sums say. */
static void a_path_is_a_polynomial_in_s(void **state) {
    (void)state;
    struct walk w;
    int longest = 0;
    walk_from(&w, GLOSSY_FOLD("material: m", 6), ENERGY_SCALE);
    for (uint32_t n = 0; n < 2000; n++) {
        struct path path;
        double spectrum[1][BANDS] = {{0}}, carried[2 * PATH_STEPS + 3] = {1}, sum[2 * PATH_STEPS + 3] = {0};
        walk_path(&w, n, &path);
        path_carry(&path, w.scene, 1, spectrum);
        for (int i = 0; i < path.n; i++) {
            const struct shade_abc x = path.step[i].scatter, d = path.step[i].light[0];
            for (int p = 2 * i + 2; p >= 0; p--)
                carried[p] = x.c * carried[p] + (p > 0 ? x.a * carried[p - 1] : 0) +
                             (p > 1 ? x.b * carried[p - 2] : 0);
            for (int p = 0; p <= 2 * i + 4; p++)
                sum[p] += d.c * carried[p] + (p > 0 ? d.a * carried[p - 1] : 0) +
                          (p > 1 ? d.b * carried[p - 2] : 0);
        }
        for (int k = 0; k < BANDS; k++) {
            double s = w.scene->paint[0].s[k], value = 0;
            for (int p = 2 * path.n + 2; p >= 0; p--)
                value = value * s + sum[p];
            if (!(fabs(spectrum[0][k] - value) <= 1e-12 * value))
                fail_msg("path %u, band %d: %.17g, polynomial %.17g", n, k, spectrum[0][k], value);
        }
        longest = path.n > longest ? path.n : longest;
    }
    assert_true(longest > PATH_SURE);
    walk_free(&w);
}

/* Which directions are drawn more often changes the noise, not the mean. */
static void the_mean_does_not_depend_on_how_directions_are_drawn(void **state) {
    (void)state;
    double mean[3], spread[3];
    for (int k = 0; k < 3; k++) {
        struct walk w;
        double sum = 0, squares = 0;
        int n = 1 << 16, groups = 64;
        walk_from(&w, GLOSSY_FOLD("materials: [k, k]", 4), ENERGY_SCALE);
        struct energy *energy = (struct energy *)w.trace.energy;
        for (int i = 0; i < ENERGY_ANGLES; i++)
            energy[1].share[i] = k == 1 ? 0.9 : 0.1;
        if (k == 2) /* by cosine and facets alone */
            ((struct aim *)w.trace.aim)->n = ((struct glints *)w.trace.glints)->n = 0;
        for (int g = 0; g < groups; g++) {
            double spectrum[1][BANDS] = {{0}};
            for (int i = 0; i < n / groups; i++) {
                struct path path;
                walk_path(&w, (uint32_t)(g * (n / groups) + i), &path);
                path_carry(&path, w.scene, groups / (double)n, spectrum);
            }
            sum += spectrum[0][30] / groups;
            squares += spectrum[0][30] * spectrum[0][30] / groups;
        }
        mean[k] = sum;
        spread[k] = sqrt((squares - sum * sum) / (groups - 1));
        walk_free(&w);
    }
    /* Evenly spread samples err by less than groups of them would tell. */
    for (int k = 0; k < 3; k++) {
        assert_true(spread[k] < 0.02 * mean[k]);
        if (!(fabs(mean[k] - mean[0]) <= 4 * hypot(spread[k], spread[0])))
            fail_msg("way %d: %g +- %g, first way %g +- %g", k, mean[k], spread[k], mean[0], spread[0]);
    }
    assert_true(spread[2] > spread[0]); /* that is what aiming is for */
}

/* In a narrow fold of a paint that returns more than it receives the bounces grow; scaled they fade. */
static void scaled_bounces_fade(void **state) {
    (void)state;
    for (int policy = ENERGY_SCALE; policy <= ENERGY_REPORT; policy++) {
        struct walk w;
        double order[16] = {0};
        walk_from(
            &w,
            scene_of("materials: [{name: m, uniform: 1, sigma: 0.2, gamma: 0.2, beta_prime: 40, n: 1.7}]\n"
                     "shapes: [fold: {material: m, width_mm: 200, length_mm: 2000, angle_deg: 4}]\n"
                     "lights: [beam: {theta_deg: 0}]\n"
                     "camera: {orthographic: {height_mm: 4}}\n"
                     "image: {width: 60, height: 60, grid: 1, bounces: 17}\n"),
            (enum energy_policy)policy);
        for (uint32_t n = 0; n < 20000; n++) {
            struct path path;
            walk_path(&w, n, &path);
            double carried = 1;
            for (int i = 0; i < path.n; i++) {
                const struct shade_abc x = path.step[i].scatter, d = path.step[i].light[0];
                carried *= x.a + x.b + x.c;
                order[i] += carried * (d.a + d.b + d.c) / 20000;
            }
        }
        if (policy == ENERGY_SCALE ? !(order[15] < order[7]) : !(order[15] > order[7]))
            fail_msg("policy %d: %g at the eighth step, %g at the sixteenth", policy, order[7], order[15]);
        walk_free(&w);
    }
}

/* At every pair of angles the scaled albedo is at most 1, and the scale the same both ways. */
static void the_scale_is_symmetric_and_enough(void **state) {
    (void)state;
    struct scene *scene = GLOSSY_FOLD("material: m", 2);
    struct energy energy, told;
    energy_make(&energy, &scene->paint[1], ENERGY_SCALE);
    energy_make(&told, &scene->paint[1], ENERGY_REPORT);
    assert_true(energy.excess[0] > 1.01); /* else this shows nothing */
    for (int i = 1; i <= 20; i++)
        for (int r = 1; r <= 20; r++) {
            double scale = energy_scale(&energy, i / 20.0, r / 20.0);
            assert_true(scale == energy_scale(&energy, r / 20.0, i / 20.0));
            assert_true(scale <= 1 && energy_scale(&told, i / 20.0, r / 20.0) == 1);
        }
    scene_free(scene);
}

/* Light and camera change places: what the whole picture shows is the same, band by band. */
static void light_and_camera_may_change_places(void **state) {
    (void)state;
    double total[2] = {0, 0};
    for (int k = 0; k < 2; k++) {
        struct planes planes;
        struct render_report report;
        /* 25 deg towards the right is from (tan 25, 0, 1). */
        struct scene *scene = scene_of(
            TWO_PAINTS "shapes: [fold: {materials: [m, k], width_mm: 20, length_mm: 30, angle_deg: 80}]\n"
                       "lights: [beam: {theta_deg: %s}]\n"
                       "camera: {orthographic: {height_mm: 60, from: %s}}\n"
                       "image: {width: 80, height: 80, grid: 6, bounces: 4}\n",
            k ? "-10" : "25", k ? "[0.4663076581549986, 0, 1]" : "[-0.17632698070846498, 0, 1]");
        planes_of(scene, &(struct render_options){0}, &planes, &report);
        for (int i = 0; i < 80 * 80; i++)
            total[k] += planes.set[0].indirect[i * BANDS + 35];
        planes_free(&planes);
        scene_free(scene);
    }
    if (!(fabs(total[0] / total[1] - 1) < 0.01)) /* what counts as seen, by a grid of samples: 0.4 % */
        fail_msg("%g one way, %g the other", total[0], total[1]);
}

static void same_bits_for_any_number_of_threads(void **state) {
    (void)state;
    struct scene *scene = scene_of(TWO_PAINTS "shapes:\n"
                                              "  - fold: {materials: [m, k], width_mm: 20, length_mm: 30}\n"
                                              "  - sphere: {material: m, radius_mm: 5, at_mm: [2, 0, 15]}\n"
                                              "lights:\n"
                                              "  - beam: {theta_deg: 25, weight: 3}\n"
                                              "  - beam: {theta_deg: 60, azimuth_deg: 200, spd: A}\n"
                                              "camera: {orthographic: {height_mm: 40}}\n"
                                              "image: {width: 45, height: 39, grid: 2, bounces: 5}\n");
    struct planes one, other;
    struct render_report report[2];
    planes_of(scene, &(struct render_options){.threads = 1}, &one, &report[0]);
    for (int threads = 2; threads <= 5; threads++) {
        planes_of(scene, &(struct render_options){.threads = threads}, &other, &report[1]);
        for (int j = 0; j < 2; j++) {
            assert_memory_equal(one.set[j].a, other.set[j].a, 45 * 39 * sizeof(double));
            assert_memory_equal(one.set[j].indirect, other.set[j].indirect, 45 * 39 * BANDS * sizeof(float));
        }
        assert_memory_equal(&report[0].counts, &report[1].counts, sizeof report[0].counts);
        planes_free(&other);
    }
    planes_free(&one);
    scene_free(scene);
}

/* Where nothing is seen from any surface no path is followed and no spectrum held; far apart within the bound. */
static void what_no_surface_sees_is_left_out(void **state) {
    (void)state;
    static const char *const shapes[] = {
        "cylinder: {material: m, radius_mm: 10, length_mm: 30, turn_deg: [0, 0, 17]}",
        "fold: {material: m, width_mm: 10, length_mm: 30, angle_deg: 180}",
        "sphere: {material: m, radius_mm: 0.01}\n  - sphere: {material: m, radius_mm: 0.01, at_mm: [20, 0, "
        "0]}"};
    for (int i = 0; i < 3; i++) {
        struct scene *scene = scene_of("materials: [{name: m, uniform: 0.5, sigma: 0.3}]\n"
                                       "shapes:\n  - %s\nlights: [beam: {theta_deg: 25}]\n"
                                       "camera: {orthographic: {height_mm: %s}}\n"
                                       "image: {width: 30, height: 30, grid: 1, bounces: 5}\n",
                                       shapes[i], i < 2 ? "40" : "0.03");
        struct planes few, all;
        struct render_report report, whole;
        planes_of(scene, &(struct render_options){.threads = 1}, &few, &report);
        planes_of(scene, &(struct render_options){.threads = 1, .all_features = true}, &all, &whole);
        assert_false(report.features.line[FEATURE_INTERREFLECTION].kept);
        assert_false(report.features.line[FEATURE_WAVELENGTHS].kept);
        assert_true(report.counts.indirect_rays == 0 && whole.counts.indirect_rays > 0);
        assert_null(few.set[0].indirect);
        assert_non_null(all.set[0].indirect);
        assert_true((report.features.line[FEATURE_INTERREFLECTION].bound > 0) == (i == 2));
        double *lean = xyz_of(scene, &few, false), *full = xyz_of(scene, &all, true);
        for (int k = 0; k < 3 * 900; k++)
            assert_true(fabs(lean[k] - full[k]) <= 1.1 * features_bound(&report.features));
        free(lean);
        free(full);
        planes_free(&few);
        planes_free(&all);
        scene_free(scene);
    }
}

static void a_fold_keeps_it(void **state) {
    (void)state;
    struct scene *scene = GLOSSY_FOLD("material: m", 3);
    struct features features;
    features_find(scene, false, &features);
    assert_true(features.line[FEATURE_INTERREFLECTION].kept && features.line[FEATURE_WAVELENGTHS].kept);
    scene->image.bounces = 1;
    features_find(scene, false, &features);
    assert_false(features.line[FEATURE_INTERREFLECTION].kept || features.line[FEATURE_WAVELENGTHS].kept);
    scene_free(scene);
}

/* What is left out of the first bounce stays within its bound; what comes after it is the same to the bit. */
static void a_fold_leaves_out_within_its_bound(void **state) {
    (void)state;
    struct scene *scene = GLOSSY_FOLD("materials: [m, k]", 3);
    struct planes few, all;
    struct render_report report, whole;
    planes_of(scene, &(struct render_options){.threads = 1}, &few, &report);
    planes_of(scene, &(struct render_options){.threads = 1, .all_features = true}, &all, &whole);
    assert_false(report.features.line[FEATURE_LOBE_TAIL].kept);
    assert_memory_equal(few.set[0].indirect, all.set[0].indirect, 3600 * BANDS * sizeof(float));
    double *lean = xyz_of(scene, &few, false), *full = xyz_of(scene, &all, true);
    for (int k = 0; k < 3 * 3600; k++)
        assert_true(fabs(lean[k] - full[k]) <= 1.1 * features_bound(&report.features));
    free(lean);
    free(full);
    planes_free(&few);
    planes_free(&all);
    scene_free(scene);
}

/* No paint of the list of extremes makes a NaN or an infinity, scaled or not. */
static void extremes_stay_finite(void **state) {
    (void)state;
    static const char *const paints[] = {
        "uniform: 0",
        "uniform: 7, sigma: 0.3",
        "uniform: 1, sigma: 1.0e+8, beta_prime: 1, gamma: 0.1",
        "uniform: 1, sigma: 1.0e-8, beta_prime: 1.0e+6, gamma: 1.0e-6",
        "uniform: 0, beta_prime: 1.0e+12, gamma: 1.0e-3, n: 10",
        "uniform: 0.5, beta_prime: 1.0e+12, gamma: 1000, n: 10",
        "uniform: 0.5, beta_prime: 1.0e-12, gamma: 1.0e-9, n: 1",
        "uniform: 0.5, beta_prime: 1.0e+50, gamma: 0.01, n: 1.0001",
        "uniform: 0.9, model: heavy-tail, tail: 2, beta_prime: 1.0e+6, gamma: 1.0e-3, n: 2.42",
        "uniform: 0.9, model: two-lobe, beta_prime: 0, gamma: 1, beta_prime_2: 1.0e+6, gamma_2: 1.0e-4",
        "uniform: 0.9, sigma: 1, model: transmitted, n_d: 10, beta_prime: 5, gamma: 0.2",
    };
    for (size_t i = 0; i < 2 * sizeof paints / sizeof *paints; i++) {
        struct scene *scene =
            scene_of("materials: [{name: m, %s}]\n"
                     "shapes:\n  - fold: {material: m, width_mm: 20, length_mm: 30}\n"
                     "  - sphere: {material: m, radius_mm: 4, at_mm: [0, 0, 15]}\n"
                     "lights:\n  - beam: {theta_deg: 89.999}\n  - beam: {theta_deg: 0}\n"
                     "camera: {orthographic: {height_mm: 40}}\n"
                     "image: {width: 12, height: 12, grid: 1, bounces: 6, samples: 16, energy: %s}\n",
                     paints[i / 2], i % 2 ? "report" : "scale");
        struct planes planes;
        struct render_report report;
        planes_of(scene, &(struct render_options){.threads = 1}, &planes, &report);
        assert_non_null(planes.set[0].indirect);
        for (int k = 0; k < 144 * BANDS; k++)
            if (!(planes.set[0].indirect[k] >= 0 && isfinite(planes.set[0].indirect[k])))
                fail_msg("%s: %g", paints[i / 2], planes.set[0].indirect[k]);
        planes_free(&planes);
        scene_free(scene);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_matt_fold_has_the_radiosity_that_is_known),
        cmocka_unit_test(a_path_is_a_polynomial_in_s),
        cmocka_unit_test(the_mean_does_not_depend_on_how_directions_are_drawn),
        cmocka_unit_test(scaled_bounces_fade),
        cmocka_unit_test(the_scale_is_symmetric_and_enough),
        cmocka_unit_test(light_and_camera_may_change_places),
        cmocka_unit_test(same_bits_for_any_number_of_threads),
        cmocka_unit_test(what_no_surface_sees_is_left_out),
        cmocka_unit_test(a_fold_keeps_it),
        cmocka_unit_test(a_fold_leaves_out_within_its_bound),
        cmocka_unit_test(extremes_stay_finite),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
