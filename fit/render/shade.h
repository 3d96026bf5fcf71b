/*
 * shade.h — the reflection model at one point of a picture, from vectors: three numbers for all wavelengths.
 *
 * radiance(k) / E(k) = a S(k) + b S(k)^2 + c, in units of the perfect diffuser at normal incidence; cos theta_i is
 * contained. Everything is evaluated in a bounded form (no tangent, no division by a sine), so that no direction
 * gives a NaN; the lobe's height at grazing exit is the model's own.
 *
 * Geometry   n, l, v of length 1: normal, towards the light, towards the eye; any of them, also equal or opposite.
 *            Light or eye not above the surface (cosine <= 0): all three are 0.
 * Features   a literal mask: what is not in it is not computed, and the compiler drops it. SHADE_HOISTED: the
 *            half vector and Fresnel's reflectance come from `half`, the same for all points (parallel light seen
 *            by a parallel camera); SHADE_LOBE_CUT, with it: no lobe where n.h < half->cut.
 * Promises   the same inputs give the same bits; finite for every paint in paint.h's domain.
 * Source     reflectance.h (the model); its bounded form: c_i cos(dphi) tan(beta) sin(alpha) = (l.v - c_i c_r) c_i / max(c_i, c_r),
 *            c_i tan((alpha + beta) / 2) = c_i (sin alpha + sin beta) / (c_i + c_r).
 * Checked    tests/unit/test_shade.c: against reflectance.h in plane, reciprocity, the list of extremes
 */
#ifndef FIT_RENDER_SHADE_H
#define FIT_RENDER_SHADE_H

#include <stdbool.h>

#include "fit/render/vec3.h"

#define SHADE_GRAZING 1e-15 /* cosines below are horizon: cos(90 deg) in double is 6e-17 */

enum shade_feature {
    SHADE_SIGMA = 1,    /* Oren-Nayar's direct terms and b */
    SHADE_SPECULAR = 2, /* c */
    SHADE_HOISTED = 4,
    SHADE_LOBE_CUT = 8,
    SHADE_RELATIVES = 16 /* a heavy tail, a second lobe, transmission in and out */
};

struct shade_paint { /* whatever of a paint depends on no direction */
    double c1;       /* 1 - 0.5 sigma^2 / (sigma^2 + 0.33) */
    double direct;   /* 0.45 sigma^2 / (sigma^2 + 0.09) */
    double side;     /* 0.125 sigma^2 / (sigma^2 + 0.09) */
    double inter;    /* 0.17 kappa sigma^2 / (sigma^2 + 0.13) */
    double beta_prime;
    double exponent;                 /* ln 2 / gamma^2 */
    double n2_1;                     /* (n - 1)(n + 1) */
    double tail, tail_strength;      /* D = (1 + tail strength phi^2)^(-1 / tail); tail 0: the Gaussian */
    double beta_prime_2, exponent_2; /* of the second lobe; 0: none */
    double n_d, inverse_t0;          /* diffuse part times T(theta_i) T(theta_r) / T(0)^2; n_d 1: none */
};

struct shade_half { /* of one light and one eye direction */
    struct vec3 h;  /* l + v, not of length 1 */
    double l_dot_v;
    double cos2_q; /* of the angle between l and h */
    double fresnel;
    double cut; /* of n.h: the lobe is under the tolerance below it */
};

struct shade_abc {
    double a, b, c;
};

/* Where many masks occur a compiler would rather keep one copy that asks at each point for all features. */
#define SHADE_FOLDED __attribute__((always_inline)) static inline

/* fmin and fmax are calls where a NaN must be looked after; here there is none. */
static inline double shade_least(double a, double b) {
    return a < b ? a : b;
}

static inline double shade_most(double a, double b) {
    return a > b ? a : b;
}

/* Fresnel's reflectance of a facet, unpolarised; fit/fresnel.h has the same with derivatives. */
static inline double shade_fresnel(double n2_1, double cos2_q) {
    double sin2_q = 1 - cos2_q, c = sqrt(cos2_q), root = sqrt(n2_1 + cos2_q), sum = root + c, cr = c * root;
    if (!(sum > 0)) {
        return 1;
    }
    double r = n2_1 / (sum * sum), t = (cr - sin2_q) / (cr + sin2_q);
    return 0.5 * r * r * (1 + t * t);
}

