/*
 * albedo.h — how much of the light that falls on a paint it returns, by the angle at which it falls.
 *
 * albedo(theta) = 1/pi times the integral of Y cos theta_r over the half space: diffuse S + inter S^2 + specular. A
 * fitted model may return more than it receives; a single bounce is rendered as fitted all the same, since it is a
 * measured radiance factor, and the angle from which it does so is told.
 *
 * Units      theta_deg in 0 .. 90. Quadrature to about 1e-3 of each part: midpoints, the lobe by facets spaced from its
 *            width up to the horizon.
 * Source     reflection-model.md 1.3 (specular albedo of the published sets).
 * Checked    tests/unit/test_albedo.c
 */
#ifndef FIT_RENDER_ALBEDO_H
#define FIT_RENDER_ALBEDO_H

#include "fit/render/paint.h"

struct albedo {
    double diffuse, inter, specular; /* of S, S^2 and 1 */
};

struct albedo albedo_at(const struct paint *paint, double theta_deg);
/* The smallest of ten angles, 0 .. 89.5 deg, at which the band of the largest S returns more than it receives; -1:
 * none. */
double albedo_above_one_deg(const struct paint *paint, double *highest);

#endif
