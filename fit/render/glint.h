/*
 * glint.h — directions drawn at where a flat glossy surface mirrors a light: the other half of what paths miss.
 *
 * Seen from anywhere, a flat shape of one paint mirrors a light of direction l around -r, r the mirror of l at its
 * normal m; how far around, its own lobe says. So from a point that sees it a direction is drawn as -o, o a direction
 * that facets of that paint mirror l to (facet.h), with their density. Each pair of a flat shape and a light that it
 * sees is one glint, taken as often as the lobe has of its albedo there. Lights with extent count by their middle; an
 * environment has none, nor has a shape of several paints.
 *
 * Promises   the density is that of the draw, for any direction.
 * Checked    tests/unit/test_aim.c
 */
#ifndef FIT_RENDER_GLINT_H
#define FIT_RENDER_GLINT_H

#include "fit/render/aim.h"
#include "fit/render/energy.h"

#define GLINTS 16

struct glint {
    int target; /* of aim */
    const struct aim_target *shape;
    const struct shade_paint *drawn;
    struct vec3 normal, l;
    double light;                /* its share in all lights */
    const struct energy *energy; /* of its paint */
    double share;
};

struct glints {
    int n;
    struct glint glint[GLINTS];
};

struct glint_view { /* from one point; share: of all together, at most 1/2 */
    int n;
    const struct glint *glint[GLINTS];
    double share, sum;
};

/* Beyond GLINTS the rest is not drawn at. */
void glint_make(struct glints *glints, const struct scene *scene, const struct aim *aim,
                const struct energy *energy);
void glint_from(const struct glints *glints, const struct aim_view *seen, struct glint_view *view);
/* u: two independent numbers in (0, 1); the view must hold a glint. */
bool glint_sample(const struct glint_view *view, const double u[2], struct vec3 *l);
double glint_density(const struct glint_view *view, struct vec3 l);

#endif
