#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/units.h"
#include "sim/sim.h"
#include "tests/support/render_scene.h"

#define WHITE "materials: [{name: m, uniform: 1, model: lambert}]\n"
#define GREEN                                                                                                \
    "materials:\n"                                                                                           \
    "  - {name: m, spectrum: green.csv, sigma: 0.3, gamma: 0.07, beta_prime: 7.6, n: 1.7}\n"                 \
    "  - {name: k, uniform: 0.4, sigma: 0.5, gamma: 0.2, beta_prime: 15.7, n: 1.7}\n"
#define THETA_DEG 25.0

static struct vec3 beam(void) {
    return (struct vec3){sin(rad_from_deg(THETA_DEG)), 0, cos(rad_from_deg(THETA_DEG))};
}

/* a at pixel centres against the cosine of the light to the known normal; the peak is 1. */
static void lambert_sphere_to_ten_digits(void **state) {
    (void)state;
    struct scene *scene = scene_of(WHITE "shapes: [sphere: {material: m, radius_mm: 20, at_mm: [3, -2, 7]}]\n"
                                         "lights: [beam: {theta_deg: 25}]\n"
                                         "camera: {orthographic: {height_mm: 50}}\n"
                                         "image: {width: 150, height: 100, grid: 1}\n");
    struct planes planes;
    struct render_report report;
    planes_of(scene, &(struct render_options){0}, &planes, &report);
    struct vec3 l = beam();
    int seen = 0;
    for (int y = 0; y < 100; y++)
        for (int x = 0; x < 150; x++) {
            double u = ((x + 0.5 - 75) * 0.5 - 3) / 20, v = ((50 - y - 0.5) * 0.5 + 2) / 20,
                   r2 = u * u + v * v;
            size_t i = (size_t)(y * 150 + x);
            assert_int_equal(planes.paint[i] >= 0, r2 <= 1);
            if (r2 > 1)
                continue;
            double expected = fmax(0, u * l.x + v * l.y + sqrt(1 - r2) * l.z);
            if (!(fabs(planes.set[0].a[i] - expected) < 1e-10))
                fail_msg("%d, %d: %.17g, expected %.17g", x, y, planes.set[0].a[i], expected);
            seen++;
        }
    assert_int_equal(seen, report.counts.hits);
    assert_int_equal(report.counts.camera_rays, 15000);
    assert_int_equal(report.counts.shadow_rays, 0);
    assert_null(planes.set[0].b);
    assert_null(planes.set[0].c);
    planes_free(&planes);
    scene_free(scene);
}

static void lambert_cylinder_to_ten_digits(void **state) {
    (void)state;
    struct scene *scene = scene_of(
        WHITE "shapes: [cylinder: {material: m, radius_mm: 20, length_mm: 60, turn_deg: [0, 0, 17]}]\n"
              "lights: [beam: {theta_deg: 25}]\n"
              "camera: {orthographic: {height_mm: 80}}\n"
              "image: {width: 128, height: 128, grid: 1}\n");
    struct planes planes;
    struct render_report report;
    planes_of(scene, &(struct render_options){0}, &planes, &report);
    double c = cos(rad_from_deg(17)), s = sin(rad_from_deg(17));
    struct vec3 l = beam();
    int seen = 0;
    for (int y = 0; y < 128; y++)
        for (int x = 0; x < 128; x++) {
            double px = (x + 0.5 - 64) * 0.625, py = (64 - y - 0.5) * 0.625;
            double across = (px * c + py * s) / 20, along = py * c - px * s;
            size_t i = (size_t)(y * 128 + x);
            bool inside = fabs(across) < 1 && fabs(along) < 30;
            assert_int_equal(planes.paint[i] >= 0, inside);
            if (!inside)
                continue;
            double expected = fmax(0, across * c * l.x + sqrt(1 - across * across) * l.z);
            if (!(fabs(planes.set[0].a[i] - expected) < 1e-10))
                fail_msg("%d, %d: %.17g, expected %.17g", x, y, planes.set[0].a[i], expected);
            seen++;
        }
    assert_true(seen > 2000);
    planes_free(&planes);
    scene_free(scene);
}

