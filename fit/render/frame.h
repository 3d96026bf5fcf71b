/*
 * frame.h — where a shape stands: its own axes and origin in the scene, and rays in its own coordinates.
 *
 * A shape is described in its standard position (centre at the origin, cylinder axis along y, flat shapes in the
 * plane z = 0 facing +z), turned about x, then y, then z of the scene, and then moved.
 * Checked    tests/unit/test_render.c
 */
#ifndef FIT_RENDER_FRAME_H
#define FIT_RENDER_FRAME_H

#include "fit/render/vec3.h"
#include "proto/units.h"

struct ray { /* direction of length 1; hits count from near_mm on */
    struct vec3 origin, direction;
    double near_mm;
};

struct frame {
    struct vec3 at, x, y, z;
};

static inline struct vec3 frame_turn(struct vec3 v, const double turn_deg[3]) {
    double sx = sin(rad_from_deg(turn_deg[0])), cx = cos(rad_from_deg(turn_deg[0]));
    double sy = sin(rad_from_deg(turn_deg[1])), cy = cos(rad_from_deg(turn_deg[1]));
    double sz = sin(rad_from_deg(turn_deg[2])), cz = cos(rad_from_deg(turn_deg[2]));
    v = (struct vec3){v.x, cx * v.y - sx * v.z, sx * v.y + cx * v.z};
    v = (struct vec3){cy * v.x + sy * v.z, v.y, cy * v.z - sy * v.x};
    return (struct vec3){cz * v.x - sz * v.y, sz * v.x + cz * v.y, v.z};
}

static inline struct frame frame_make(const double at_mm[3], const double turn_deg[3]) {
    return (struct frame){{at_mm[0], at_mm[1], at_mm[2]},
                          frame_turn((struct vec3){1, 0, 0}, turn_deg),
                          frame_turn((struct vec3){0, 1, 0}, turn_deg),
                          frame_turn((struct vec3){0, 0, 1}, turn_deg)};
}

static inline struct vec3 frame_into(const struct frame *f, struct vec3 v) { /* a direction */
    return (struct vec3){vec3_dot(v, f->x), vec3_dot(v, f->y), vec3_dot(v, f->z)};
}

static inline struct vec3 frame_out(const struct frame *f, struct vec3 v) { /* a direction */
    return vec3_add(vec3_add(vec3_scale(f->x, v.x), vec3_scale(f->y, v.y)), vec3_scale(f->z, v.z));
}

#endif
