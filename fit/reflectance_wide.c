#include "fit/reflectance_wide.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

/* Plain loops that the compiler turns into vectors (see the Makefile): only + - * /, square roots, choices and
 * the bits of a number, all exact by IEEE 754, so that every width gives the same bits. */
#define INLINE static inline __attribute__((always_inline))
#define LN2_HIGH 6.93147180369123816490e-01 /* 33 bits: times a whole number below 2^20 it is exact */
#define LN2_LOW 1.90821492927058770002e-10
#define ROUNDER 0x1.8p52 /* added and taken off, it rounds to a whole number, which stands in the low bits */
#define EXP_LOWEST (-746.0) /* exp of it is 0 */
#define EXPONENT_GUARD 64   /* a result below the normal numbers is rounded once, by the last product */
#define WIDTHS_MAX 1e150    /* as in fit/lobe.c */

INLINE uint64_t bits_of(double x) {
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

INLINE double number_of(uint64_t bits) {
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* exp(x), x <= 0: x = k ln2 + r, |r| <= ln2 / 2, and Taylor's series to r^13 (the next term is 4e-18). */
INLINE double exp_negative(double argument) {
    double x = argument < EXP_LOWEST ? EXP_LOWEST : argument;
    double shifted = x * M_LOG2E + ROUNDER, k = shifted - ROUNDER;
    double r = (x - k * LN2_HIGH) - k * LN2_LOW;
    double p = 1.0 / 6227020800;
    p = p * r + 1.0 / 479001600;
    p = p * r + 1.0 / 39916800;
    p = p * r + 1.0 / 3628800;
    p = p * r + 1.0 / 362880;
    p = p * r + 1.0 / 40320;
    p = p * r + 1.0 / 5040;
    p = p * r + 1.0 / 720;
    p = p * r + 1.0 / 120;
    p = p * r + 1.0 / 24;
    p = p * r + 1.0 / 6;
    p = p * r + 0.5;
    p = 1 + (r + r * r * p);
    double scale = number_of((bits_of(shifted) + EXPONENT_GUARD + 1023) << 52);
    return p * scale * 0x1p-64;
}

/* ln(1 + u), u >= 0: the mantissa of 1 + u by 2 artanh((f - 1) / (f + 1)), and what rounding 1 + u lost. */
INLINE double log1p_positive(double u) {
    double m = 1 + u, lost = (u - (m - 1)) / m;
    uint64_t bits = bits_of(m);
    double f = number_of((bits & 0xfffffffffffffULL) | 0x3ff0000000000000ULL);
    double e = number_of((bits >> 52) | 0x4330000000000000ULL) - (0x1p52 + 1023);
    bool upper = f > M_SQRT2;
    e = upper ? e + 1 : e;
    f = upper ? 0.5 * f : f;
    double s = (f - 1) / (f + 1), z = s * s, sum = 1.0 / 23;
    for (int odd = 21; odd >= 3; odd -= 2) { /* |s| <= 0.172: the next term is below 1e-18 */
        sum = sum * z + 1.0 / odd;
    }
    return e * LN2_HIGH + (2 * s + (2 * s * z * sum + (e * LN2_LOW + lost)));
}

struct value_slope { /* more: of D the derivative of its logarithm by tail, of F its second by n */
    double value, slope, more;
};

INLINE struct value_slope gaussian(double phi_rad, double inverse_gamma) {
    double widths = phi_rad * inverse_gamma, log_d = -M_LN2 * widths * widths;
    return (struct value_slope){exp_negative(log_d), -2 * log_d * inverse_gamma, 0};
}

/* lobe_tailed, both branches of each of its choices. */
INLINE struct value_slope tailed(const struct lobe_tail *t, double phi_rad, double inverse_gamma) {
    double plain = phi_rad * inverse_gamma, widths = plain < WIDTHS_MAX ? plain : WIDTHS_MAX;
    double xs = t->strength * widths * widths, u = xs * t->tail, log_u = log1p_positive(u);
    double log_d = u > 1e-16 ? -xs * (log_u / u) : -xs;
    double inverse = 1 / (1 + u), r = xs / (2 + u), s = u / (2 + u), z = s * s, sum = 0;
    for (int odd = 25; odd >= 3; odd -= 2) {
        sum = sum * z + 1.0 / odd;
    }
    double series = 2 * r * r * (1 / (1 + s) + s * sum);
    double direct = (log_u - u * inverse) / t->tail / t->tail;
    return (struct value_slope){exp_negative(log_d), 2 * xs * inverse * inverse_gamma,
                                (u < 0.5 ? series : direct) - t->bend * xs * inverse};
}

struct snell { /* of one geometry and index: root = sqrt(n^2 - sin^2), and inverses of what holds it */
    double c, s2, by_sum, by_both, root_slope, by_root;
};

/* d^2 F / dn^2 through root: r and p = r t are the amplitudes of both polarisations. Costs nothing where it is not read. */
INLINE double reflectance_curve(const struct reflectance_wide *x, double r, double t, const struct snell *y) {
    double r1 = 2 * y->c * y->by_sum * y->by_sum, r2 = -2 * r1 * y->by_sum;
    double t1 = 2 * y->c * y->s2 * y->by_both * y->by_both, t2 = -2 * y->c * t1 * y->by_both;
    double p = r * t, p1 = r1 * t + r * t1, p2 = r2 * t + 2 * r1 * t1 + r * t2;
    double first = x->perpendicular * r * r1 + x->parallel * p * p1;
    double second = x->perpendicular * (r1 * r1 + r * r2) + x->parallel * (p1 * p1 + p * p2);
    return second * y->root_slope * y->root_slope - first * y->s2 * y->by_root * y->by_root * y->by_root;
}

/* fresnel_reflectance with one division. */
INLINE struct value_slope reflectance(const struct reflectance_wide *x, double c, double s2) {
    double root = sqrt(x->n2_1 + c * c), sum = root + c, cr = c * root, both = cr + s2;
    double inverse = 1 / (root * sum * both);
    double by_sum = inverse * root * both, by_both = inverse * root * sum,
           n_by_root = x->n * (inverse * sum * both);
    double r = x->n2_1 * by_sum * by_sum, rs = r * r, t = (cr - s2) * by_both;
    double shape = x->perpendicular + x->parallel * (t * t);
    double rs_slope = 4 * c * r * n_by_root * by_sum * by_sum;
    double t_slope = 2 * s2 * c * n_by_root * by_both * by_both;
    return (struct value_slope){
        0.5 * rs * shape, 0.5 * rs_slope * shape + rs * x->parallel * t * t_slope,
        reflectance_curve(x, r, t, &(struct snell){c, s2, by_sum, by_both, n_by_root, inverse * sum * both})};
}

/* fresnel_transmittance over that at normal incidence; slope: of the logarithm. */
INLINE struct value_slope transmittance(const struct reflectance_wide *x, double c) {
    double n = x->n_d, n2 = n * n, n2_1 = (n - 1) * (n + 1), s2 = (1 - c) * (1 + c);
    double root = sqrt(n2_1 + c * c), sum = root + c, sum_p = n2 * c + root;
    double inverse = 1 / (root * sum * sum_p);
    double by_root = inverse * sum * sum_p, by_sum = inverse * root * sum_p, by_p = inverse * root * sum;
    double ts = 4 * c * root * by_sum * by_sum, tp = 4 * (n2 * c * by_p) * (root * by_p);
    double ts_log = -(n * by_root) * (n2_1 * by_sum * by_sum) * by_root;
    double tp_log = (n2_1 * by_p) * ((n2 * c * c - s2) * by_p) * ((2 * s2 - n2) / n * by_root) * by_root;
    return (struct value_slope){0.5 * (ts + tp) / x->t0, (ts * ts_log + tp * tp_log) / (ts + tp) - x->t0_log,
                                0};
}

INLINE double scaled(double size, double log_slope) {
    return size > 0 ? size * log_slope : 0;
}

enum specular_kind { NO_LOBE, GAUSSIAN, TAILED, TWO_LOBES };

/* One model's loop: the last four arguments are constants, so that nothing is decided within it. */
INLINE void loop(const struct reflectance_wide *at, const struct reflectance_wide_view *v, bool rough,
                 bool transmitted, enum specular_kind specular, bool curved) {
    const struct reflectance_wide x = *at;
    const double *visibility = v->in[0], *phi_rad = v->in[1], *cos_q = v->in[2], *sin2_q = v->in[3];
    const double *direct = v->in[4], *interreflection = v->in[5], *cos_high = v->in[6], *cos_low = v->in[7];
    double *beta = v->beta, *by_s = v->slope[MATERIAL_S], *by_sigma = v->slope[MATERIAL_SIGMA];
    double *by_gamma = v->slope[MATERIAL_GAMMA], *by_height = v->slope[MATERIAL_BETA_PRIME];
    double *by_n = v->slope[MATERIAL_N], *by_1 = v->slope[MATERIAL_EXTRA_1],
           *by_2 = v->slope[MATERIAL_EXTRA_2], *by_n_twice = v->by_n_twice;
    const size_t n = v->n / REFLECTANCE_BATCH_LANES * REFLECTANCE_BATCH_LANES;
#pragma GCC ivdep
    for (size_t i = 0; i < n; i++) {
        double sum = x.s, slope_s = 1;
        if (rough) {
            double l1 = x.c1 + x.k * direct[i], l2 = x.j * interreflection[i];
            double slope_sigma =
                x.s * (x.c1_slope + x.k_slope * direct[i]) + x.s2_kappa_q * x.j_slope * interreflection[i];
            sum = x.s * l1 + x.s2_kappa_q * l2;
            slope_s = l1 + x.s_kappa_q * l2;
            if (transmitted) {
                struct value_slope high = transmittance(&x, cos_high[i]), low = transmittance(&x, cos_low[i]);
                double factor = high.value * low.value;
                sum *= factor;
                slope_s *= factor;
                slope_sigma *= factor;
                by_1[i] = sum * (high.slope + low.slope);
            }
            by_sigma[i] = slope_sigma;
        }
        by_s[i] = slope_s;
        if (specular != NO_LOBE) {
            struct value_slope d = specular == TAILED ? tailed(&x.tail, phi_rad[i], x.inverse_gamma)
                                                      : gaussian(phi_rad[i], x.inverse_gamma);
            struct value_slope f = reflectance(&x, cos_q[i], sin2_q[i]);
            double lobe = d.value * visibility[i], unit = lobe * f.value, first = x.height * unit;
            double slope_n = x.height * lobe * f.slope;
            by_gamma[i] = scaled(first, d.slope);
            by_height[i] = unit;
            sum += first;
            if (specular == TAILED) {
                by_1[i] = scaled(first, d.more);
            }
            if (specular == TWO_LOBES) {
                struct value_slope d2 = gaussian(phi_rad[i], x.inverse_gamma_2);
                double lobe_2 = d2.value * visibility[i], unit_2 = lobe_2 * f.value,
                       second = x.height_2 * unit_2;
                by_1[i] = scaled(second, d2.slope);
                by_2[i] = unit_2;
                slope_n += x.height_2 * lobe_2 * f.slope;
                sum += second;
            }
            by_n[i] = slope_n;
            if (curved) {
                by_n_twice[i] = x.height * lobe * f.more;
            }
        }
        beta[i] = sum;
    }
}

INLINE void all_models(enum reflectance_model model, const struct reflectance_wide *x,
                       const struct reflectance_wide_view *v) {
    switch (model) {
    case REFLECTANCE_LAMBERT:
        loop(x, v, false, false, NO_LOBE, false);
        break;
    case REFLECTANCE_OREN_NAYAR:
        loop(x, v, true, false, NO_LOBE, false);
        break;
    case REFLECTANCE_EQ1:
        v->by_n_twice ? loop(x, v, false, false, GAUSSIAN, true) : loop(x, v, false, false, GAUSSIAN, false);
        break;
    case REFLECTANCE_COMPOSITE:
        v->by_n_twice ? loop(x, v, true, false, GAUSSIAN, true) : loop(x, v, true, false, GAUSSIAN, false);
        break;
    case REFLECTANCE_HEAVY_TAIL:
        loop(x, v, true, false, TAILED, false);
        break;
    case REFLECTANCE_TRANSMITTED:
        loop(x, v, true, true, GAUSSIAN, false);
        break;
    case REFLECTANCE_TWO_LOBE:
        loop(x, v, true, false, TWO_LOBES, false);
        break;
    case REFLECTANCE_MODELS:
        break;
    }
}

typedef void run(enum reflectance_model model, const struct reflectance_wide *x,
                 const struct reflectance_wide_view *v);

static void run_sse2(enum reflectance_model model, const struct reflectance_wide *x,
                     const struct reflectance_wide_view *v) {
    all_models(model, x, v);
}

__attribute__((target("avx2"))) static void run_avx2(enum reflectance_model model,
                                                     const struct reflectance_wide *x,
                                                     const struct reflectance_wide_view *v) {
    all_models(model, x, v);
}

__attribute__((target("avx512f,avx512dq,prefer-vector-width=512"))) static void
run_avx512(enum reflectance_model model, const struct reflectance_wide *x,
           const struct reflectance_wide_view *v) {
    all_models(model, x, v);
}

void reflectance_wide_run(enum reflectance_width width, enum reflectance_model model,
                          const struct reflectance_wide *x, const struct reflectance_wide_view *v) {
    static run *const runs[REFLECTANCE_WIDTHS] = {
        [REFLECTANCE_SSE2] = run_sse2, [REFLECTANCE_AVX2] = run_avx2, [REFLECTANCE_AVX512] = run_avx512};
    runs[width](model, x, v);
}