/* Turned towards the camera it shows the disc at its end, and open nothing: one does not see a surface from behind. */
static void a_cylinder_ends_in_discs_unless_it_is_open(void **state) {
    (void)state;
    for (int open = 0; open < 2; open++) {
        struct scene *scene = scene_of(
            WHITE "shapes: [cylinder: {material: m, radius_mm: 20, length_mm: 60, turn_deg: [90, 0, 0], "
                  "open: %s}]\n"
                  "lights: [beam: {theta_deg: 25}]\n"
                  "camera: {orthographic: {height_mm: 50}}\nimage: {width: 50, height: 50, grid: 1}\n",
            open ? "true" : "false");
        struct planes planes;
        struct render_report report;
        planes_of(scene, &(struct render_options){0}, &planes, &report);
        for (int i = 0; i < 2500; i++) {
            double x = i % 50 - 24.5, y = i / 50 - 24.5;
            bool shown = !open && x * x + y * y <= 400;
            assert_int_equal(planes.paint[i] >= 0, shown);
            assert_true(!shown || fabs(planes.set[0].a[i] - cos(rad_from_deg(THETA_DEG))) < 1e-15);
        }
        planes_free(&planes);
        scene_free(scene);
    }
}

/* Seen from far away through a small angle, perspective is parallel. */
static void perspective_far_away_is_parallel(void **state) {
    (void)state;
    struct planes planes[2];
    struct render_report report;
    const char *cameras[] = {"orthographic: {height_mm: 80}",
                             "perspective: {position_mm: [0, 0, 1.0e+6], height_deg: 0.00458366236}"};
    for (int i = 0; i < 2; i++) {
        struct scene *scene =
            scene_of(GREEN "shapes: [cylinder: {material: m, radius_mm: 20, length_mm: 60}]\n"
                           "lights: [beam: {theta_deg: 25}]\ncamera: {%s}\n"
                           "image: {width: 40, height: 40, grid: 1}\n",
                     cameras[i]);
        planes_of(scene, &(struct render_options){0}, &planes[i], &report);
        scene_free(scene);
    }
    for (int i = 0; i < 1600; i++)
        assert_true(fabs(planes[0].set[0].a[i] - planes[1].set[0].a[i]) < 1e-4);
    planes_free(&planes[0]);
    planes_free(&planes[1]);
}

#define TWO_LIGHTS                                                                                           \
    "shapes:\n"                                                                                              \
    "  - cylinder: {material: m, radius_mm: 20, length_mm: 60, turn_deg: [20, 0, 17]}\n"                     \
    "  - sphere: {material: k, radius_mm: 12, at_mm: [15, 5, 25]}\n"                                         \
    "lights:\n"                                                                                              \
    "  - beam: {theta_deg: 25, weight: 3}\n"                                                                 \
    "  - beam: {theta_deg: 60, azimuth_deg: 200, spd: A}\n"

static void same_bits_for_any_number_of_threads(void **state) {
    (void)state;
    struct scene *scene = scene_of(GREEN TWO_LIGHTS "camera: {orthographic: {height_mm: 80}}\n"
                                                    "image: {width: 90, height: 75, grid: 2}\n");
    struct planes one, other;
    struct render_report report[2];
    planes_of(scene, &(struct render_options){.threads = 1}, &one, &report[0]);
    assert_true(one.n_extra > 0 && report[0].counts.shadow_rays > 0);
    for (int threads = 2; threads <= 5; threads++) {
        size_t size = 90 * 75 * sizeof(double);
        planes_of(scene, &(struct render_options){.threads = threads}, &other, &report[1]);
        for (int j = 0; j < 2; j++) {
            assert_memory_equal(one.set[j].a, other.set[j].a, size);
            assert_memory_equal(one.set[j].b, other.set[j].b, size);
            assert_memory_equal(one.set[j].c, other.set[j].c, size);
        }
        assert_memory_equal(one.paint, other.paint, 90 * 75 * sizeof *one.paint);
        assert_int_equal(one.n_extra, other.n_extra);
        for (size_t i = 0; i < one.n_extra; i++) {
            assert_int_equal(one.extra[i].pixel, other.extra[i].pixel);
            assert_memory_equal(&one.extra[i].abc, &other.extra[i].abc, sizeof one.extra[i].abc);
        }
        assert_memory_equal(&report[0].counts, &report[1].counts, sizeof report[0].counts);
        planes_free(&other);
    }
    planes_free(&one);
    scene_free(scene);
}

