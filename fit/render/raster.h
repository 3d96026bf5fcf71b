/*
 * raster.h — a picture read from a PNG as 16-bit codes: masks and height maps.
 *
 * Any PNG: grey, palette and alpha become RGB of 16 bits (8-bit codes times 257; alpha is dropped). No profile is
 * applied: codes are labels and heights here, not colours.
 * Errors     -ERR_IO cannot be read; -ERR_INPUT no PNG, broken, or over RASTER_PIXELS_MAX pixels.
 * Checked    tests/unit/test_render_image.c
 */
#ifndef FIT_RENDER_RASTER_H
#define FIT_RENDER_RASTER_H

#include <stdint.h>

#include "proto/err.h"

#define RASTER_PIXELS_MAX (1 << 28)

struct raster {
    int width, height;
    uint16_t *rgb; /* [3 * height * width] by rows from the top */
};

int raster_read(const char *path, struct raster *raster, struct err *e); /* PNG */
void raster_free(struct raster *raster);

#endif