static inline struct shade_half shade_half(const struct shade_paint *p, struct vec3 l, struct vec3 v) {
    struct shade_half half = {.h = vec3_add(l, v), .l_dot_v = vec3_dot(l, v)};
    half.cos2_q = shade_least(0.25 * vec3_dot(half.h, half.h), 1);
    half.fresnel = shade_fresnel(p->n2_1, half.cos2_q);
    return half;
}

/* Oren and Nayar times cos theta_i: a without S, b without S^2. */
static inline void shade_rough(const struct shade_paint *p, double ci, double cr, double l_dot_v,
                               struct shade_abc *out) {
    double high = shade_most(ci, cr),
           low = shade_least(ci, cr); /* cosines of the smaller and of the larger angle */
    double sin_small = sqrt((1 - high) * (1 + high)), sin_large = sqrt((1 - low) * (1 + low));
    double u = acos(shade_least(high, 1)) * M_2_PI, u_large = acos(shade_least(low, 1)) * M_2_PI;
    double azimuthal = l_dot_v - ci * cr; /* cos(dphi) sin theta_i sin theta_r */
    double product = sin_small * sin_large;
    double cos_dphi = product > 0 ? shade_most(-1, shade_least(1, azimuthal / product)) : 0;
    double back = azimuthal < 0 && sin_large > 0 ? 1 - u * u * u / sin_large : 1;
    double scale = ci / high;
    double side =
        (1 - fabs(cos_dphi)) * (u * u_large) * (u * u_large) * (sin_small + sin_large) * ci / (ci + cr);
    out->a = ci * p->c1 + p->direct * azimuthal * scale * back + p->side * side;
    out->b = ci * p->inter * (1 - cos_dphi * u * u);
}

/* T(theta) / T(0) of unpolarised light (fit/fresnel.h). */
static inline double shade_transmittance(const struct shade_paint *p, double c) {
    double n2 = p->n_d * p->n_d, root = sqrt((p->n_d - 1) * (p->n_d + 1) + c * c);
    double sum = root + c, sum_p = n2 * c + root;
    return 2 * c * root * (1 / (sum * sum) + n2 / (sum_p * sum_p)) * p->inverse_t0;
}

SHADE_FOLDED double shade_distribution(const unsigned features, const struct shade_paint *p, double phi2) {
    if (!(features & SHADE_RELATIVES)) {
        return p->beta_prime * exp(-p->exponent * phi2);
    }
    double first =
        p->tail > 0 ? exp(-log1p(p->tail * p->tail_strength * phi2) / p->tail) : exp(-p->exponent * phi2);
    double second = p->beta_prime_2 > 0 ? p->beta_prime_2 * exp(-p->exponent_2 * phi2) : 0;
    return p->beta_prime * first + second;
}

/* The lobe times cos theta_i. */
SHADE_FOLDED double shade_lobe(const unsigned features, const struct shade_paint *p,
                               const struct shade_half *half, struct vec3 n, double ci, double cr) {
    double along = ci + cr;
    if ((features & SHADE_LOBE_CUT) && along < half->cut) {
        return 0;
    }
    struct vec3 across = vec3_cross(n, half->h);
    double phi = atan2(sqrt(vec3_dot(across, across)), along);
    double open = 1 / cr, shadowed = ci * along / (shade_most(ci, cr) * half->cos2_q);
    double visibility = shadowed < open ? shadowed : open;
    return shade_distribution(features, p, phi * phi) * visibility * half->fresnel;
}

SHADE_FOLDED struct shade_abc shade(const unsigned features, const struct shade_paint *p,
                                    const struct shade_half *fixed, struct vec3 n, struct vec3 l,
                                    struct vec3 v) {
    struct shade_abc out = {0, 0, 0};
    double ci = vec3_dot(n, l), cr = vec3_dot(n, v);
    if (!(ci > SHADE_GRAZING && cr > SHADE_GRAZING)) {
        return out;
    }
    out.a = ci;
    if (features & SHADE_SIGMA) {
        shade_rough(p, ci, cr, (features & SHADE_HOISTED) ? fixed->l_dot_v : vec3_dot(l, v), &out);
    }
    if ((features & SHADE_RELATIVES) && p->n_d > 1) {
        double through = shade_transmittance(p, ci) * shade_transmittance(p, cr);
        out.a *= through;
        out.b *= through;
    }
    if (features & SHADE_SPECULAR) {
        struct shade_half own;
        if (!(features & SHADE_HOISTED)) {
            own = shade_half(p, l, v);
            fixed = &own;
        }
        out.c = shade_lobe(features, p, fixed, n, ci, cr);
    }
    return out;
}

#endif
