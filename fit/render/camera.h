/*
 * camera.h — the ray of a place in the picture.
 *
 * Orthographic: parallel rays from the direction `from`; height_mm is the height of what is seen. Perspective: from
 * position_mm; height_deg is the vertical field. Pixels are square; u in 0..width from the left, v in 0..height
 * from the top, pixel centres at halves.
 * Errors     camera_prepare: -ERR_INPUT looking nowhere, or along `up`.
 * Checked    tests/unit/test_render.c: sphere and cylinder at pixel centres, far perspective
 */
#ifndef FIT_RENDER_CAMERA_H
#define FIT_RENDER_CAMERA_H

#include <stdbool.h>

#include "fit/render/frame.h"
#include "proto/err.h"

enum camera_kind { CAMERA_ORTHOGRAPHIC, CAMERA_PERSPECTIVE, CAMERA_KINDS };

struct camera {
    enum camera_kind kind;
    bool given[CAMERA_KINDS];
    double look_at_mm[3], from[3], position_mm[3], up[3]; /* from: towards the camera */
    int n_look_at, n_from, n_position, n_up;
    double height_mm, height_deg;
    struct vec3 origin, forward, right, down; /* right and down: a step of one pixel */
    double half_width, half_height;           /* in pixels */
    double reach_mm;                          /* rays of an orthographic camera begin so far before look_at */
};

int camera_prepare(struct camera *c, int width, int height, double reach_mm, struct err *e);
struct ray camera_ray(const struct camera *c, double u, double v);

#endif
