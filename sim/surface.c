#include "sim/surface.h"

#include "fit/reflectance.h"
#include "sim/measured.h"

void surface_factors(const struct sim_surface *surface, double polarisation, double theta_i_deg,
                     double theta_v_deg, struct surface_factors *f) {
    double value[MATERIAL_PARAMETERS] = {[MATERIAL_S] = 1,
                                         [MATERIAL_SIGMA] = surface->sigma,
                                         [MATERIAL_GAMMA] = surface->gamma,
                                         [MATERIAL_BETA_PRIME] = surface->beta_prime,
                                         [MATERIAL_N] = surface->n};
    struct reflectance_geometry g;
    struct reflectance_parts parts;
    const struct reflectance_optics optics = {.kappa = 1, .q = 1, .polarisation = polarisation};
    const double side = theta_i_deg < 0 ? -1 : 1;
    *f = (struct surface_factors){0};
    if (reflectance_geometry(&g, side * theta_i_deg, side * theta_v_deg, NULL) != 0 ||
        reflectance_eval_parts(REFLECTANCE_COMPOSITE, &g, value, &optics, &parts, NULL) != 0)
        return;
    *f = (struct surface_factors){parts.diffuse, parts.interreflection, parts.specular};
}

double sim_surface_beta(const struct sim_surface *surface, double theta_i_deg, double theta_v_deg, int band) {
    if (surface->measured) {
        double beta[BANDS];
        measured_at(surface->measured, theta_i_deg, theta_v_deg, beta);
        return beta[band];
    }
    struct surface_factors f;
    double s = surface->s_lambda[band];
    surface_factors(surface, 0, theta_i_deg, theta_v_deg, &f);
    return s * f.l1 + s * s * f.l2 + f.specular;
}

/* Tridiagonal system by elimination; at both ends the spline goes on as a constant. */
void surface_spline(const double value[BANDS], double c[BANDS]) {
    double above[BANDS], diagonal = 5;
    c[0] = 6 * value[0] / diagonal;
    above[0] = 1 / diagonal;
    for (int k = 1; k < BANDS; k++) {
        diagonal = (k == BANDS - 1 ? 5 : 4) - above[k - 1];
        c[k] = (6 * value[k] - c[k - 1]) / diagonal;
        above[k] = 1 / diagonal;
    }
    for (int k = BANDS - 2; k >= 0; k--)
        c[k] -= above[k] * c[k + 1];
}
