/*
 * reflectance_wide.h — the inner loops behind fit/reflectance_batch.h, and what they need of the parameters.
 * Checked    tests/unit/test_reflectance_batch.c
 */
#ifndef FIT_REFLECTANCE_WIDE_H
#define FIT_REFLECTANCE_WIDE_H

#include "fit/lobe.h"
#include "fit/reflectance_batch.h"

struct reflectance_wide {            /* of the parameters, once for all points */
    double s, s2_kappa_q, s_kappa_q; /* S, S^2 kappa q, 2 S kappa q */
    double c1, k, j;                 /* C1 = 1 - h / 2 and the two saturating factors */
    double c1_slope, k_slope, j_slope;
    double height, height_2, inverse_gamma, inverse_gamma_2;
    double n, n2_1, perpendicular, parallel; /* n^2 - 1, 1 + P, 1 - P */
    struct lobe_tail tail;
    double n_d, t0, t0_log;
};

struct reflectance_wide_view { /* columns of one call, all at its first point */
    size_t n;                  /* a multiple of the lanes */
    const double *in[REFLECTANCE_BATCH_COLUMNS];
    double *beta, *slope[MATERIAL_PARAMETERS]; /* by enum material_parameter */
    double *by_n_twice;                        /* d^2 beta / dn^2 of one Gaussian lobe; NULL: not wanted */
};

void reflectance_wide_run(enum reflectance_width width, enum reflectance_model model,
                          const struct reflectance_wide *x, const struct reflectance_wide_view *v);
/* reflectance_batch_eval with a width of the caller's, which the processor must have. */
int reflectance_batch_eval_with(enum reflectance_width width, const struct reflectance_batch *batch,
                                size_t first, size_t n, enum reflectance_model model, const double *value,
                                const struct reflectance_optics *optics, double *beta, double *slope,
                                size_t stride, struct err *e);

#endif
