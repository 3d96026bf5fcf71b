#include "tests/support/render_scene.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct scene *scene_of(const char *format, ...) {
    char text[8192], sentence[1024];
    struct err_list errors = {0};
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    struct scene *scene =
        scene_read_text("docs/examples/scenes/test.yaml", text, strlen(text), NULL, 0, &errors);
    for (size_t i = 0; i < errors.n; i++)
        print_message("# %s\n", err_format(&errors.item[i], sentence, sizeof sentence));
    assert_non_null(scene);
    return scene;
}

void planes_of(const struct scene *scene, const struct render_options *options, struct planes *planes,
               struct render_report *report) {
    struct err e = {0};
    *report = (struct render_report){0};
    if (render_planes(scene, options, planes, report, &e))
        fail_msg("%s", e.text);
}

double *xyz_of(const struct scene *scene, const struct planes *planes, bool by_wavelength) {
    struct err e = {0};
    double *xyz = malloc(3 * (size_t)planes->width * (size_t)planes->height * sizeof *xyz);
    assert_non_null(xyz);
    if (render_xyz(scene, planes, by_wavelength, xyz, &e))
        fail_msg("%s", e.text);
    return xyz;
}
