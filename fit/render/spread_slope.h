/*
 * spread_slope.h — how the planes a, b, c change with a parameter of the paints.
 *
 * Central differences of two renderings in which every paint has its parameter moved by STEP of itself; one-sided
 * where a bound of paint.h is in the way. What a tolerance decides (features.h) is kept, so that none
 * enters a difference; layout and order of the extras are those of spread_render.
 *
 * Errors     those of render_planes; -ERR_CANCELLED interrupted.
 * Checked    tests/unit/test_render_spread.c
 */
#ifndef FIT_RENDER_SPREAD_SLOPE_H
#define FIT_RENDER_SPREAD_SLOPE_H

#include "fit/render/render.h"

/* The paint with a parameter moved by `relative` of itself (from 0: by so much), or not at all where a bound is in the
 * way; MATERIAL_S: every band of s by `relative` itself. *value: where it stands then, of S the step. Directions are drawn
 * as before. */
int spread_move(struct scene *moved, const struct scene *scene, int paint, int parameter, double relative,
                double *value, struct err *e);
/* Renders all of it or nothing: every row, nothing left out that changes a value. */
int spread_render(const struct scene *scene, const struct render_options *options, struct planes *planes,
                  struct err *e);
/* moves[paint]: whether that paint has the parameter moved; the slopes of the others are 0. */
int spread_slope(const struct scene *scene, const bool moves[SCENE_PAINTS], int parameter,
                 const struct render_options *options, struct planes *slope, struct err *e);

#endif
