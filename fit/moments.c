#include "fit/moments.h"

#include <string.h>

#define INLINE static inline __attribute__((always_inline))
#define LANES REFLECTANCE_BATCH_LANES
#define TOGETHER 8 /* bands: a row is read once for all of them, and their sums stay in registers */

typedef double lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef lanes loose __attribute__((aligned(sizeof(double)), may_alias)); /* as it lies in memory */

struct view {
    const double *weight, *row;
    size_t n, bands, room;
    double *sum;
};

void moments_lay(const double *f, size_t n, int functions, double *row) {
    const size_t room = moments_room((size_t)functions);
    memset(row, 0, n * room * sizeof *row);
    for (size_t i = 0; i < n; i++) {
        for (int a = 0; a < functions; a++) {
            row[i * room + (size_t)a] = f[(size_t)a * n + i];
        }
    }
}

void moments_lay_products(const double *f, size_t n, int functions, double *row) {
    const size_t columns = moments_products(functions), room = moments_room(columns);
    for (size_t i = 0; i < n; i++) {
        double *to = row + i * room;
        for (int a = 0; a < functions; a++) {
            const double fa = f[(size_t)a * n + i];
            for (int b = 0; b <= a; b++) {
                *to++ = fa * f[(size_t)b * n + i];
            }
        }
        memset(to, 0, (room - columns) * sizeof *to);
    }
}

/* bands is a constant wherever this is expanded. */
INLINE void add(const int bands, const struct view *v, size_t first, size_t column) {
    lanes part[TOGETHER];
    memset(part, 0, sizeof part);
    for (size_t i = 0; i < v->n; i++) {
        const lanes row = *(const loose *)(v->row + i * v->room + column);
#pragma GCC unroll 8
        for (int b = 0; b < bands; b++) {
            part[b] += v->weight[(first + (size_t)b) * v->n + i] * row;
        }
    }
    for (int b = 0; b < bands; b++) {
        *(loose *)(v->sum + (first + (size_t)b) * v->room + column) = part[b];
    }
}

INLINE void all(const struct view *v) {
    for (size_t column = 0; column < v->room; column += LANES) {
        size_t first = 0;
        for (; first + TOGETHER <= v->bands; first += TOGETHER) {
            add(TOGETHER, v, first, column);
        }
        for (; first < v->bands; first++) {
            add(1, v, first, column);
        }
    }
}

typedef void run(const struct view *v);

static void run_sse2(const struct view *v) {
    all(v);
}

__attribute__((target("avx2"))) static void run_avx2(const struct view *v) {
    all(v);
}

__attribute__((target("avx512f,avx512dq"))) static void run_avx512(const struct view *v) {
    all(v);
}

void moments_take(enum reflectance_width width, const double *weight, size_t n, size_t bands,
                  const double *row, size_t columns, double *sum) {
    static run *const runs[REFLECTANCE_WIDTHS] = {
        [REFLECTANCE_SSE2] = run_sse2, [REFLECTANCE_AVX2] = run_avx2, [REFLECTANCE_AVX512] = run_avx512};
    const struct view v = {weight, row, n, bands, moments_room(columns), sum};
    runs[width](&v);
}

struct band {
    const double *f, *value, *weight;
    size_t n;
    double s, t, *weighted;
};

INLINE double residuals(const struct band *x) {
    const double s2 = x->s * x->s, *l1 = x->f, *l2 = l1 + x->n, *p = l2 + x->n;
    lanes part = {0};
    size_t i = 0;
    for (; i + LANES <= x->n; i += LANES) {
        const lanes r = x->s * *(const loose *)(l1 + i) + s2 * *(const loose *)(l2 + i) +
                        x->t * *(const loose *)(p + i) - *(const loose *)(x->value + i);
        const lanes wr = *(const loose *)(x->weight + i) * r;
        *(loose *)(x->weighted + i) = wr;
        part += wr * r;
    }
    double half[LANES];
    memcpy(half, &part, sizeof half);
    double sum = ((half[0] + half[4]) + (half[2] + half[6])) + ((half[1] + half[5]) + (half[3] + half[7]));
    for (; i < x->n; i++) {
        const double r = x->s * l1[i] + s2 * l2[i] + x->t * p[i] - x->value[i];
        x->weighted[i] = x->weight[i] * r;
        sum += x->weighted[i] * r;
    }
    return sum;
}

typedef double take(const struct band *x);

static double take_sse2(const struct band *x) {
    return residuals(x);
}

__attribute__((target("avx2"))) static double take_avx2(const struct band *x) {
    return residuals(x);
}

__attribute__((target("avx512f,avx512dq"))) static double take_avx512(const struct band *x) {
    return residuals(x);
}

double moments_residuals(enum reflectance_width width, const double *f, size_t n, double s, double t,
                         const double *value, const double *weight, double *weighted) {
    static take *const takes[REFLECTANCE_WIDTHS] = {
        [REFLECTANCE_SSE2] = take_sse2, [REFLECTANCE_AVX2] = take_avx2, [REFLECTANCE_AVX512] = take_avx512};
    const struct band x = {f, value, weight, n, s, t, weighted};
    return takes[width](&x);
}
