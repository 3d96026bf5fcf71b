#include "fit/render/facet.h"

#define X_MAX (M_PI * M_PI / 4) /* phi^2 of a facet on edge */

/* D of a heavy tail is (1 + c x)^-1/t in x = phi^2: its integral is (exp(bend log1p(c x)) - 1) / (c bend). */
static double bend_of(const struct shade_paint *p) {
    return (p->tail - 1) / p->tail;
}

static double integral_tail(const struct shade_paint *p) {
    double c = p->tail * p->tail_strength, bend = bend_of(p), whole = log1p(c * X_MAX);
    return (bend != 0 ? expm1(bend * whole) / bend : whole) / c;
}

static double integral_gaussian(double exponent) {
    return -expm1(-exponent * X_MAX) / exponent;
}

/* Each lobe's part of the integral of D over phi^2. */
static double first_part(const struct shade_paint *p) {
    if (!(p->beta_prime > 0)) {
        return 0;
    }
    return p->beta_prime * (p->tail > 0 ? integral_tail(p) : integral_gaussian(p->exponent));
}

static double second_part(const struct shade_paint *p) {
    return p->beta_prime_2 > 0 ? p->beta_prime_2 * integral_gaussian(p->exponent_2) : 0;
}

static double draw_tail(const struct shade_paint *p, double u) {
    double c = p->tail * p->tail_strength, bend = bend_of(p), whole = log1p(c * X_MAX);
    return expm1(bend != 0 ? log1p(u * expm1(bend * whole)) / bend : u * whole) / c;
}

static double draw_gaussian(double exponent, double u) {
    return -log1p(u * expm1(-exponent * X_MAX)) / exponent;
}

bool facet_sample(const struct shade_paint *paint, struct vec3 n, struct vec3 v, const double u[2],
                  struct vec3 *l) {
    double first = first_part(paint), second = second_part(paint), at = u[0] * (first + second), x;
    if (!(first + second > 0)) {
        return false;
    }
    if (at < first) { /* which lobe, and what is left of the number for the angle in it */
        x = paint->tail > 0 ? draw_tail(paint, at / first) : draw_gaussian(paint->exponent, at / first);
    } else {
        x = draw_gaussian(paint->exponent_2, (at - first) / second);
    }
    double phi = sqrt(x), azimuth = 2 * M_PI * u[1];
    struct vec3 s, t;
    vec3_frame(n, &s, &t);
    struct vec3 across = vec3_add(vec3_scale(s, cos(azimuth)), vec3_scale(t, sin(azimuth)));
    struct vec3 h = vec3_add(vec3_scale(n, cos(phi)), vec3_scale(across, sin(phi)));
    *l = vec3_unit(vec3_sub(vec3_scale(h, 2 * vec3_dot(v, h)), v));
    return true;
}

double facet_density(const struct shade_paint *paint, struct vec3 n, struct vec3 v, struct vec3 l) {
    double whole = first_part(paint) + second_part(paint);
    struct vec3 h = vec3_add(v, l), across = vec3_cross(n, h);
    double length = vec3_length(h), along = fabs(vec3_dot(n, h)); /* of h or of -h: both mirror v to l */
    if (!(whole > 0 && length > 0)) {
        return 0;
    }
    double sine = vec3_length(across) / length, phi = atan2(sine, along / length);
    double bent = sine > 1e-8 ? phi / sine : 1;
    /* |v.h| = length / 2 for h of length 1 */
    return shade_distribution(SHADE_RELATIVES, paint, phi * phi) * bent / (M_PI * whole * 2 * length);
}
