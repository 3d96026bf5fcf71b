/*
 * render_scene.h — scenes for tests of the renderer, read from text as a scene file would be.
 */
#ifndef TESTS_SUPPORT_RENDER_SCENE_H
#define TESTS_SUPPORT_RENDER_SCENE_H

#include "fit/render/render.h"

/* Fails the test, with all that is wrong, when the text is no scene. */
struct scene *scene_of(const char *format, ...) __attribute__((format(printf, 1, 2)));
/* Planes of the scene, and XYZ [3 * pixels] from them; fails the test on any error. */
void planes_of(const struct scene *scene, const struct render_options *options, struct planes *planes,
               struct render_report *report);
double *xyz_of(const struct scene *scene, const struct planes *planes, bool by_wavelength);

#endif
