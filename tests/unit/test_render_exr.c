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
#include "fit/render/origin.h"
#include "fit/render/planes_file.h"
#include "proto/file.h"
#include "tests/support/render_scene.h"

#define SCENE                                                                                                \
    "materials:\n"                                                                                           \
    "  - {name: m, spectrum: green.csv, sigma: 0.3, gamma: 0.07, beta_prime: 7.6, n: 1.7}\n"                 \
    "  - {name: k, uniform: 0.4, sigma: 0.5, gamma: 0.2, beta_prime: 15.7, n: 1.7}\n"                        \
    "shapes:\n"                                                                                              \
    "  - cylinder: {material: m, radius_mm: 20, length_mm: 60, turn_deg: [20, 0, 17]}\n"                     \
    "  - sphere: {material: k, radius_mm: 12, at_mm: [15, 5, 25]}\n"                                         \
    "lights:\n"                                                                                              \
    "  - beam: {theta_deg: 25, weight: 3, spd: %s}\n"                                                        \
    "  - beam: {theta_deg: 60, azimuth_deg: 200, spd: D50}\n"                                                \
    "camera: {orthographic: {height_mm: 80}}\nimage: {width: 50, height: 37, grid: 3, bounces: 3}\n"

static void scratch(char path[40]) {
    strcpy(path, "/tmp/goniod-planes-XXXXXX.exr");
    close(mkstemps(path, 4));
}

static double largest_of(const double *v, size_t n) {
    double largest = 0;
    for (size_t i = 0; i < n; i++)
        largest = fmax(largest, fabs(v[i]));
    return largest;
}

/* Planes through a file, then the first light changed: the picture of the scene rendered with that light. */
static void recolouring_is_rendering(void **state) {
    (void)state;
    char path[40];
    struct scene *first = scene_of(SCENE, "D65"), *second = scene_of(SCENE, "A"), *read;
    struct planes planes, other, loaded;
    struct render_report report;
    struct err e = {0}, unused = {0};
    struct err_list errors = {0};
    json_t *origin = json_pack("{s:s}", "program", "test"), *back;
    scratch(path);
    planes_of(first, &(struct render_options){0}, &planes, &report);
    planes_of(second, &(struct render_options){0}, &other, &report);
    assert_true(planes.n_extra > 0 && planes_have_indirect(&planes));
    if (planes_save(path, first, &planes, origin, &e) || planes_load(path, &read, &loaded, &back, &e))
        fail_msg("%s", e.text);
    assert_string_equal(json_string_value(json_object_get(back, "program")), "test");
    assert_null(json_object_get(back, "recolour"));
    assert_memory_equal(loaded.paint, planes.paint, 50 * 37 * sizeof *planes.paint);
    assert_int_equal(loaded.n_extra, planes.n_extra);
    for (size_t i = 0; i < planes.n_extra; i++)
        assert_true(loaded.extra[i].pixel == planes.extra[i].pixel &&
                    loaded.extra[i].set == planes.extra[i].set &&
                    loaded.extra[i].abc.a == (float)planes.extra[i].abc.a);
    assert_int_equal(spd_find(&read->spd[0], "A", ".", &errors, &unused), 0);
    double *recoloured = xyz_of(read, &loaded, false), *rendered = xyz_of(second, &other, false);
    double size = largest_of(rendered, 3 * 50 * 37);
    for (int i = 0; i < 3 * 50 * 37; i++)
        assert_true(fabs(recoloured[i] - rendered[i]) < 1e-6 * size);
    assert_int_equal(read->image.bits, first->image.bits);
    free(recoloured);
    free(rendered);
    planes_free(&planes);
    planes_free(&other);
    planes_free(&loaded);
    scene_free(first);
    scene_free(second);
    scene_free(read);
    json_decref(origin);
    json_decref(back);
    unlink(path);
}

static void ramp(void *arg, int y, float *const *row) {
    int width = *(int *)arg;
    for (int x = 0; x < width; x++) {
        row[0][x] = (float)(y + x / 1024.0);
        row[1][x] = -row[0][x];
    }
}

