/*
 * facet.h — directions drawn as the facets of a paint's lobe reflect: for the specular part alone.
 *
 * A facet leans by phi from the normal n with the density D(phi) / integral of D over the half space of facets, where D
 * is all that the paint has (Gaussian or heavy tail, and a second lobe); v mirrored by it is l. Per solid angle of l
 *     density = D(phi) (phi / sin phi) / (pi I) / (4 |v.h|),     I = integral of D over phi^2 up to (pi/2)^2
 * so that D falls out of the weight c / density: what is left is smooth.
 *
 * Geometry   n, v, l of length 1. l may lie below the surface, where c is 0; the density holds there too, and its
 *            integral over all l is 1.
 * Promises   density(l, v) = density(v, l); finite but for l = -v, where it is 0; facet_sample is false, and the
 *            density 0, for a paint without a lobe.
 * Source     rendering.md 4.3; heavy tail: the same substitution x = phi^2.
 * Checked    tests/unit/test_facet.c
 */
#ifndef FIT_RENDER_FACET_H
#define FIT_RENDER_FACET_H

#include "fit/render/shade.h"

/* u: two independent numbers in (0, 1). */
bool facet_sample(const struct shade_paint *paint, struct vec3 n, struct vec3 v, const double u[2],
                  struct vec3 *l);
double facet_density(const struct shade_paint *paint, struct vec3 n, struct vec3 v, struct vec3 l);

#endif
