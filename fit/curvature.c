#include "fit/curvature.h"

#include <math.h>
#include <string.h>

#include "fit/loss.h"
#include "fit/roughness.h"

#define INLINE static inline __attribute__((always_inline))
#define LANES REFLECTANCE_BATCH_LANES

typedef double lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef lanes loose __attribute__((aligned(sizeof(double)), may_alias)); /* as it lies in a column */

enum { PLAIN, DIRECT, INTERREFLECTED, WIDTH_TWICE, WIDTH_INDEX, INDEX_TWICE };

struct view {
    size_t n;
    const double *phi_rad, *direct, *interreflection;
    double inverse_gamma;
    const struct curvature_columns *c;
};

bool curvature_known(const struct problem *p) {
    const bool simple = p->model == REFLECTANCE_LAMBERT || p->model == REFLECTANCE_OREN_NAYAR ||
                        p->model == REFLECTANCE_EQ1 || p->model == REFLECTANCE_COMPOSITE;
    return simple && loss_is_linear(p->loss) && p->nuisance.m == 0 && !p->aperture.weight;
}

INLINE void add(const struct view *v, double *sum) {
    const struct curvature_columns *c = v->c;
    lanes part[CURVATURE_SUMS];
    memset(part, 0, sizeof part);
    for (size_t i = 0; i < v->n; i += LANES) {
        const lanes weighted = *(const loose *)(c->root_weight + i) * *(const loose *)(c->residual + i);
        part[PLAIN] += weighted;
        part[DIRECT] += weighted * *(const loose *)(v->direct + i);
        part[INTERREFLECTED] += weighted * *(const loose *)(v->interreflection + i);
        if (c->by_height) {
            const lanes widths = *(const loose *)(v->phi_rad + i) * v->inverse_gamma,
                        log_d = -M_LN2 * widths * widths;
            const lanes leaning = weighted * log_d;
            part[WIDTH_TWICE] += leaning * (1 + log_d) * *(const loose *)(c->by_height + i);
            part[WIDTH_INDEX] += leaning * *(const loose *)(c->by_n + i);
            part[INDEX_TWICE] += weighted * *(const loose *)(c->by_n_twice + i);
        }
    }
    for (int s = 0; s < CURVATURE_SUMS; s++) {
        double half[LANES];
        memcpy(half, &part[s], sizeof half);
        sum[s] += ((half[0] + half[4]) + (half[2] + half[6])) + ((half[1] + half[5]) + (half[3] + half[7]));
    }
}

typedef void run(const struct view *v, double *sum);

static void run_sse2(const struct view *v, double *sum) {
    add(v, sum);
}

__attribute__((target("avx2"))) static void run_avx2(const struct view *v, double *sum) {
    add(v, sum);
}

__attribute__((target("avx512f,avx512dq"))) static void run_avx512(const struct view *v, double *sum) {
    add(v, sum);
}

void curvature_add(const struct problem *p, const double *value, const struct curvature_columns *c,
                   double sum[CURVATURE_SUMS]) {
    static run *const runs[REFLECTANCE_WIDTHS] = {
        [REFLECTANCE_SSE2] = run_sse2, [REFLECTANCE_AVX2] = run_avx2, [REFLECTANCE_AVX512] = run_avx512};
    double *const *column = p->aperture.batch.column; /* phi_rad, direct, interreflection in their order */
    const struct view v = {.n = reflectance_batch_room(c->n),
                           .phi_rad = column[1] + c->first,
                           .direct = column[4] + c->first,
                           .interreflection = column[5] + c->first,
                           .inverse_gamma = c->by_height ? 1 / value[MATERIAL_GAMMA] : 0,
                           .c = c};
    runs[reflectance_batch_width()](&v, sum);
}

struct derivatives { /* by ln sigma */
    double value, first, second;
};

static struct derivatives saturation(double x) { /* x = s^2 / (s^2 + a) */
    const double first = 2 * x * (1 - x);
    return (struct derivatives){x, first, 2 * first * (1 - 2 * x)};
}