/* A wall of light: the sphere in front casts its shadow on the one behind. */
static void what_stands_in_the_light_casts_a_shadow(void **state) {
    (void)state;
    struct scene *scene = scene_of(WHITE "shapes:\n"
                                         "  - sphere: {material: m, radius_mm: 20}\n"
                                         "  - sphere: {material: m, radius_mm: 5, at_mm: [70, 0, 70]}\n"
                                         "lights: [beam: {theta_deg: 45}]\n"
                                         "camera: {orthographic: {height_mm: 60}}\n"
                                         "image: {width: 61, height: 61, grid: 1}\n");
    struct planes planes;
    struct render_report report;
    planes_of(scene, &(struct render_options){0}, &planes, &report);
    int row = 30 * 61, x = 30 + (int)lround(20 * sqrt(0.5) / 60 * 61); /* its normal points at the light */
    assert_true(planes.paint[row + x] == 0 && planes.set[0].a[row + x] == 0);
    assert_true(planes.set[0].a[row + 30] > 0.69);
    planes_free(&planes);
    scene_free(scene);
}

static double largest_difference(const double *a, const double *b, size_t n) {
    double largest = 0;
    for (size_t i = 0; i < n; i++)
        largest = fmax(largest, fabs(a[i] - b[i]));
    return largest;
}

