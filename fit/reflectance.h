/*
 * reflectance.h — radiance factor of a surface by the composite model of Nishi and Tominaga, and all its
 * derivatives.
 *
 * beta = S L1(sigma) + kappa q S^2 L2(sigma) + beta' D(gamma) G F(n) / (cos theta_i cos theta_r): Oren-Nayar
 * diffuse, interreflection, Torrance-Sparrow specular, in the stable forms of reflection-model.md 2.2. A
 * perfect diffuser is 1.
 *
 * Geometry   in plane: theta_i_deg in [0, 90), theta_v_deg in (-90, 90), > 0 on the mirror side.
 * Parameter-free factors are computed once per point (struct reflectance_geometry) and reused by every
 * evaluation. Parameters value[MATERIAL_PARAMETERS] in the order of enum material_parameter; kappa and q are
 * inputs. Shapes     n points; beta[n]; gradient[n * k] row by row or NULL, k = the model's number of
 * parameters. Domain     |theta| < 90 deg, S, beta' >= 0, sigma, gamma > 0, n > 1. Outside: -ERR_RANGE,
 * nothing written. Promises   no allocation, no global state, any thread; reciprocal bit for bit in plane.
 * Source     reflection-model.md 1.2, 1.3, 1.6, 2.2; paper equations 1 to 5.
 * Checked    tests/unit/test_reflectance.c against MPFR.
 */
#ifndef FIT_REFLECTANCE_H
#define FIT_REFLECTANCE_H

#include <stddef.h>

#include "proto/err.h"
#include "proto/material.h"

enum reflectance_model {
    REFLECTANCE_LAMBERT,
    REFLECTANCE_OREN_NAYAR,
    REFLECTANCE_EQ1,
    REFLECTANCE_COMPOSITE
};

struct reflectance_geometry {
    double visibility;      /* G / (cos theta_i cos theta_r) */
    double phi2;            /* squared angle between normal and facet, rad^2 */
    double cos_q, sin2_q;   /* of theta_Q */
    double a2, a3;          /* C2 and C3 terms without their sigma factor */
    double interreflection; /* 0.17 (1 - c u^2) */
};

struct reflectance_parts {
    double diffuse, interreflection, specular;
};

int reflectance_geometry(struct reflectance_geometry *g, double theta_i_deg, double theta_v_deg,
                         struct err *e);
int reflectance_parameters(enum reflectance_model model); /* k */
int reflectance_eval(enum reflectance_model model, size_t n, const struct reflectance_geometry *g,
                     const double *value, double kappa, double q, double *beta, double *gradient,
                     struct err *e);
int reflectance_eval_parts(enum reflectance_model model, const struct reflectance_geometry *g,
                           const double *value, double kappa, double q, struct reflectance_parts *parts,
                           struct err *e);

#endif
