/*
 * planes_file.h — planes with all that colours them, as an EXR: rendered once, recoloured at any time.
 *
 * Channels   layer<i>.paint, layer<i>.light<j>.a, .b, .c: layer 0 is the paint a pixel shows first, further layers what
 *            mixed pixels show besides; paint -1: nothing. Of several bounces also light<j>.indirect.380nm ... 780nm.
 *            Where something was drawn at random: noise.varY, the variance of Y of each pixel as rendered. 32-bit
 *            floats: 6e-8 of each value.
 * Text       "goniod": the origin (origin.h) with "recolour": {"paints": [{"name", "s": [81]}], "lights": [{"spd",
 *            "share"}], "spds": [{"name", "sha256", "power": [81]}], "image": {...}}.
 * Errors     those of exr.h; -ERR_INPUT an EXR that holds no planes.
 * Checked    tests/unit/test_render_exr.c
 */
#ifndef FIT_RENDER_PLANES_FILE_H
#define FIT_RENDER_PLANES_FILE_H

#include <jansson.h>

#include "fit/render/planes.h"
#include "fit/render/scene.h"

/* origin: what the file carries, borrowed. */
int planes_save(const char *path, const struct scene *scene, const struct planes *planes, json_t *origin,
                struct err *e);
/* *scene: malloc, for scene_free; it has paints (name, s), lights (spd, share), spds and the image, and no shapes.
 * *origin: a new reference, of the picture that was rendered. */
int planes_load(const char *path, struct scene **scene, struct planes *planes, json_t **origin,
                struct err *e);

#endif
