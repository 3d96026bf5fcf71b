#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "fit/render/sheet.h"
#include "tests/support/render_scene.h"

#define WIDTH 10
#define HEIGHT 8
#define SCENE                                                                                                \
    "materials:\n"                                                                                           \
    "  - {name: m, spectrum: green.csv, sigma: 0.3, gamma: 0.07, beta_prime: 7.6, n: 1.7}\n"                 \
    "  - {name: grey, uniform: 0.5, model: lambert}\n"                                                       \
    "shapes:\n"                                                                                              \
    "  - cylinder: {material: %s, radius_mm: 20, length_mm: 60, turn_deg: [20, 0, 17]}\n"                    \
    "  - sphere: {material: %s, radius_mm: 12, at_mm: [15, 5, 25]}\n"                                        \
    "lights:\n"                                                                                              \
    "  - beam: {theta_deg: 25, weight: 3, spd: %s}\n"                                                        \
    "  - beam: {theta_deg: 60, azimuth_deg: 200, spd: %s}\n"                                                 \
    "camera: {orthographic: {height_mm: 80}}\nimage: {width: 10, height: 8, grid: 2, exposure: 0.7}\n"

static struct spd spd_of(const char *name) {
    struct spd spd;
    struct err_list errors = {0};
    assert_int_equal(spd_find(&spd, name, ".", &errors, NULL), 0);
    return spd;
}

/* Each tile is, code for code, the scene rendered with lights of that spectrum. */
static void a_tile_is_the_scene_under_its_light(void **state) {
    (void)state;
    static const char *const name[3] = {"D65", "A", "F11"};
    struct spd light[3] = {spd_of(name[0]), spd_of(name[1]), spd_of(name[2])};
    struct scene *scene = scene_of(SCENE, "m", "grey", "D50", "F2");
    struct planes planes;
    struct render_report report;
    struct sheet sheet;
    planes_of(scene, &(struct render_options){0}, &planes, &report);
    assert_int_equal(sheet_make(scene, &planes, light, 3, 0, &sheet, NULL), 0);
    assert_true(sheet.columns == 2 && sheet.rows == 2);
    assert_int_equal(sheet.picture.width, 2 * WIDTH + SHEET_GAP);
    assert_int_equal(sheet.picture.height, 2 * HEIGHT + SHEET_GAP);
    for (int i = 0; i < 3; i++) {
        struct scene *own = scene_of(SCENE, "m", "grey", name[i], name[i]);
        struct planes own_planes;
        struct picture picture;
        planes_of(own, &(struct render_options){0}, &own_planes, &report);
        assert_int_equal(render_picture(own, &own_planes, false, &picture, NULL), 0);
        for (int y = 0; y < HEIGHT; y++) {
            int at = (i / 2 * (HEIGHT + SHEET_GAP) + y) * sheet.picture.width + i % 2 * (WIDTH + SHEET_GAP);
            for (int x = 0; x < 3 * WIDTH; x++)
                assert_in_range(sheet.picture.rgb[3 * at + x] + 1 - picture.rgb[y * 3 * WIDTH + x], 0, 2);
        }
        assert_int_equal(sheet.tile[i].out_of_gamut, picture.out_of_gamut);
        picture_free(&picture);
        planes_free(&own_planes);
        scene_free(own);
    }
    int gap = 3 * WIDTH;
    assert_true(sheet.picture.rgb[gap] == 0 && sheet.picture.rgb[gap + 3 * SHEET_GAP - 1] == 0);
    assert_true(sheet.tile[0].mean_de == 0 && sheet.tile[1].mean_de > .5 && sheet.tile[2].mean_de > .5);
    sheet_free(&sheet);
    planes_free(&planes);
    scene_free(scene);
}

/* What is grey looks the same under any lamp to an adapted eye. */
static void grey_is_the_same_in_all_tiles(void **state) {
    (void)state;
    struct spd light[2] = {spd_of("D65"), spd_of("A")};
    struct scene *scene = scene_of(SCENE, "grey", "grey", "D50", "F2");
    struct planes planes;
    struct render_report report;
    struct sheet sheet;
    planes_of(scene, &(struct render_options){0}, &planes, &report);
    assert_int_equal(sheet_make(scene, &planes, light, 2, 1, &sheet, NULL), 0);
    assert_true(sheet.columns == 1 && sheet.rows == 2);
    assert_true(sheet.tile[1].mean_de < 1e-4);
    sheet_free(&sheet);
    planes_free(&planes);
    scene_free(scene);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_tile_is_the_scene_under_its_light),
        cmocka_unit_test(grey_is_the_same_in_all_tiles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
