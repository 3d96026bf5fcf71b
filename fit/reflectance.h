/*
 * reflectance.h — radiance factor of a surface by the model of Nishi and Tominaga, with all its derivatives.
 *
 * beta = S L1(sigma) + kappa q S^2 L2(sigma) + beta' D(gamma) G F(n) / (cos theta_i cos theta_r):
 * Oren-Nayar diffuse, interreflection, Torrance-Sparrow specular. A perfect diffuser is 1.
 *
 * Geometry   in plane: theta_i_deg in [0, 90), theta_v_deg in (-90, 90), > 0 on the mirror side. Whatever
 *            depends on no parameter is computed once per point and reused by every evaluation.
 * Models     lambert: S. oren-nayar: S, sigma (with interreflection). eq1: S, gamma, beta', n (the paper's
 *            Eq. 1, Lambert and the specular term). composite: S, sigma, gamma, beta', n (Eq. 5).
 * Shapes     value[MATERIAL_PARAMETERS] by enum material_parameter; those of other models are not read.
 *            n points; beta[n]; gradient[n * k] row by row or NULL: column j is d beta / d parameter
 *            reflectance_parameter(model, j), k = reflectance_parameters(model). kappa, q: inputs.
 * Domain     |theta| < 90 deg; S, beta', kappa, q >= 0; sigma, gamma > 0; n > 1; each at most 1e50.
 * Promises   no allocation, no global state, any thread; the same inputs give the same bits; the same
 *            bits when source and sensor change places; never a NaN.
 * Errors     -ERR_RANGE outside the domain; nothing is written.
 * Source     reflection-model.md 1.2 (Oren-Nayar 1995), 1.3 (Torrance-Sparrow as Tominaga writes it),
 *            1.6 (derivatives), 2.2 (stable forms); paper equations 1 to 5.
 * Checked    tests/unit/test_reflectance.c against MPFR at 120 digits.
 */
#ifndef FIT_REFLECTANCE_H
#define FIT_REFLECTANCE_H

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
    REFLECTANCE_MODELS
};

struct reflectance_geometry {
    double visibility;      /* G / (cos theta_i cos theta_r) */
    double phi_rad;         /* angle between normal and facet */
    double cos_q, sin2_q;   /* of theta_Q, the angle of incidence on the facet */
    double direct;          /* C2 and C3 terms without their sigma factor */
    double interreflection; /* 0.17 (1 - cos(dphi) u^2) */
};

struct reflectance_parts {
    double diffuse, interreflection, specular;
};

int reflectance_find(const char *name, enum reflectance_model *model, struct err *e); /* -ERR_USAGE */
const char *reflectance_name(enum reflectance_model model);
int reflectance_parameters(enum reflectance_model model); /* k */
enum material_parameter reflectance_parameter(enum reflectance_model model, int column);

int reflectance_geometry(struct reflectance_geometry *g, double theta_i_deg, double theta_v_deg,
                         struct err *e);
int reflectance_eval(enum reflectance_model model, size_t n, const struct reflectance_geometry *g,
                     const double *value, double kappa, double q, double *beta, double *gradient,
                     struct err *e);
int reflectance_eval_parts(enum reflectance_model model, const struct reflectance_geometry *g,
                           const double *value, double kappa, double q, struct reflectance_parts *parts,
                           struct err *e);
/* The diffuse part of a composite or Oren-Nayar surface is S l1 + kappa q S^2 l2. */
void reflectance_diffuse_factors(const struct reflectance_geometry *g, double sigma, double *l1, double *l2);
/* Unpolarised reflectance of a facet; slope is d / dn. */
double reflectance_fresnel(double cos_q, double sin2_q, double n, double *slope);

#ifdef __cplusplus
}
#endif

#endif