static void put(double *second, int k, int a, int b, double x) {
    second[a * k + b] = second[b * k + a] = x;
}

static void form_diffuse(const struct problem *p, const double *value, const double *sum, double *second) {
    const int s = reflectance_column(p->model, MATERIAL_S),
              sigma = reflectance_column(p->model, MATERIAL_SIGMA);
    const double albedo = value[MATERIAL_S];
    if (sigma < 0) {
        put(second, p->k, s, s, albedo * sum[PLAIN]);
        return;
    }
    const struct roughness r = roughness_of(value[MATERIAL_SIGMA]);
    const struct derivatives h = saturation(r.h.value), k = saturation(r.k.value), j = saturation(r.j.value);
    const double squared = p->optics.kappa * p->optics.q * albedo * albedo * sum[INTERREFLECTED];
    put(second, p->k, s, s,
        albedo * ((1 - h.value / 2) * sum[PLAIN] + k.value * sum[DIRECT]) + 4 * squared * j.value);
    put(second, p->k, s, sigma,
        albedo * (-h.first / 2 * sum[PLAIN] + k.first * sum[DIRECT]) + 2 * squared * j.first);
    put(second, p->k, sigma, sigma,
        albedo * (-h.second / 2 * sum[PLAIN] + k.second * sum[DIRECT]) + squared * j.second);
}

/* F''/F and F'/F at 45 deg, where R_p = R_s^2: F = (R + R^2) / 2, R = r^2, r = (q - c) / (q + c). */
static double curve_45(double n, double *slope) {
    const double c = M_SQRT1_2, q = sqrt((n - 1) * (n + 1) + 0.5), q1 = n / q, q2 = -0.5 / (q * q * q);
    const double r = (n - 1) * (n + 1) / ((q + c) * (q + c)), square = r * r;
    const double r1 = 2 * c / ((q + c) * (q + c)), r2 = -2 * r1 / (q + c);
    const double by_q = 2 * r * r1, by_q_twice = 2 * (r1 * r1 + r * r2), f = (square + square * square) / 2;
    const double first = (1 + 2 * square) / 2 * by_q,
                 second = (1 + 2 * square) / 2 * by_q_twice + by_q * by_q;
    *slope = first * q1 / f;
    return (second * q1 * q1 + first * q2) / f;
}

/* A is held where n moves: beta' F(n) = A F(n) / F45(n). */
static void form_lobe(const struct problem *p, const double *value, const double *chain, const double *jtr,
                      const double *sum, double *second) {
    const int k = p->k, gamma = reflectance_column(p->model, MATERIAL_GAMMA),
              height = reflectance_column(p->model, MATERIAL_BETA_PRIME),
              n = reflectance_column(p->model, MATERIAL_N);
    const double above_1 = value[MATERIAL_N] - 1;
    double slope;
    const double curve = curve_45(value[MATERIAL_N], &slope);
    put(second, k, gamma, gamma, 4 * value[MATERIAL_BETA_PRIME] * sum[WIDTH_TWICE]);
    put(second, k, gamma, height, jtr[gamma]);
    put(second, k, gamma, n, -2 * chain[n * k + n] * sum[WIDTH_INDEX]);
    put(second, k, height, height, jtr[height]);
    put(second, k, height, n, jtr[n]);
    put(second, k, n, n,
        above_1 * above_1 * (sum[INDEX_TWICE] - curve * jtr[height]) + jtr[n] * (1 - 2 * above_1 * slope));
}

bool curvature_form(const struct problem *p, const double *value, const double *chain, const double *jtr,
                    const double sum[CURVATURE_SUMS], double *second) {
    const int cells = p->k * p->k;
    memset(second, 0, (size_t)cells * sizeof *second);
    form_diffuse(p, value, sum, second);
    if (reflectance_column(p->model, MATERIAL_GAMMA) >= 0) {
        form_lobe(p, value, chain, jtr, sum, second);
    }
    bool finite = true;
    for (int c = 0; c < cells; c++) {
        finite = finite && isfinite(second[c]);
    }
    return finite;
}
