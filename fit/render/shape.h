/*
 * shape.h — the things a scene shows: where a ray meets them, with which normal and which paint.
 *
 * One struct for every kind, written by the scene's tables of keys; each kind keeps its own part and its own file
 * shape_KIND.c, and shape_hit, shape_prepare and shape_free ask the kind. Normals have length 1 and point outward
 * (flat shapes: towards their +z); what is seen from behind is black.
 *
 * Units      millimetres and degrees.
 * Errors     shape_prepare: -ERR_INPUT a size that is no size, a file that cannot be used (errors say where).
 * Promises   shape_hit: no allocation, any thread; a ray inside a surface does not meet it.
 * Checked    tests/unit/test_render_shapes.c
 */
#ifndef FIT_RENDER_SHAPE_H
#define FIT_RENDER_SHAPE_H

#include <stdbool.h>

#include "fit/render/frame.h"
#include "proto/err.h"

enum shape_kind { SHAPE_CYLINDER, SHAPE_SPHERE, SHAPE_KINDS };

struct shape_cylinder {
    double radius_mm, length_mm;
    bool open; /* no discs at its ends */
};

struct shape_sphere {
    double radius_mm;
};

struct shape {
    enum shape_kind kind;
    bool given[SHAPE_KINDS]; /* as written in the scene: one of them must be */
    char material[64];
    int paint; /* index into the scene's paints */
    double at_mm[3], turn_deg[3];
    int n_at, n_turn;
    struct frame frame;
    struct shape_cylinder cylinder;
    struct shape_sphere sphere;
};

struct hit {
    double t_mm; /* along the ray */
    struct vec3 position, normal;
    int paint, shape;
};

const char *shape_name(enum shape_kind kind);
int shape_prepare(struct shape *s, const char *folder, struct err_list *errors);
void shape_free(struct shape *s);
/* Nearer than hit->t_mm: fills *hit (all but shape) and returns true. */
bool shape_hit(const struct shape *s, const struct ray *ray, struct hit *hit);
/* No point of it is lit or seen through another of its points: it casts no shadow on itself. */
bool shape_is_convex(const struct shape *s);
/* The sphere around frame.at that holds all of it. */
double shape_reach_mm(const struct shape *s);

bool shape_cylinder_hit(const struct shape *s, const struct ray *ray, struct hit *hit);
bool shape_sphere_hit(const struct shape *s, const struct ray *ray, struct hit *hit);

#endif
