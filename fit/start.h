/*
 * start.h — where a fit begins: a few points of the parameter space that already look like the data.
 *
 * For a coarse grid of sigma, gamma (n = 1.5) and what a richer model adds, the model is linear in S and A; the best of them, one for
 * each gamma, are the starts. With model-true data every start reaches the same minimum; the danger is a lobe
 * that falls between the samples, and for that two or three widths are enough (reflection-model.md 3.4).
 * Checked    tests/unit/test_estimate.c
 */
#ifndef FIT_START_H
#define FIT_START_H

#include "fit/problem.h"

#ifdef __cplusplus
extern "C" {
#endif

#define START_MAX 3

/* Fills x[START_MAX][COORDINATES_MAX], best first, and returns how many (at least 1). */
int start_find(const struct problem *p, double x[START_MAX][COORDINATES_MAX]);

#ifdef __cplusplus
}
#endif

#endif
