/*
 * products.h — sums over points of all products of weighted columns: J^T W J, J^T W r and r^T W r.
 *
 * As wide as the processor allows; eight partial sums, added up in one order, so that every width gives the same bits.
 * Shapes     column j begins at slope + j * stride; slope, weight and residual have room for n rounded up to the lanes of
 *            fit/reflectance_batch.h, with weight and residual 0 beyond n. residual carries its weight already.
 *            sum[(k + 1) * (k + 2) / 2]: the lower triangle of [J W^1/2, r]^T [J W^1/2, r], row by row.
 * Domain     1 <= k <= COORDINATES_MAX.
 * Checked    tests/unit/test_solve.c
 */
#ifndef FIT_PRODUCTS_H
#define FIT_PRODUCTS_H

#include <stddef.h>

#include "fit/coordinates.h"
#include "fit/reflectance_batch.h"

#define PRODUCTS_CELLS ((COORDINATES_MAX + 1) * (COORDINATES_MAX + 2) / 2)

/* Adds to sum. */
void products_add(enum reflectance_width width, int k, size_t n, const double *slope, size_t stride,
                  const double *root_weight, const double *residual, double *sum);

#endif