/* One row for each thing that a scene may not need; the part must be left out, and the picture within the bound. */
static void left_out_agrees_with_all_features(void **state) {
    (void)state;
    static const struct {
        enum feature feature;
        const char *materials, *more;
    } cases[] = {
        {FEATURE_SPECULAR, "materials: [{name: m, uniform: 0.7, sigma: 0.4}]", ""},
        {FEATURE_SPECULAR, "materials: [{name: m, uniform: 0.7, sigma: 0.4, beta_prime: 1.0e-6}]", ""},
        {FEATURE_LOBE_TAIL, "materials: [{name: m, uniform: 0.7, sigma: 0.4, beta_prime: 126, gamma: 0.05}]",
         ""},
        {FEATURE_LOBE_TAIL, "materials: [{name: m, uniform: 0.7, beta_prime: 1.0e+6, gamma: 0.01}]", ""},
        {FEATURE_SIGMA, "materials: [{name: m, spectrum: green.csv, beta_prime: 7.6}]", ""},
        {FEATURE_SIGMA, "materials: [{name: m, uniform: 0.7, sigma: 2.0e-4, beta_prime: 7.6}]", ""},
        {FEATURE_RELATIVES, GREEN, ""},
        {FEATURE_LOBE_TAIL,
         "materials: [{name: m, uniform: 0.7, model: heavy-tail, tail: 0.1, beta_prime: 20, gamma: 0.02}]",
         ""},
        {FEATURE_LOBE_TAIL,
         "materials: [{name: m, uniform: 0.7, model: two-lobe, beta_prime: 126, gamma: 0.01, beta_prime_2: "
         "1, gamma_2: 0.05}]",
         ""},
        {FEATURE_LOBE_TAIL,
         "materials: [{name: m, uniform: 0.7, sigma: 0.3, model: transmitted, n_d: 1.4, beta_prime: 2}]", ""},
        {FEATURE_EACH_DIRECTION, GREEN, ""},
        {FEATURE_SHADOW_RAYS, GREEN, ""},
        {FEATURE_WAVELENGTHS, GREEN, ""},
        {FEATURE_LIGHTS, GREEN, "  - beam: {theta_deg: -40, weight: 0}\n"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct scene *scene = scene_of(
            "%s\nshapes: [cylinder: {material: m, radius_mm: 20, length_mm: 60, turn_deg: [0, 0, 17]}]\n"
            "lights:\n  - beam: {theta_deg: 25}\n%s"
            "camera: {orthographic: {height_mm: 70}}\nimage: {width: 60, height: 60, grid: 2}\n",
            cases[i].materials, cases[i].more);
        struct planes few, all;
        struct render_report report, whole;
        planes_of(scene, &(struct render_options){0}, &few, &report);
        planes_of(scene, &(struct render_options){.all_features = true}, &all, &whole);
        assert_false(report.features.line[cases[i].feature].kept);
        assert_true(whole.features.line[cases[i].feature].kept);
        assert_true(features_bound(&whole.features) == 0);
        double *lean = xyz_of(scene, &few, false), *full = xyz_of(scene, &all, true);
        double apart = largest_difference(lean, full, 3 * 3600), bound = features_bound(&report.features);
        /* Z of a white runs to 1.09 times its Y. */
        if (!(apart <= 1.1 * bound))
            fail_msg("case %zu: %.3g apart, bound %.3g", i, apart, bound);
        assert_true(few.bytes <= all.bytes);
        free(lean);
        free(full);
        planes_free(&few);
        planes_free(&all);
        scene_free(scene);
    }
}

/* A black paint shows nothing of its roughness, but its planes may be coloured with another S. */
static void what_a_new_s_would_show_is_not_left_out(void **state) {
    (void)state;
    struct planes black, grey;
    struct render_report report;
    struct scene *scene[2];
    for (int i = 0; i < 2; i++) {
        scene[i] =
            scene_of("materials: [{name: m, uniform: %s, sigma: 0.4, beta_prime: 7.6}]\n"
                     "shapes: [sphere: {material: m, radius_mm: 20}]\nlights: [beam: {theta_deg: 60}]\n"
                     "camera: {orthographic: {height_mm: 50}}\nimage: {width: 20, height: 20}\n",
                     i ? "0.5" : "0");
        planes_of(scene[i], &(struct render_options){0}, i ? &grey : &black, &report);
        assert_true(report.features.line[FEATURE_SIGMA].kept);
    }
    memcpy(scene[0]->paint[0].s, scene[1]->paint[0].s, sizeof scene[0]->paint[0].s);
    double *recoloured = xyz_of(scene[0], &black, false), *rendered = xyz_of(scene[1], &grey, false);
    assert_memory_equal(recoloured, rendered, 3 * 400 * sizeof *rendered);
    for (int i = 0; i < 2; i++)
        scene_free(scene[i]);
    planes_free(&black);
    planes_free(&grey);
    free(recoloured);
    free(rendered);
}

static void what_is_left_out_takes_no_memory_and_no_rays(void **state) {
    (void)state;
    struct scene *scene =
        scene_of(WHITE "shapes: [sphere: {material: m, radius_mm: 20}]\n"
                       "lights: [beam: {theta_deg: 25}]\ncamera: {orthographic: {height_mm: 50}}\n"
                       "image: {width: 50, height: 50, grid: 1}\n");
    struct planes few, all;
    struct render_report report;
    planes_of(scene, &(struct render_options){0}, &few, &report);
    assert_int_equal(report.counts.shadow_rays, 0);
    planes_of(scene, &(struct render_options){.all_features = true}, &all, &report);
    assert_true(report.counts.shadow_rays > 0);
    assert_true(few.noise == NULL && report.counts.drawn > 0);
    assert_int_equal(all.bytes - few.bytes, 3 * 2500 * sizeof(double)); /* b, c, noise */
    assert_memory_equal(few.set[0].a, all.set[0].a, 2500 * sizeof(double));
    planes_free(&few);
    planes_free(&all);
    scene_free(scene);
}

/* The camera's rays are traced for the first picture alone; every picture has the same bits as by itself. */
static void a_series_meets_the_scene_once(void **state) {
    (void)state;
    struct scene *scene =
        scene_of(GREEN "shapes:\n"
                       "  - cylinder: {material: m, radius_mm: 9, length_mm: 30, turn_deg: [0, 0, 17]}\n"
                       "  - sphere: {material: k, radius_mm: 6, at_mm: [14, 3, 9]}\n"
                       "lights: [beam: {theta_deg: [-70, 0, 50]}]\n"
                       "camera: {perspective: {position_mm: [5, 9, 90], height_deg: 40}}\n"
                       "image: {width: 40, height: 30, grid: 2}\n");
    struct render_hits hits = {0};
    size_t size = 1200 * sizeof(double);
    for (int k = 0; k < 3; k++) {
        struct planes p, q;
        struct render_report kept, anew;
        scene_aim(scene, k);
        planes_of(scene, &(struct render_options){.threads = 1 + k % 2, .hits = &hits}, &p, &kept);
        planes_of(scene, &(struct render_options){0}, &q, &anew);
        assert_false(kept.features.line[FEATURE_EACH_PICTURE].kept);
        assert_int_equal(kept.counts.camera_rays, k == 0 ? 4800 : 0);
        assert_int_equal(kept.counts.hits, anew.counts.hits);
        assert_memory_equal(p.set[0].a, q.set[0].a, size);
        assert_memory_equal(p.set[0].c, q.set[0].c, size);
        assert_int_equal(p.n_extra, q.n_extra);
        planes_free(&p);
        planes_free(&q);
    }
    scene->image.width = scene->image.height = 16384;
    struct features features;
    features_find(scene, false, &features);
    assert_true(features.line[FEATURE_EACH_PICTURE].kept);
    render_hits_free(&hits);
    scene_free(scene);
}

static volatile sig_atomic_t cancelled = 1;

static void cancelled_work_says_so(void **state) {
    (void)state;
    struct scene *scene =
        scene_of(WHITE "shapes: [sphere: {material: m, radius_mm: 20}]\n"
                       "lights: [beam: {theta_deg: 25}]\ncamera: {orthographic: {height_mm: 50}}\n");
    struct planes planes;
    struct render_report report = {0};
    struct err e = {0};
    assert_int_equal(
        render_planes(scene, &(struct render_options){.cancel = &cancelled}, &planes, &report, &e),
        -ERR_CANCELLED);
    scene_free(scene);
}

static void empty_and_tiny_pictures(void **state) {
    (void)state;
    struct scene *scene =
        scene_of("camera: {orthographic: {height_mm: 50}}\nimage: {width: 1, height: 1, grid: 1}\n");
    struct planes planes;
    struct picture picture;
    struct render_report report;
    planes_of(scene, &(struct render_options){0}, &planes, &report);
    assert_int_equal(planes.paint[0], -1);
    assert_int_equal(render_picture(scene, &planes, false, &picture, NULL), 0);
    assert_true(picture.rgb[0] == 0 && picture.rgb[1] == 0 && picture.rgb[2] == 0);
    picture_free(&picture);
    planes_free(&planes);
    scene_free(scene);
}

/* The perfect diffuser that faces the light is white in every space; exposure scales it. */
static void white_is_white(void **state) {
    (void)state;
    for (int space = 0; space < COLOUR_SPACES; space++) {
        static const char *const names[] = {"srgb", "display-p3", "adobe-rgb"};
        struct scene *scene = scene_of(WHITE "shapes: [sphere: {material: m, radius_mm: 1000}]\n"
                                             "lights: [beam: {theta_deg: 0, spd: A}]\n"
                                             "camera: {orthographic: {height_mm: 0.001}}\n"
                                             "image: {width: 1, height: 1, grid: 1, bits: 16, space: %s}\n",
                                       names[space]);
        struct planes planes;
        struct picture picture;
        struct render_report report;
        planes_of(scene, &(struct render_options){0}, &planes, &report);
        assert_int_equal(render_picture(scene, &planes, false, &picture, NULL), 0);
        for (int i = 0; i < 3; i++)
            assert_in_range(picture.rgb[i], 65534, 65535);
        assert_true(fabs(picture.max_y - 1) < 1e-9);
        assert_true(picture.clipped == 0 && picture.out_of_gamut == 0);
        picture_free(&picture);
        scene->image.exposure = 0.5;
        assert_int_equal(render_picture(scene, &planes, false, &picture, NULL), 0);
        assert_in_range(picture.rgb[1], 45000, 50000);
        picture_free(&picture);
        planes_free(&planes);
        scene_free(scene);
    }
}

struct look {          /* of one painted cylinder */
    double saturation; /* chroma over lightness of the diffuse side, away from the highlight */
    double highlight;  /* highest Y over that side's */
};

static struct look look_at(int water_percent) {
    struct sim_surface surface;
    assert_int_equal(sim_paint_find("Hooker's Green", "drawing paper", water_percent, &surface, NULL), 0);
    struct scene *scene = scene_of(GREEN "shapes: [cylinder: {material: m, radius_mm: 20, length_mm: 80}]\n"
                                         "lights: [beam: {theta_deg: 20, azimuth_deg: 180}]\n"
                                         "camera: {orthographic: {height_mm: 0.1}}\n"
                                         "image: {width: 401, height: 1, grid: 1}\n");
    struct estimate *m = &scene->paint[0].estimate;
    m->value[MATERIAL_SIGMA] = surface.sigma;
    m->value[MATERIAL_GAMMA] = surface.gamma;
    m->value[MATERIAL_BETA_PRIME] = surface.beta_prime;
    m->value[MATERIAL_N] = surface.n;
    memcpy(m->s_lambda, surface.s_lambda, sizeof m->s_lambda);
    assert_int_equal(paint_prepare(&scene->paint[0], NULL), 0);
    struct planes planes;
    struct render_report report;
    planes_of(scene, &(struct render_options){0}, &planes, &report);
    double *xyz = xyz_of(scene, &planes, false), white[3] = {.95043, 1, 1.0888}, lab[3], top = 0;
    const double *side = xyz + 3L * 40; /* 16 mm left of the axis: 53 deg, far from the highlight at 10 deg */
    for (int i = 0; i < 401; i++)
        top = fmax(top, xyz[3 * i + 1]);
    colour_lab(side, white, lab);
    struct look look = {hypot(lab[1], lab[2]) / lab[0], top / side[1]};
    free(xyz);
    planes_free(&planes);
    scene_free(scene);
    return look;
}

/* Paper, Rendering application: "the saturation of object color decreases and the highlight becomes weaker as the
 * water quantity increases". */
static void more_water_less_saturation_and_a_weaker_highlight(void **state) {
    (void)state;
    struct look dry = look_at(0), wet = look_at(60), wettest = look_at(90);
    if (!(dry.saturation > wet.saturation && wet.saturation > wettest.saturation))
        fail_msg("saturation %g, %g, %g", dry.saturation, wet.saturation, wettest.saturation);
    if (!(dry.highlight > wet.highlight && wet.highlight > wettest.highlight))
        fail_msg("highlight %g, %g, %g", dry.highlight, wet.highlight, wettest.highlight);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lambert_sphere_to_ten_digits),
        cmocka_unit_test(lambert_cylinder_to_ten_digits),
        cmocka_unit_test(a_cylinder_ends_in_discs_unless_it_is_open),
        cmocka_unit_test(perspective_far_away_is_parallel),
        cmocka_unit_test(same_bits_for_any_number_of_threads),
        cmocka_unit_test(what_stands_in_the_light_casts_a_shadow),
        cmocka_unit_test(left_out_agrees_with_all_features),
        cmocka_unit_test(what_a_new_s_would_show_is_not_left_out),
        cmocka_unit_test(what_is_left_out_takes_no_memory_and_no_rays),
        cmocka_unit_test(a_series_meets_the_scene_once),
        cmocka_unit_test(cancelled_work_says_so),
        cmocka_unit_test(empty_and_tiny_pictures),
        cmocka_unit_test(white_is_white),
        cmocka_unit_test(more_water_less_saturation_and_a_weaker_highlight),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
