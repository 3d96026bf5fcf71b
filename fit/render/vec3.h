/*
 * vec3.h — vectors of three doubles: places in millimetres, directions of length 1.
 *
 * Right-handed: x to the right, y up, z towards the camera of a scene without any turn.
 * Checked    tests/unit/test_render.c
 */
#ifndef FIT_RENDER_VEC3_H
#define FIT_RENDER_VEC3_H

#include <math.h>

struct vec3 {
    double x, y, z;
};

static inline struct vec3 vec3_add(struct vec3 a, struct vec3 b) {
    return (struct vec3){a.x + b.x, a.y + b.y, a.z + b.z};
}

static inline struct vec3 vec3_sub(struct vec3 a, struct vec3 b) {
    return (struct vec3){a.x - b.x, a.y - b.y, a.z - b.z};
}

static inline struct vec3 vec3_scale(struct vec3 a, double s) {
    return (struct vec3){a.x * s, a.y * s, a.z * s};
}

static inline double vec3_dot(struct vec3 a, struct vec3 b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline struct vec3 vec3_cross(struct vec3 a, struct vec3 b) {
    return (struct vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

static inline double vec3_length(struct vec3 a) {
    return sqrt(vec3_dot(a, a));
}

/* The zero vector stays what it is. */
static inline struct vec3 vec3_unit(struct vec3 a) {
    double length = vec3_length(a);
    return length > 0 ? vec3_scale(a, 1 / length) : a;
}

/* Two directions that make a right-handed frame with n (Duff et al., JCGT 6(1) 2017: no case at n.z = -1). */
static inline void vec3_frame(struct vec3 n, struct vec3 *s, struct vec3 *t) {
    double sign = copysign(1, n.z), a = -1 / (sign + n.z), b = n.x * n.y * a;
    *s = (struct vec3){1 + sign * n.x * n.x * a, sign * b, -sign * n.x};
    *t = (struct vec3){b, sign + n.y * n.y * a, -n.y};
}

#endif
