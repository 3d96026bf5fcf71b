/*
 * intersect.h — what a ray meets in a scene, and whether light reaches a place.
 *
 * The nearest hit over all shapes decides what is seen; any hit decides what is lit. Both begin a little above the
 * surface they leave, so that no surface shadows itself by rounding.
 *
 * Shapes     hit->shape: index into the scene's shapes; hit->t_mm along the ray.
 * Units      far_mm: how far the light is; INFINITY where it is parallel. l of length 1, towards the light.
 * Promises   no allocation, any thread.
 * Checked    tests/unit/test_intersect.c, test_render.c
 */
#ifndef FIT_RENDER_INTERSECT_H
#define FIT_RENDER_INTERSECT_H

#include "fit/render/scene.h"

/* False: nothing; *hit is then not filled. */
bool intersect_nearest(const struct scene *scene, const struct ray *ray, struct hit *hit);
/* Whether anything, the surface's own relief included, stands between a hit and what lies far_mm away along l. */
bool intersect_blocked(const struct scene *scene, const struct hit *from, struct vec3 l, double far_mm);
/* The ray that leaves a hit in a direction of length 1. */
struct ray intersect_leave(const struct scene *scene, const struct hit *from, struct vec3 direction);

#endif
