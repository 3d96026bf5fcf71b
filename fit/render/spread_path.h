/*
 * spread_path.h — how the light of several bounces changes with what is known of the paints, to first order.
 *
 * Paths do not depend on wavelength, so that a band of what comes over other surfaces hangs on S and beta' of that band
 * alone: one pair of renderings in which S of a paint is moved in all bands gives its slopes in every band, and one pair
 * more for each shared parameter. The paths are the very same in all of them, and so is the scale of energy.h, which
 * holds what a paint returns: the slopes are those of the picture's own samples.
 *
 * Shapes     band[paint][kind]: [pixel][set][BANDS], kind 0 by S, 1 by beta' where it is known by bands;
 *            shared[paint][parameter]: [pixel][3], of X, Y, Z. NULL: it does not move.
 * Cost       2 renderings for each paint that is not exactly known, and 2 for each shared parameter of it: renderings;
 *            324 bytes for each pixel, such paint and spectrum of light, twice that where beta' is known by bands.
 * Errors     those of render_planes; -ERR_CANCELLED.
 * Checked    tests/unit/test_spread_path.c
 */
#ifndef FIT_RENDER_SPREAD_PATH_H
#define FIT_RENDER_SPREAD_PATH_H

#include "fit/render/render.h"
#include "fit/render/spread_paint.h"

struct spread_path {
    int sets, renderings;
    double weight[PLANES_SETS][BANDS][3]; /* X, Y, Z of a band of each set */
    float *band[SCENE_PAINTS][SPREAD_BAND_KINDS];
    float *shared[SCENE_PAINTS][MATERIAL_PARAMETERS];
};

/* options: with the hits of earlier renderings, and steady. */
int spread_path_make(const struct scene *scene, const struct spread_paint paint[SCENE_PAINTS],
                     const struct render_options *options, struct spread_path *path, struct err *e);
void spread_path_free(struct spread_path *path);
/* Adds what the columns of a paint's factor change in X, Y, Z of a pixel. */
void spread_path_change(const struct spread_path *path, const struct spread_paint *p, int paint, size_t pixel,
                        double change[3][JOINT_ROWS]);
/* Adds X, Y, Z of what comes over other surfaces. */
void spread_path_colour(const struct spread_path *path, const struct planes *planes, size_t pixel,
                        double xyz[3]);

#endif
