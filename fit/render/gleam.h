/*
 * gleam.h — directions drawn where two glossy surfaces, one after the other, mirror a light to the eye.
 *
 * The lobe of the surface seen and the lobe of a flat surface around the mirrored light (glint.h) overlap; along what is
 * common to both, most of the light of a glossy corner comes. Each lobe is exp(-k phi^2), phi the lean of its half
 * vector; with the half vectors' tangential parts straightened around the brightest direction m the product is a bell
 * exp(-x'Px) of direction = unit(m + x), x at right angles to m; m and P come from a few steps of least squares, then m
 * moves along the slope of what the lobes are multiplied with. With R'R = P and g = R x, logistic densities b stand for
 * the bell, cut where a side of the target ends it (g_0 >= cut):
 *     density = sqrt(det P) b(g_0) b(g_1) / kept / (m . direction)^3,   kept = part of b above cut
 * How often: of the four ways over both surfaces (lobe or diffuse, twice) each is estimated from its brightest
 * direction, with nothing in between.
 *
 * Promises   the density is that of the draw, for any direction; 0 in the half space away from m.
 * Checked    tests/unit/test_gleam.c
 */
#ifndef FIT_RENDER_GLEAM_H
#define FIT_RENDER_GLEAM_H

#include "fit/render/glint.h"

struct gleam_surface { /* its lobe lies around the mirror of `way` */
    const struct shade_paint *drawn;
    struct vec3 normal, way;
    const struct energy *energy; /* of its paint */
};

struct gleam {
    struct vec3 middle;
    struct vec3 axis[2]; /* at right angles to it, of the bell's widths */
    struct vec3 dual[2]; /* at right angles to it and to the other axis; times its own axis 1 */
    double peak;         /* sqrt(det P) */
    double cut, kept;    /* along axis 0 */
    double share;
};

struct gleam_parts { /* by both lobes, by the near one alone, by the far one alone, by neither */
    double gleams, facets, glints, aim;
};

struct gleam_view { /* from one point; part: how often each way is worth drawing; below 1 in all, or 0 */
    int n;
    struct gleam gleam[GLINTS];
    double sum;
    struct gleam_parts part;
};

/* near: seen along its way; far: lit along its way. False: the lobes do not meet in front of both. */
bool gleam_make(const struct gleam_surface *near, const struct gleam_surface *far, struct gleam *gleam);
/* Nothing beyond the side of the target, seen from `from`, that most of it is beyond. */
void gleam_cut(struct gleam *gleam, const struct aim_target *target, struct vec3 from);
void gleam_none(struct gleam_view *view);
/* Of all glints; seen from `from`. */
void gleam_from(const struct glint_view *glints, const struct aim_view *seen,
                const struct gleam_surface *near, struct vec3 from, struct gleam_view *view);
/* u: two independent numbers in (0, 1); the view must hold a gleam. */
struct vec3 gleam_sample(const struct gleam_view *view, const double u[2]);
double gleam_density(const struct gleam_view *view, struct vec3 l);

#endif
