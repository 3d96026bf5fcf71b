#include "fit/products.h"

#include <string.h>

#define INLINE static inline __attribute__((always_inline))
#define LANES REFLECTANCE_BATCH_LANES

typedef double lanes __attribute__((vector_size(LANES * sizeof(double))));

struct view {
    size_t n, stride;
    const double *slope, *root_weight, *residual;
};

/* k is a constant wherever this is expanded: all partial sums then live in registers. */
INLINE void add(const int k, const struct view *v, double *sum) {
    lanes part[PRODUCTS_CELLS];
    memset(part, 0, sizeof part);
    for (size_t i = 0; i < v->n; i += LANES) {
        lanes column[COORDINATES_MAX + 1], weight;
        memcpy(&weight, v->root_weight + i, sizeof weight);
        memcpy(&column[k], v->residual + i, sizeof weight);
#pragma GCC unroll 8
        for (int j = 0; j < k; j++) {
            memcpy(&column[j], v->slope + (size_t)j * v->stride + i, sizeof weight);
            column[j] *= weight;
        }
#pragma GCC unroll 9
        for (int a = 0; a <= k; a++) {
#pragma GCC unroll 9
            for (int b = 0; b <= a; b++) {
                part[a * (a + 1) / 2 + b] += column[a] * column[b];
            }
        }
    }
    for (int c = 0; c < (k + 1) * (k + 2) / 2; c++) {
        double half[LANES];
        memcpy(half, &part[c], sizeof half);
        sum[c] += ((half[0] + half[4]) + (half[2] + half[6])) + ((half[1] + half[5]) + (half[3] + half[7]));
    }
}

INLINE void all_sizes(int k, const struct view *v, double *sum) {
    switch (k) {
    case 1:
        add(1, v, sum);
        break;
    case 2:
        add(2, v, sum);
        break;
    case 3:
        add(3, v, sum);
        break;
    case 4:
        add(4, v, sum);
        break;
    case 5:
        add(5, v, sum);
        break;
    case 6:
        add(6, v, sum);
        break;
    case 7:
        add(7, v, sum);
        break;
    default:
        add(COORDINATES_MAX, v, sum);
    }
}

typedef void run(int k, const struct view *v, double *sum);

static void run_sse2(int k, const struct view *v, double *sum) {
    all_sizes(k, v, sum);
}

__attribute__((target("avx2"))) static void run_avx2(int k, const struct view *v, double *sum) {
    all_sizes(k, v, sum);
}

__attribute__((target("avx512f,avx512dq"))) static void run_avx512(int k, const struct view *v, double *sum) {
    all_sizes(k, v, sum);
}

void products_add(enum reflectance_width width, int k, size_t n, const double *slope, size_t stride,
                  const double *root_weight, const double *residual, double *sum) {
    static run *const runs[REFLECTANCE_WIDTHS] = {
        [REFLECTANCE_SSE2] = run_sse2, [REFLECTANCE_AVX2] = run_avx2, [REFLECTANCE_AVX512] = run_avx512};
    const struct view v = {reflectance_batch_room(n), stride, slope, root_weight, residual};
    runs[width](k, &v, sum);
}
