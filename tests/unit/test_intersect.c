#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>

#include "fit/render/intersect.h"
#include "tests/support/render_scene.h"

#define HEAD                                                                                                 \
    "materials: [{name: m, uniform: 1, model: lambert}]\n"                                                   \
    "lights: [beam: {theta_deg: 0}]\n"                                                                       \
    "camera: {orthographic: {height_mm: 50}}\n"

/* Two spheres of radius 10, 30 apart along z: from the upper pole of one, the other begins 10 on. */
#define TWO_SPHERES                                                                                          \
    HEAD                                                                                                     \
        "shapes: [sphere: {material: m, radius_mm: 10}, sphere: {material: m, radius_mm: 10, at_mm: [0, 0, " \
        "30]}]\n"

static struct hit pole(const struct scene *scene) {
    struct ray up = {{0, 0, 15}, {0, 0, -1}, 0};
    struct hit hit;
    assert_true(intersect_nearest(scene, &up, &hit));
    assert_int_equal(hit.shape, 0);
    assert_true(fabs(hit.position.z - 10) < 1e-12);
    return hit;
}

static void the_nearest_shape_is_met(void **state) {
    (void)state;
    struct scene *scene = scene_of(TWO_SPHERES);
    struct ray down = {{0, 0, 100}, {0, 0, -1}, 0}, past = {{0, 20, 100}, {0, 0, -1}, 0};
    struct hit hit;
    assert_true(intersect_nearest(scene, &down, &hit));
    assert_int_equal(hit.shape, 1);
    assert_true(fabs(hit.t_mm - 60) < 1e-12);
    assert_false(intersect_nearest(scene, &past, &hit));
    scene_free(scene);
}

/* A light nearer than the other sphere is not hidden by it. */
static void what_stands_behind_a_light_does_not_block_it(void **state) {
    (void)state;
    struct scene *scene = scene_of(TWO_SPHERES);
    struct hit from = pole(scene);
    struct vec3 up = {0, 0, 1}, aside = vec3_unit((struct vec3){1, 0, 0.1});
    assert_true(intersect_blocked(scene, &from, up, INFINITY));
    assert_true(intersect_blocked(scene, &from, up, 10 + 1e-6));
    assert_false(intersect_blocked(scene, &from, up, 10 - 1e-6));
    assert_false(intersect_blocked(scene, &from, aside, INFINITY));
    scene_free(scene);
}

/* From everywhere on a sphere, along its normal and close to its horizon. */
static void no_surface_blocks_its_own_light(void **state) {
    (void)state;
    struct scene *scene =
        scene_of(HEAD "shapes: [sphere: {material: m, radius_mm: 10, at_mm: [7, 1e3, -3]}]\n");
    int hits = 0;
    for (double y = 990.5; y < 1010; y++)
        for (double x = -2.5; x < 17; x++) {
            struct ray ray = {{x, y, 2000}, {0, 0, -1}, 0};
            struct hit hit;
            struct vec3 s, t;
            if (!intersect_nearest(scene, &ray, &hit))
                continue;
            vec3_frame(hit.normal, &s, &t);
            assert_false(intersect_blocked(scene, &hit, hit.normal, INFINITY));
            for (int i = 0; i < 8; i++) {
                struct vec3 side = vec3_add(vec3_scale(s, cos(i)), vec3_scale(t, sin(i)));
                struct vec3 low = vec3_unit(vec3_add(side, vec3_scale(hit.normal, 1e-4)));
                assert_false(intersect_blocked(scene, &hit, low, INFINITY));
            }
            hits++;
        }
    assert_true(hits > 250);
    scene_free(scene);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_nearest_shape_is_met),
        cmocka_unit_test(what_stands_behind_a_light_does_not_block_it),
        cmocka_unit_test(no_surface_blocks_its_own_light),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
