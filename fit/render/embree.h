/*
 * embree.h — which triangles a ray may meet: Embree 3, loaded when the first mesh asks for it and not before.
 *
 * Embree works in floats. It proposes triangles; `accept` decides in double whether and where the ray meets each, so
 * that a hit is as exact as that of a quadric and no surface shadows itself by rounding.
 *
 * Units      those of the caller; coordinates about 0 (floats: 6e-8 of the largest is what a ray may miss by).
 * Promises   the same hits in the same process; embree_nearest and embree_blocked run in any thread.
 * Errors     embree_make: -ERR_STATE the library is not there, with the package to install; -ERR_NOMEM.
 * Source     Embree 3 API (rtcore.h), Debian's libembree3-3.
 * Checked    tests/unit/test_mesh_shape.c
 */
#ifndef FIT_RENDER_EMBREE_H
#define FIT_RENDER_EMBREE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "proto/err.h"

struct embree; /* one mesh */

struct embree_ray {
    float origin[3], direction[3], length;
    bool (*accept)(void *arg, uint32_t triangle);
    void *arg;
};

const char *embree_version(void); /* that goniorender was built for */
/* Makes sure that the library is loaded; embree_make does it too. */
int embree_load(struct err *e);
/* vertex(arg, i, v) and triangle(arg, i, corners) tell the i-th. */
int embree_make(struct embree **mesh, size_t n_vertices, void (*vertex)(void *arg, size_t i, float v[3]),
                size_t n_triangles, void (*triangle)(void *arg, size_t i, uint32_t corner[3]), void *arg,
                struct err *e);
void embree_free(struct embree *mesh);
/* After it accept has taken the nearest last, if it took any. */
void embree_nearest(const struct embree *mesh, const struct embree_ray *ray);
bool embree_blocked(const struct embree *mesh, const struct embree_ray *ray);

#endif
