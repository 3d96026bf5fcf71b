#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "proto/units.h"
#include "tests/support/render_scene.h"

#define LEFT_RIGHT                                                                                           \
    "materials: [{name: l, uniform: 1, model: lambert}, {name: r, uniform: 1, model: lambert}]\n"

static struct scene *fold_at(double angle_deg, const char *light) {
    return scene_of(LEFT_RIGHT
                    "shapes: [fold: {materials: [l, r], width_mm: 20, length_mm: 31, angle_deg: %g}]\n"
                    "lights: [beam: {%s}]\ncamera: {orthographic: {height_mm: 40}}\n"
                    "image: {width: 100, height: 100, grid: 1}\n",
                    angle_deg, light);
}

/* Each side where its outline is, with its own material and the cosine of the light to its normal. */
static void both_sides_stand_where_they_should(void **state) {
    (void)state;
    static const double angles_deg[] = {30, 90, 140, 180};
    for (int k = 0; k < 4; k++) {
        struct scene *scene = fold_at(angles_deg[k], "theta_deg: 10");
        struct planes planes;
        struct render_report report;
        double half = rad_from_deg(angles_deg[k]) / 2, reach = 20 * sin(half);
        planes_of(scene, &(struct render_options){.threads = 1}, &planes, &report);
        for (int i = 0; i < 10000; i++) {
            double x = (i % 100 - 49.5) * 0.4, y = (49.5 - i / 100) * 0.4;
            bool inside = fabs(x) < reach && fabs(y) < 15.5;
            int expected = inside ? x > 0 : -1;
            assert_int_equal(planes.paint[i], expected);
            double cosine =
                cos(rad_from_deg(10)) * sin(half) - (x > 0 ? 1 : -1) * sin(rad_from_deg(10)) * cos(half);
            if (inside && planes.set[0].a[i] != 0)
                assert_true(fabs(planes.set[0].a[i] - cosine) < 1e-12);
        }
        planes_free(&planes);
        scene_free(scene);
    }
}

/* Light from the right at theta: the right side throws its shadow on the left one from its rim on down. */
static void one_side_shadows_the_other(void **state) {
    (void)state;
    struct scene *scene = fold_at(90, "theta_deg: 60");
    struct planes planes;
    struct render_report report;
    planes_of(scene, &(struct render_options){.threads = 1}, &planes, &report);
    assert_true(report.features.line[FEATURE_SHADOW_RAYS].kept && report.counts.shadow_rays > 0);
    /* The ray over the rim at (r, r), r = 20 sin 45, meets z = -x at x + r = (z - r) tan 60 downwards. */
    double r = 20 * M_SQRT1_2, edge = r * (1 - tan(rad_from_deg(60))) / (1 + tan(rad_from_deg(60)));
    for (int i = 0; i < 100; i++) {
        double x = (i - 49.5) * 0.4;
        double a = planes.set[0].a[50 * 100 + i];
        if (fabs(x) < r && fabs(x - edge) > 0.4)
            assert_int_equal(a > 0, x < edge);
    }
    planes_free(&planes);
    scene_free(scene);
}

static void a_flat_fold_is_convex(void **state) {
    (void)state;
    struct scene *flat = fold_at(180, "theta_deg: 10"), *bent = fold_at(179, "theta_deg: 10");
    assert_true(shape_is_convex(&flat->shape[0]));
    assert_false(shape_is_convex(&bent->shape[0]));
    scene_free(flat);
    scene_free(bent);
}

static void the_materials_are_one_or_two(void **state) {
    (void)state;
    static const char *const wrong[] = {"", "material: l, materials: [l, r], ", "materials: [l], ",
                                        "materials: [l, r, l], "};
    for (int i = 0; i < 4; i++) {
        char text[512];
        struct err_list errors = {0};
        snprintf(text, sizeof text,
                 LEFT_RIGHT "shapes: [fold: {%swidth_mm: 20, length_mm: 30}]\n"
                            "camera: {orthographic: {height_mm: 40}}\n",
                 wrong[i]);
        assert_null(scene_read_text("s.yaml", text, strlen(text), NULL, 0, &errors));
        assert_int_equal(errors.n, 1);
        assert_non_null(strstr(errors.item[0].text, "left and right side"));
        err_list_free(&errors);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(both_sides_stand_where_they_should),
        cmocka_unit_test(one_side_shadows_the_other),
        cmocka_unit_test(a_flat_fold_is_convex),
        cmocka_unit_test(the_materials_are_one_or_two),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
