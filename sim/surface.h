/*
 * surface.h — a surface as the optics needs it: radiance factor of all bands at a geometry, and between bands.
 *
 * s_lambda[k] and every other value by band mean the band's triangular average (proto/bands.h). So that a spectrum
 * seen through those triangles returns it, the light between the band centres follows the linear spline c with
 * (c[k-1] + 4 c[k] + c[k+1]) / 6 = value[k] (surface_spline); beyond both ends it is constant.
 *
 * Checked    tests/unit/test_sim_light.c
 */
#ifndef SIM_SURFACE_H
#define SIM_SURFACE_H

#include "sim/sim.h"

/* beta = s * l1 + s^2 * l2 + specular at a geometry, for a modelled surface (kappa = 1). */
struct surface_factors {
    double l1, l2, specular;
};

/* theta_i_deg < 0: from the other side. All 0 where no light can be. */
void surface_factors(const struct sim_surface *surface, double polarisation, double theta_i_deg,
                     double theta_v_deg, struct surface_factors *f);
void surface_spline(const double value[BANDS], double c[BANDS]);
/* c at a wavelength, by the position on the band grid (lambda - 380) / 5, clamped. */
static inline double surface_between(const double c[BANDS], double at) {
    if (at <= 0)
        return c[0];
    if (at >= BANDS - 1)
        return c[BANDS - 1];
    int k = (int)at;
    return c[k] + (c[k + 1] - c[k]) * (at - k);
}

#endif
