/*
 * icc.h — the ICC profile of an RGB space, as bytes to embed.
 *
 * Made by Little CMS from the primaries and the curve of colour.h, version 4. The date inside is fixed, so that the
 * same space gives the same bytes.
 * Errors     -ERR_NOMEM.
 * Checked    tests/unit/test_render_image.c
 */
#ifndef FIT_RENDER_ICC_H
#define FIT_RENDER_ICC_H

#include <stddef.h>

#include "fit/render/colour.h"

/* malloc. */
int icc_make(enum colour_space space, unsigned char **bytes, size_t *size, struct err *e);

#endif
