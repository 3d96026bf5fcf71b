/*
 * reflectance.h — radiance factor of a surface by the model of Nishi and Tominaga, with all its derivatives.
 *
 * beta = S L1(sigma) + kappa q S^2 L2(sigma) + beta' D(gamma) G F(n) / (cos theta_i cos theta_r):
 * Oren-Nayar diffuse, interreflection, Torrance-Sparrow specular. A perfect diffuser is 1.
 *
 * Geometry   in plane: theta_i_deg in [0, 90), theta_v_deg in (-90, 90), > 0 on the mirror side. General:
 *            dphi_deg between the azimuths to source and sensor, 180 on the mirror side. Whatever depends on
 *            no parameter is computed once per point and reused by every evaluation.
 * Models     lambert: S. oren-nayar: S, sigma (with interreflection). eq1: S, gamma, beta', n (the paper's
 *            Eq. 1, Lambert and the specular term). composite: S, sigma, gamma, beta', n (Eq. 5), and with
 *            one thing more: heavy-tail: tail of D. transmitted: n_d, the diffuse part times
 *            T(theta_i) T(theta_r) / T(0)^2. two-lobe: gamma_2, beta'_2 of a second lobe with the same n.
 * Shapes     value[MATERIAL_PARAMETERS] by enum material_parameter; those of other models are not read.
 *            n points; beta[n]; gradient[n * k] row by row or NULL: column j is d beta / d parameter
 *            reflectance_parameter(model, j), k = reflectance_parameters(model).
 * Domain     |theta| < 90 deg; S, beta', kappa, q >= 0; sigma, gamma > 0; n > 1; n_d >= 1; each at most 1e50;
 *            tail in 0 .. 2; polarisation in -1 .. 1.
 * Promises   no allocation, no global state, any thread; the same inputs give the same bits; the same
 *            bits when source and sensor change places, and by both geometries in plane; never a NaN.
 * Errors     -ERR_RANGE outside the domain; nothing is written.
 * Source     reflection-model.md 1.2 (Oren-Nayar 1995), 1.3 (Torrance-Sparrow as Tominaga writes it),
 *            1.6 (derivatives), 2.2 (stable forms), 6 (relatives); paper equations 1 to 5.
 * Checked    tests/unit/test_reflectance.c, test_reflectance_models.c against MPFR at 120 digits.
 */
#ifndef FIT_REFLECTANCE_H
#define FIT_REFLECTANCE_H

#include <stdbool.h>
#include <stddef.h>

#include "proto/err.h"
#include "proto/material.h"

#ifdef __cplusplus
extern "C" {
#endif

enum reflectance_model {
    REFLECTANCE_LAMBERT,
    REFLECTANCE_OREN_NAYAR,
    REFLECTANCE_EQ1,
    REFLECTANCE_COMPOSITE,
    REFLECTANCE_HEAVY_TAIL,
    REFLECTANCE_TRANSMITTED,
    REFLECTANCE_TWO_LOBE,
    REFLECTANCE_MODELS
};

enum reflectance_kind { /* what a parameter is: its domain, bounds and coordinate follow from it */
                        REFLECTANCE_ALBEDO,      /* S */
                        REFLECTANCE_ROUGHNESS,   /* sigma */
                        REFLECTANCE_WIDTH,       /* gamma, gamma_2 */
                        REFLECTANCE_HEIGHT,      /* beta', beta'_2 */
                        REFLECTANCE_INDEX,       /* n */
                        REFLECTANCE_TAIL,        /* tail */
                        REFLECTANCE_TRANSMISSION /* n_d */
};

struct reflectance_optics {
    double kappa, q;     /* of the interreflection: 1, or pi as the paper prints it; mean(S^2) / mean(S)^2 */
    double polarisation; /* P: F = ((1 + P) R_s + (1 - P) R_p) / 2 */
};

struct reflectance_geometry {
    double visibility;        /* G / (cos theta_i cos theta_r) */
    double phi_rad;           /* angle between normal and facet */
    double cos_q, sin2_q;     /* of theta_Q, the angle of incidence on the facet */
    double direct;            /* C2 and C3 terms without their sigma factor */
    double interreflection;   /* 0.17 (1 - cos(dphi) u^2) */
    double cos_high, cos_low; /* of the larger and the smaller of theta_i and theta_r */
};

struct reflectance_parts {
    double diffuse, interreflection, specular;
};

int reflectance_find(const char *name, enum reflectance_model *model, struct err *e); /* -ERR_USAGE */
const char *reflectance_name(enum reflectance_model model);
int reflectance_parameters(enum reflectance_model model); /* k */
enum material_parameter reflectance_parameter(enum reflectance_model model, int column);
enum reflectance_kind reflectance_kind(enum reflectance_model model, enum material_parameter parameter);
int reflectance_column(enum reflectance_model model, enum material_parameter parameter); /* -1: not of it */

int reflectance_geometry(struct reflectance_geometry *g, double theta_i_deg, double theta_v_deg,
                         struct err *e);
int reflectance_geometry_general(struct reflectance_geometry *g, double theta_i_deg, double theta_r_deg,
                                 double dphi_deg, struct err *e);
/* Whether the parameters are inside the domain; the other calls ask it themselves. */
int reflectance_check(enum reflectance_model model, const double *value,
                      const struct reflectance_optics *optics, struct err *e);
int reflectance_eval(enum reflectance_model model, size_t n, const struct reflectance_geometry *g,
                     const double *value, const struct reflectance_optics *optics, double *beta,
                     double *gradient, struct err *e);
int reflectance_eval_parts(enum reflectance_model model, const struct reflectance_geometry *g,
                           const double *value, const struct reflectance_optics *optics,
                           struct reflectance_parts *parts, struct err *e);
/* slope[n] = d beta / d polarisation */
int reflectance_polarisation_slope(enum reflectance_model model, size_t n,
                                   const struct reflectance_geometry *g, const double *value, double *slope,
                                   struct err *e);
/* The diffuse part of a composite or Oren-Nayar surface is S l1 + kappa q S^2 l2. */
void reflectance_diffuse_factors(const struct reflectance_geometry *g, double sigma, double *l1, double *l2);

#ifdef __cplusplus
}
#endif

#endif