/* More lines than a chunk holds, not a multiple of it, and channels that EXR sorts the other way. */
static void an_exr_reads_back(void **state) {
    (void)state;
    char path[40];
    int width = 7;
    struct exr_text text = {"goniod", "{\"σ\":1}"};
    const char channel[2][EXR_NAME_MAX] = {"z", "a"};
    struct exr_form form = {.width = width,
                            .height = 37,
                            .n_channels = 2,
                            .n_texts = 1,
                            .channel = channel,
                            .text = &text,
                            .fill = ramp,
                            .arg = &width};
    struct exr_image image;
    struct err e = {0};
    scratch(path);
    if (exr_save(path, &form, &e) || exr_load(path, "goniod", &image, &e))
        fail_msg("%s", e.text);
    assert_string_equal(image.text, text.value);
    const float *z = exr_plane(&image, "z"), *a = exr_plane(&image, "a");
    for (int i = 0; i < 37 * width; i++)
        assert_true(z[i] == (float)(i / width + i % width / 1024.0) && a[i] == -z[i]);
    assert_null(exr_plane(&image, "R"));
    exr_free(&image);
    assert_true(exr_save("/nonexistent/x.exr", &form, NULL) < 0);
    unlink(path);
    assert_int_equal(exr_load(path, "goniod", &image, NULL), -ERR_IO);
}

/* What recolouring leaves alone is told of the rendering, what it changes of the picture. */
static void a_recoloured_picture_tells_what_changed(void **state) {
    (void)state;
    struct scene *scene = scene_of(SCENE, "D65");
    struct picture picture = {.max_y = 0.5};
    json_t *rendered = json_pack("{s:[{s:s},{s:s}],s:[{s:s},{}],s:f}", "materials", "source", "old", "source",
                                 "kept", "lights", "spd", "A", "max_y", 0.25);
    strcpy(scene->paint[0].source, "new");
    strcpy(scene->paint[0].sha256, "ba78");
    json_t *origin = origin_recoloured(scene, rendered, &picture, "goniorender recolour");
    const char *sha256, *spd[2], *before, *old, *kept;
    double max_y;
    assert_int_equal(json_unpack(origin, "{s:[{s:s,s:{s:s}},{s:s !}],s:[{s:s},{s:s}],s:F,s:{s:[{s:s},{}]}}",
                                 "materials", "source", &old, "spectrum_of", "sha256", &sha256, "source",
                                 &kept, "lights", "spd", &spd[0], "spd", &spd[1], "max_y", &max_y, "rendered",
                                 "lights", "spd", &before),
                     0);
    assert_string_equal(sha256, "ba78");
    assert_true(strcmp(spd[0], "D65") == 0 && strcmp(spd[1], "D50") == 0 && strcmp(before, "A") == 0);
    assert_true(max_y == 0.5);
    json_decref(origin);
    json_decref(rendered);
    scene_free(scene);
}

static void no_broken_file_is_taken(void **state) {
    (void)state;
    char path[40], *bytes;
    size_t size;
    struct scene *scene = scene_of(SCENE, "D65"), *read;
    struct planes planes, loaded;
    struct render_report report;
    json_t *origin = json_object(), *back;
    scratch(path);
    planes_of(scene, &(struct render_options){0}, &planes, &report);
    assert_int_equal(planes_save(path, scene, &planes, origin, NULL), 0);
    assert_int_equal(file_read(path, 1 << 24, &bytes, &size, NULL), 0);
    for (size_t cut = 0; cut < size; cut += size / 23) {
        FILE *file = fopen(path, "wb");
        fwrite(bytes, 1, cut, file);
        fclose(file);
        assert_true(planes_load(path, &read, &loaded, &back, NULL) < 0);
    }
    free(bytes);
    planes_free(&planes);
    scene_free(scene);
    json_decref(origin);
    unlink(path);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(recolouring_is_rendering),
        cmocka_unit_test(an_exr_reads_back),
        cmocka_unit_test(a_recoloured_picture_tells_what_changed),
        cmocka_unit_test(no_broken_file_is_taken),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
