#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit/render/exr.h"
#include "fit/render/spectral.h"
#include "fit/render/white.h"
#include "tests/support/render_scene.h"

#define WIDTH 24
#define HEIGHT 21
#define SCENE                                                                                                \
    "materials:\n"                                                                                           \
    "  - {name: m, spectrum: green.csv, sigma: 0.3, gamma: 0.07, beta_prime: 7.6, n: 1.7}\n"                 \
    "  - {name: white, uniform: 1, model: lambert}\n"                                                        \
    "shapes:\n"                                                                                              \
    "  - cylinder: {material: m, radius_mm: 20, length_mm: 60, turn_deg: [20, 0, 17]}\n"                     \
    "  - sphere: {material: white, radius_mm: 12, at_mm: [15, 5, 25]}\n"                                     \
    "lights:\n"                                                                                              \
    "  - beam: {theta_deg: 25, weight: 3, spd: A}\n"                                                         \
    "  - beam: {theta_deg: 60, azimuth_deg: 200, spd: F11}\n"                                                \
    "camera: {orthographic: {height_mm: 80}}\n"                                                              \
    "image: {width: 24, height: 21, grid: 3, exposure: 0.7, bounces: 3, observer: 1964-10deg}\n"

struct saved {
    struct scene *scene;
    struct planes planes;
    struct exr_image image;
    char path[40];
};

static void save(struct saved *s, const char *text_name) {
    struct render_report report;
    struct err e = {0};
    strcpy(s->path, "/tmp/goniod-spectral-XXXXXX.exr");
    close(mkstemps(s->path, 4));
    s->scene = scene_of("%s", SCENE);
    planes_of(s->scene, &(struct render_options){0}, &s->planes, &report);
    if (spectral_save(s->path, s->scene, &s->planes, "{\"x\":1}", &e) ||
        exr_load(s->path, text_name, &s->image, &e))
        fail_msg("%s", e.text);
}

static void drop(struct saved *s) {
    planes_free(&s->planes);
    exr_free(&s->image);
    scene_free(s->scene);
    unlink(s->path);
}

/* The channels under their names summed with the colour matching functions are the XYZ of the picture. */
static void the_bands_sum_to_the_picture(void **state) {
    (void)state;
    struct saved s;
    save(&s, "goniod");
    assert_int_equal(s.image.n_channels, BANDS + 3);
    assert_string_equal(s.image.text, "{\"x\":1}");
    assert_non_null(exr_plane(&s.image, "S0.380,000000nm"));
    assert_non_null(exr_plane(&s.image, "S0.780,000000nm"));
    assert_true(planes_have_indirect(&s.planes));
    double *xyz = xyz_of(s.scene, &s.planes, false), white[3];
    assert_int_equal(white_of(s.scene, white, NULL), 0);
    struct colour_matrix display = white_display(s.scene, COLOUR_SRGB, white);
    double brightest = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double radiance[BANDS], sum[3], rgb[3];
        for (int k = 0; k < BANDS; k++) {
            char name[EXR_NAME_MAX];
            spectral_channel(k, name, sizeof name);
            radiance[k] = exr_plane(&s.image, name)[i];
        }
        colour_sum(radiance, COLOUR_10DEG, sum);
        colour_apply(&display, xyz + 3 * i, rgb);
        brightest = fmax(brightest, sum[1]);
        for (int j = 0; j < 3; j++) {
            assert_true(fabs(sum[j] - xyz[3 * i + j]) < 1e-6);
            assert_true(fabs(exr_plane(&s.image, (const char *[]){"R", "G", "B"}[j])[i] - rgb[j]) < 1e-6);
        }
    }
    assert_true(brightest > 0.3);
    free(xyz);
    drop(&s);
}

static void the_attributes_are_those_of_the_layout(void **state) {
    (void)state;
    static const char *const attribute[][2] = {{"spectralLayoutVersion", "1.0"},
                                               {"emissiveUnits", "W.m^-2.sr^-1"}};
    for (int i = 0; i < 2; i++) {
        struct saved s;
        save(&s, attribute[i][0]);
        assert_string_equal(s.image.text, attribute[i][1]);
        drop(&s);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_bands_sum_to_the_picture),
        cmocka_unit_test(the_attributes_are_those_of_the_layout),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
