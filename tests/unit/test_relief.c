#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/relief.h"
#include "proto/units.h"
#include "tests/support/render_scene.h"

#define N 64

static struct relief relief_of(double (*height)(double u, double v), double scale_mm) {
    struct raster raster = {N, N, malloc(3UL * N * N * sizeof(uint16_t))};
    struct relief relief;
    for (int i = 0; i < N * N; i++) {
        double code = 65535 * height((i % N + 0.5) / N, (i / N + 0.5) / N);
        raster.rgb[3 * i] = raster.rgb[3 * i + 1] = raster.rgb[3 * i + 2] = (uint16_t)lround(code);
    }
    assert_int_equal(relief_make(&relief, &raster, 32, 64, scale_mm, NULL), 0);
    raster_free(&raster);
    return relief;
}

static double slope(double u, double v) {
    return 0.5 * u + 0.25 * v;
}

/* A plane of slopes 5 / 32 to the right and 2.5 / 64 downwards has one normal. */
static void a_plane_has_its_normal(void **state) {
    (void)state;
    struct relief r = relief_of(slope, 10);
    struct vec3 expected = vec3_unit((struct vec3){-5.0 / 32, 2.5 / 64, 1});
    for (int i = 0; i < 100; i++) {
        struct vec3 n = relief_normal(&r, 2 + 28.0 * i / 100, 60 - 56.0 * i / 100);
        assert_true(vec3_length(vec3_sub(n, expected)) < 1e-3); /* 16 bits over two texels */
    }
    relief_free(&r);
}

static double wave(double u, double v) {
    (void)v;
    return 0.5 + 0.5 * sin(4 * M_PI * u);
}

static void a_wave_has_its_normals(void **state) {
    (void)state;
    struct relief r = relief_of(wave, 2);
    for (int i = 1; i < 100; i++) {
        double u = 32.0 * i / 100, rise = cos(4 * M_PI * u / 32) * 4 * M_PI / 32;
        struct vec3 n = relief_normal(&r, u, 20), expected = vec3_unit((struct vec3){-rise, 0, 1});
        if (u > 1 && u < 31)
            assert_true(vec3_length(vec3_sub(n, expected)) < 0.02); /* 16 texels a half wave: sin x / x */
    }
    relief_free(&r);
}

static double wall(double u, double v) {
    (void)v;
    return u > 0.5 && u < 0.6 ? 1 : 0;
}

/* Behind a wall of 4 mm the shadow of light 60 deg off the normal reaches 4 tan 60 = 6.9 mm. */
static void a_wall_casts_its_shadow(void **state) {
    (void)state;
    struct relief r = relief_of(wall, 4);
    struct vec3 l = {-sin(rad_from_deg(60)), 0, cos(rad_from_deg(60))};
    double end = 0.6 * 32 + 4 * tan(rad_from_deg(60));
    for (double u = 20.5; u < 31; u += 0.25)
        if (fabs(u - end) > 1) /* two texels: the wall's sides are sloped */
            assert_int_equal(relief_shadow(&r, u, 30, l), u < end);
    assert_false(relief_shadow(&r, 10, 30, l)); /* on the lit side */
    l.x = -l.x;
    assert_true(relief_shadow(&r, 14, 30, l));
    assert_false(relief_shadow(&r, 25, 30, l));
    assert_false(relief_shadow(&r, 14, 30, (struct vec3){0, 0, 1}));
    assert_true(relief_shadow(&r, 14, 30, (struct vec3){1, 0, 0}));
    relief_free(&r);
}

#define PAINTING                                                                                             \
    "materials: [{name: a, uniform: 0.1}, {name: b, uniform: 0.2}, {name: c, uniform: 0.3}]\n"               \
    "camera: {orthographic: {height_mm: 72}}\nimage: {width: 96, height: 72, grid: 1}\n"                     \
    "lights: [beam: {theta_deg: 60}]\n"

