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

/* Renders all of it or nothing: every row, nothing left out that changes a value. */
int spread_render(const struct scene *scene, const struct render_options *options, struct planes *planes,
                  struct err *e);
/* moves[paint]: whether that paint has the parameter moved; the slopes of the others are 0. */
int spread_slope(const struct scene *scene, const bool moves[SCENE_PAINTS], int parameter,
                 const struct render_options *options, struct planes *slope, struct err *e);

#endif
