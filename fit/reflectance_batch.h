/*
 * reflectance_batch.h — the model and its derivatives over many points at once: reflectance_eval for a fit's inner loop.
 *
 * Geometry, values and derivatives lie in columns, one array each, and are worked through as wide as the
 * processor allows (SSE2, AVX2 or AVX-512, chosen at run time). Every width computes the same bits.
 *
 * Shapes     reflectance_batch_size(n) numbers of the caller's memory hold the batch. beta and each column of slope have
 *            room for n rounded up to the lanes (reflectance_batch_room); what lies beyond n is unspecified. Column j
 *            begins at slope + j * stride and is d beta / d reflectance_parameter(model, j). Any first, any n.
 * Domain, errors   as fit/reflectance.h.
 * Promises   no allocation, no global state; the bits of a point do not depend on n, first or the processor;
 *            within 4e-15 of reflectance_eval relative to the sum of absolute terms, times 1 + 2 |ln D| where D occurs.
 * Checked    tests/unit/test_reflectance_batch.c; ns a point: tests/bench/bench_model.c
 */
#ifndef FIT_REFLECTANCE_BATCH_H
#define FIT_REFLECTANCE_BATCH_H

#include "fit/reflectance.h"

#ifdef __cplusplus
extern "C" {
#endif

#define REFLECTANCE_BATCH_COLUMNS 8
#define REFLECTANCE_BATCH_LANES 8

struct reflectance_batch {
    size_t n;
    double *
        column[REFLECTANCE_BATCH_COLUMNS]; /* by the members of struct reflectance_geometry, in their order */
};

enum reflectance_width { REFLECTANCE_SSE2, REFLECTANCE_AVX2, REFLECTANCE_AVX512, REFLECTANCE_WIDTHS };

static inline size_t reflectance_batch_room(size_t n) {
    return (n + REFLECTANCE_BATCH_LANES - 1) / REFLECTANCE_BATCH_LANES * REFLECTANCE_BATCH_LANES;
}

/* Room behind the last point too, where a call that begins between two multiples of the lanes ends. */
static inline size_t reflectance_batch_size(size_t n) {
    return reflectance_batch_room(n + REFLECTANCE_BATCH_LANES) * REFLECTANCE_BATCH_COLUMNS;
}

void reflectance_batch_fill(struct reflectance_batch *batch, size_t n, const struct reflectance_geometry *g,
                            double *memory);
int reflectance_batch_eval(const struct reflectance_batch *batch, size_t first, size_t n,
                           enum reflectance_model model, const double *value,
                           const struct reflectance_optics *optics, double *beta, double *slope,
                           size_t stride, struct err *e);
/* The same with d^2 beta / dn^2 beside it, where the model has one Gaussian lobe (eq1, composite); else it is left alone. */
int reflectance_batch_curve(const struct reflectance_batch *batch, size_t first, size_t n,
                            enum reflectance_model model, const double *value,
                            const struct reflectance_optics *optics, double *beta, double *slope,
                            size_t stride, double *by_n_twice, struct err *e);

enum reflectance_width reflectance_batch_width(void); /* the widest of this processor */

#ifdef __cplusplus
}
#endif

#endif
