/*
 * origin.h — where a picture comes from, as every picture and report carries it.
 *
 * {"program", "command", "scene", "scene_sha256", "materials": [{"name", "source", "sha256", "model", "parameters", "u",
 * "kappa", "held_bands_nm", "held_share", "spectrum"}], "shapes": [{"kind", "mask", "relief", "mesh"}], "lights": [{"kind",
 * "spd", "spd_sha256", "share", ...}], "observer", "space", "adaptation", "exposure", "white", "grid", "bounces", "energy",
 * "left_out", "kept", "bound", "counts", "noise_y", "clipped", "out_of_gamut", "max_y"}; of recoloured planes also
 * "rendered", the origin of these, and "spectrum_of" in a material whose S(lambda) is now that of another session.
 *
 * Files      every one that was read is named with the SHA-256 of its bytes: "spectrum", "mask", "relief" and "mesh" are
 *            {"file", "sha256"}. A file that was not needed is not read, and has none.
 * Checked    tests/unit/test_render_files.py, test_goniorender.py
 */
#ifndef FIT_RENDER_ORIGIN_H
#define FIT_RENDER_ORIGIN_H

#include <jansson.h>

#include "fit/render/render.h"

/* NULL when out of memory. */
json_t *origin_make(const struct scene *scene, const struct render_report *report,
                    const struct picture *picture, const char *command);
/* The origin of the planes, in which the lights' spectra and what follows from them are the picture's. */
json_t *origin_recoloured(const struct scene *scene, json_t *rendered, const struct picture *picture,
                          const char *command);
/* The largest share of X, Y, Z that rests on bands that were not measured, over the lights. */
double origin_held_share(const struct scene *scene, const struct paint *paint);

#endif
