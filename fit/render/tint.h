/*
 * tint.h — a 3x3 matrix over many pixels: planes a, b, c to X, Y, Z or linear RGB.
 *
 * out[i] += m (a_i, b_i, c_i), three planes of out; b or c NULL: 0 everywhere. The wider kernel is chosen at run time
 * and gives the same bits as the plain one.
 * Checked    tests/unit/test_tint.c
 */
#ifndef FIT_RENDER_TINT_H
#define FIT_RENDER_TINT_H

#include <stddef.h>

#include "fit/render/colour.h"

void tint_add(const struct colour_matrix *m, size_t n, const double *a, const double *b, const double *c,
              double *const out[3]);
void tint_add_plain(const struct colour_matrix *m, size_t n, const double *a, const double *b,
                    const double *c, double *const out[3]);

#endif
