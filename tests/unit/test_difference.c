#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit/render/ciede2000.h"
#include "fit/render/difference.h"
#include "fit/render/exr.h"
#include "tests/support/render_scene.h"

/* A flat patch seen and lit from the front: radiance factor = S in every band. */
#define PATCH                                                                                                \
    "materials:\n  - {name: m, %s, model: lambert}\n"                                                        \
    "shapes:\n  - rectangle: {material: m, width_mm: 20, height_mm: 20}\n"                                   \
    "lights:\n  - beam: {theta_deg: 0, spd: %s}\n"                                                           \
    "camera: {orthographic: {height_mm: %d}}\nimage: {width: 8, height: 8, adaptation: %s}\n"

struct pair {
    struct scene *scene[2];
    struct planes planes[2];
    struct difference d;
};

static int compare(struct pair *p, struct scene *first, struct scene *second) {
    struct render_report report;
    struct difference_side side[2];
    p->scene[0] = first;
    p->scene[1] = second;
    for (int i = 0; i < 2; i++) {
        planes_of(p->scene[i], &(struct render_options){0}, &p->planes[i], &report);
        side[i] = (struct difference_side){p->scene[i], &p->planes[i]};
    }
    return difference_make(side, &p->d, NULL);
}

static void drop(struct pair *p) {
    difference_free(&p->d);
    for (int i = 0; i < 2; i++) {
        planes_free(&p->planes[i]);
        scene_free(p->scene[i]);
    }
}

/* Two greys: L* by its own formula, and CIEDE2000 of greys is their lightness step over its weight. */
static void greys_differ_by_their_lightness(void **state) {
    (void)state;
    struct pair p;
    double first = 116 * cbrt(.5) - 16, second = 116 * cbrt(.45) - 16, mean = (first + second) / 2 - 50;
    double expected = (first - second) / (1 + .015 * mean * mean / sqrt(20 + mean * mean));
    assert_int_equal(compare(&p, scene_of(PATCH, "uniform: 0.5", "D65", 20, "none"),
                             scene_of(PATCH, "uniform: 0.45", "D65", 20, "none")),
                     0);
    assert_int_equal(p.d.n, 64);
    assert_true(fabs(p.d.mean - expected) < 1e-4 && fabs(p.d.max - expected) < 1e-4);
    assert_true(fabs(p.d.median - expected) < 1e-4 && fabs(p.d.p95 - expected) < 1e-4);
    assert_true(fabs(p.d.mean_lab[0][0] - first) < 1e-4 && fabs(p.d.mean_lab[1][0] - second) < 1e-4);
    assert_true(difference_top(&p.d) >= p.d.max && difference_top(&p.d) <= 2.5 * p.d.max);
    drop(&p);
}

/* A grey stays itself for an adapted eye whatever the lamp; without adaptation the lamp's colour is seen. */
static void adaptation_decides_what_a_lamp_does(void **state) {
    (void)state;
    static const char *const adaptation[] = {"none", "von-kries", "bradford", "cat16"};
    for (int i = 0; i < 4; i++) {
        struct pair p;
        assert_int_equal(compare(&p, scene_of(PATCH, "uniform: 0.5", "D65", 20, adaptation[i]),
                                 scene_of(PATCH, "uniform: 0.5", "A", 20, adaptation[i])),
                         0);
        assert_true(i == 0 ? p.d.mean > 10 : p.d.max < 1e-4);
        drop(&p);
    }
    /* A colour does change a little (metamerism), which adaptation does not take away. */
    struct pair p;
    assert_int_equal(compare(&p, scene_of(PATCH, "spectrum: green.csv", "D65", 20, "bradford"),
                             scene_of(PATCH, "spectrum: green.csv", "A", 20, "bradford")),
                     0);
    assert_true(p.d.mean > .5 && p.d.mean < 30);
    drop(&p);
}

static void only_what_both_show_is_compared(void **state) {
    (void)state;
    struct pair p;
    uint16_t black[3] = {0}, top[3] = {253, 231, 37};
    struct picture picture;
    assert_int_equal(compare(&p, scene_of(PATCH, "uniform: 0.5", "D65", 40, "none"),
                             scene_of(PATCH, "uniform: 0.2", "D65", 20, "none")),
                     0);
    assert_true(p.d.n == 16 && p.d.only[0] == 0 && p.d.only[1] == 48);
    assert_int_equal(difference_picture(&p.d, p.d.max, &picture, NULL), 0);
    assert_memory_equal(picture.rgb, black, sizeof black);
    assert_memory_equal(picture.rgb + 3 * (3 * 8 + 3), top, sizeof top);
    assert_true(isnan(p.d.de[0]) && p.d.max_x >= 2 && p.d.max_x < 6);
    picture_free(&picture);
    drop(&p);
}

static void values_are_written(void **state) {
    (void)state;
    struct pair p;
    struct exr_image image;
    char path[] = "/tmp/goniod-difference-XXXXXX.exr";
    close(mkstemps(path, 4));
    assert_int_equal(compare(&p, scene_of(PATCH, "spectrum: green.csv", "D65", 20, "none"),
                             scene_of(PATCH, "spectrum: blue.csv", "D65", 20, "none")),
                     0);
    assert_int_equal(difference_values(path, &p.d, "{}", NULL), 0);
    assert_int_equal(exr_load(path, "goniod", &image, NULL), 0);
    double lab[2][3];
    for (int k = 0; k < 6; k++) {
        const char *name[] = {"first.L", "first.a", "first.b", "second.L", "second.a", "second.b"};
        lab[k / 3][k % 3] = exr_plane(&image, name[k])[9];
    }
    assert_true(fabs(ciede2000(lab[0], lab[1]) - exr_plane(&image, "dE00")[9]) < 1e-5);
    exr_free(&image);
    drop(&p);
    unlink(path);
}

static void pictures_that_share_nothing_are_refused(void **state) {
    (void)state;
    struct pair p;
    assert_int_equal(
        compare(&p, scene_of(PATCH, "uniform: 0.5", "D65", 20, "none"),
                scene_of("materials:\n  - {name: m, uniform: 1, model: lambert}\n"
                         "shapes:\n  - sphere: {material: m, radius_mm: 1, at_mm: [99, 0, 0]}\n"
                         "lights:\n  - beam: {theta_deg: 0}\n"
                         "camera: {orthographic: {height_mm: 20}}\nimage: {width: 8, height: 8}\n")),
        -ERR_STATE);
    drop(&p);
    assert_int_equal(
        compare(&p, scene_of(PATCH, "uniform: 0.5", "D65", 20, "none"),
                scene_of("materials:\n  - {name: m, uniform: 1, model: lambert}\n"
                         "shapes:\n  - sphere: {material: m, radius_mm: 1}\n"
                         "lights:\n  - beam: {theta_deg: 0}\n"
                         "camera: {orthographic: {height_mm: 20}}\nimage: {width: 9, height: 8}\n")),
        -ERR_USAGE);
    drop(&p);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(greys_differ_by_their_lightness),
        cmocka_unit_test(adaptation_decides_what_a_lamp_does),
        cmocka_unit_test(only_what_both_show_is_compared),
        cmocka_unit_test(values_are_written),
        cmocka_unit_test(pictures_that_share_nothing_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
