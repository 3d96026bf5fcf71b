/*
 * white.h — the white of a scene, and the way from XYZ under its lights to the RGB of a picture.
 *
 * Errors     white_of: -ERR_RANGE a light that no eye sees.
 * Checked    tests/unit/test_render.c, tests/unit/test_spectral.c
 */
#ifndef FIT_RENDER_WHITE_H
#define FIT_RENDER_WHITE_H

#include "fit/render/scene.h"

/* XYZ, Y = 1, of the perfect diffuser under the scene's lights: each light as much of it as its share. */
int white_of(const struct scene *scene, double white[3], struct err *e);
/* From XYZ under the scene's lights to linear RGB, adapted and exposed. */
struct colour_matrix white_display(const struct scene *scene, enum colour_space space, const double white[3]);

#endif
