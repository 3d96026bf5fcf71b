/*
 * loss.h — what a fit minimises: the sum of ((l(model) - l(beta)) weight)^2, l and weight by the loss.
 *
 *     ml        l = beta, weight = 1 / u: maximum likelihood, the default; the only one that knows the points' u
 *     ols       l = beta, weight = 1: the paper's Eq. 6
 *     log       l = ln beta, weight = 1: relative errors, dark and bright alike
 *     cuberoot  l = beta^(1/3), weight = 1: near to what an eye sees
 *     cosine    l = beta, weight = cos theta_i: errors as light, an even share for each unit of it
 *
 * Values <= 0 are measured (noise about a dark point) and stay: below 0.005, under which an error is judged as absolute
 * (measurement.md 10), ln and the cube root go on along their tangent, so that every real number has a loss and a slope.
 * Source     reflection-model.md 4.1: Ngan, Durand and Matusik 2005 (cosine), Low et al. 2012 (log), Fores, Ferwerda
 *            and Gu 2012 (cube root).
 * Checked    tests/unit/test_loss.c
 */
#ifndef FIT_LOSS_H
#define FIT_LOSS_H

#include <stdbool.h>

#include "proto/material.h"

#ifdef __cplusplus
extern "C" {
#endif

/* l(beta); slope = dl / d beta. */
double loss_value(enum material_loss loss, double beta, double *slope);
bool loss_is_linear(enum material_loss loss); /* l(beta) = beta */
double loss_weight(enum material_loss loss, double theta_i_deg, double u);
int loss_find(const char *name, enum material_loss *loss, struct err *e); /* -ERR_USAGE */

#ifdef __cplusplus
}
#endif

#endif
