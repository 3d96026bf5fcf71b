/* A scene file as a stranger may send it. The files it names are looked for in a folder that is not there, so that
 * nothing but the text decides. What is accepted can be aimed and, at a pixel's size, rendered. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "fit/render/render.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void use(struct scene *scene) {
    struct planes planes;
    struct render_report report;
    struct err e = {0};
    scene->image.width = scene->image.height = 1;
    scene->image.grid = 1;
    scene_aim(scene, scene->n_pictures - 1);
    if (render_planes(scene, &(struct render_options){.threads = 1}, &planes, &report, &e) != 0)
        abort();
    for (int j = 0; j < planes.n_sets; j++) {
        double *const plane[3] = {planes.set[j].a, planes.set[j].b, planes.set[j].c};
        for (int k = 0; k < 3; k++)
            if (plane[k] && !isfinite(plane[k][0]))
                abort();
    }
    planes_free(&planes);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct err_list errors = {0};
    struct scene *scene =
        scene_read_text("/nonexistent/scene.yaml", (const char *)data, size, NULL, 0, &errors);
    if ((scene != NULL) != (errors.n == 0))
        abort();
    if (scene)
        use(scene);
    scene_free(scene);
    err_list_free(&errors);
    return 0;
}
