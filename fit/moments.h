/*
 * moments.h — sums over points, for many bands at once: what every evaluation of a joint fit costs.
 *
 *     sum[band][c] = sum_i weight[band][i] row[i][c]
 * row holds functions of angle, or all products of two of them, point by point: one pass serves every band. As wide as the
 * processor allows, eight columns a lane group; each sum runs over the points in their order, so that every width gives the
 * same bits.
 * Shapes     f[functions * n] function by function; weight[bands * n]; columns padded to moments_room(), zero beyond.
 *            Products by moments_at(a, b).
 * Checked    tests/unit/test_moments.c, test_joint.c
 */
#ifndef FIT_MOMENTS_H
#define FIT_MOMENTS_H

#include <stddef.h>

#include "fit/reflectance_batch.h"

#ifdef __cplusplus
extern "C" {
#endif

static inline size_t moments_room(size_t columns) {
    return reflectance_batch_room(columns);
}

static inline int moments_at(int a, int b) {
    return a < b ? b * (b + 1) / 2 + a : a * (a + 1) / 2 + b;
}

static inline size_t moments_products(int functions) {
    return (size_t)(functions * (functions + 1) / 2);
}

/* Rows of the functions themselves, and of their products. */
void moments_lay(const double *f, size_t n, int functions, double *row);
void moments_lay_products(const double *f, size_t n, int functions, double *row);
void moments_take(enum reflectance_width width, const double *weight, size_t n, size_t bands,
                  const double *row, size_t columns, double *sum);
/* Of one band: weighted[i] = weight[i] (s f_0 + s^2 f_1 + t f_2 - value)[i]; returns the sum of their squares over weight. */
double moments_residuals(enum reflectance_width width, const double *f, size_t n, double s, double t,
                         const double *value, const double *weight, double *weighted);

#ifdef __cplusplus
}
#endif

#endif
