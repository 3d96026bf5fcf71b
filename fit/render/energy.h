/*
 * energy.h — what a paint does to light that comes from other surfaces: how much it keeps, and by which of its parts.
 *
 * A fitted model may return more light than it receives. One bounce is a measured radiance factor and stays what it
 * is; a series of bounces would grow without end. So light on its way over several surfaces is scattered by each of
 * them with
 *     scale(theta_i, theta_r) = 1 / max(1, A(theta_i), A(theta_r)),    A = albedo (albedo.h) in the band of the largest S
 * which holds both the energy from any direction and the radiance to any direction at 1, and is the same both ways.
 * ENERGY_REPORT: 1 everywhere; what it would have been is only told.
 *
 * Tables     33 cosines of the angle to the normal, straight lines between them; below the first, its value.
 * Checked    tests/unit/test_path.c
 */
#ifndef FIT_RENDER_ENERGY_H
#define FIT_RENDER_ENERGY_H

#include "fit/render/paint.h"

#define ENERGY_ANGLES 33

enum energy_policy { ENERGY_SCALE, ENERGY_REPORT };

struct energy {              /* of one paint */
    double s_max, s_typical; /* geometric mean: errors of dark bands count as much as those of bright ones */
    double excess[ENERGY_ANGLES]; /* max(1, A) */
    double share
        [ENERGY_ANGLES]; /* of the lobe in A, with the mean S: how often its directions are worth drawing */
};

void energy_make(struct energy *energy, const struct paint *paint, enum energy_policy policy);
double energy_scale(const struct energy *energy, double cos_i, double cos_r);
double energy_share(const struct energy *energy, double cos_r);

#endif