static void a_mask_says_where_each_material_is(void **state) {
    (void)state;
    struct scene *scene = scene_of(
        PAINTING "shapes: [rectangle: {width_mm: 96, height_mm: 72, mask_image: mask.png,\n"
                 "  mask: {'#ff8000': b, '#008000': c, '#4060FF': a}, relief: relief.png, relief_mm: 6}]\n");
    struct planes planes;
    struct render_report report;
    planes_of(scene, &(struct render_options){0}, &planes, &report);
    assert_int_equal(planes.paint[0], 0);
    assert_int_equal(planes.paint[36 * 96 + 48], 1);
    assert_int_equal(planes.paint[71 * 96], 2);
    int dark = 0;
    for (int i = 0; i < 96 * 72; i++)
        dark += planes.set[0].a[i] == 0;
    assert_in_range(dark, 100, 5000); /* valleys of the strokes lie in shadow */
    assert_true(report.counts.shadow_rays > 0);
    planes_free(&planes);
    scene_free(scene);
}

static void a_relief_of_no_height_is_not_read(void **state) {
    (void)state;
    struct scene *scene = scene_of(PAINTING "shapes: [rectangle: {width_mm: 96, height_mm: 72, material: a,\n"
                                            "  relief: nowhere.png, relief_mm: 0}]\n");
    struct planes planes;
    struct render_report report;
    planes_of(scene, &(struct render_options){0}, &planes, &report);
    for (int i = 0; i < 96 * 72; i++)
        assert_true(fabs(planes.set[0].a[i] - 0.5) < 1e-15);
    assert_int_equal(report.counts.shadow_rays, 0);
    planes_free(&planes);
    scene_free(scene);
}

static void mistakes_of_a_painting_are_told(void **state) {
    (void)state;
    static const char *const cases[][2] = {
        {"mask_image: mask.png, mask: {'#ff8000': a, '#008000': b}",
         "row 0 is #4060ff, which `mask` does not list"},
        {"mask_image: mask.png, mask: {'ff8000': a}", "no colour as '#ff8000'"},
        {"mask_image: none.png, mask: {'#ff8000': a}", "none.png cannot be read"},
        {"mask_image: green.csv, mask: {'#ff8000': a}", "no PNG"},
        {"mask_image: mask.png, mask: {'#ff8000': x, '#008000': a, '#4060ff': b}", "no material 'x'"},
        {"mask: {'#ff8000': a}", "needs a material, or a mask_image"},
        {"mask_image: mask.png, material: a", "needs a material, or a mask_image"},
        {"width_mm: 3", "needs a material"},
        {"material: a, relief_mm: 1", "name its picture"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[1024];
        struct err_list errors = {0};
        snprintf(text, sizeof text, PAINTING "shapes: [rectangle: {%s, %sheight_mm: 72}]\n", cases[i][0],
                 strstr(cases[i][0], "width_mm") ? "" : "width_mm: 96, ");
        assert_null(scene_read_text("docs/examples/scenes/t.yaml", text, strlen(text), NULL, 0, &errors));
        bool told = false;
        for (size_t k = 0; k < errors.n; k++)
            told = told || strstr(errors.item[k].text, cases[i][1]);
        if (!told)
            fail_msg("case %zu: %s", i, errors.n ? errors.item[0].text : "nothing was told");
        err_list_free(&errors);
    }
}

static void a_board_shows_its_patches_in_order(void **state) {
    (void)state;
    struct scene *scene =
        scene_of(PAINTING "shapes: [board: {materials: [b, a, c], columns: 2, patch_mm: 20,\n"
                          "  gap_mm: 4}]\n");
    struct planes planes;
    struct render_report report;
    planes_of(scene, &(struct render_options){0}, &planes, &report);
    assert_int_equal(planes.paint[24 * 96 + 36], 1);  /* b, top left */
    assert_int_equal(planes.paint[24 * 96 + 60], 0);  /* a, top right */
    assert_int_equal(planes.paint[48 * 96 + 36], 2);  /* c, below */
    assert_int_equal(planes.paint[48 * 96 + 60], -1); /* no fourth */
    assert_int_equal(planes.paint[24 * 96 + 48], -1); /* between */
    assert_int_equal(report.counts.hits, 3 * 400);
    planes_free(&planes);
    scene_free(scene);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_plane_has_its_normal),
        cmocka_unit_test(a_wave_has_its_normals),
        cmocka_unit_test(a_wall_casts_its_shadow),
        cmocka_unit_test(a_mask_says_where_each_material_is),
        cmocka_unit_test(a_relief_of_no_height_is_not_read),
        cmocka_unit_test(mistakes_of_a_painting_are_told),
        cmocka_unit_test(a_board_shows_its_patches_in_order),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
