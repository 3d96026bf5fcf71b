/*
 * image.h — pictures as files: the format by the name's ending, the colour profile and the origin inside.
 *
 * .png   8 or 16 bits, iCCP, the origin as iTXt "goniod" (JSON)
 * .tif   8 or 16 bits, ICC profile, Deflate, the origin as ImageDescription (JSON in ASCII); also .tiff
 * The file appears whole under its name or not at all.
 * Errors     -ERR_USAGE an ending of no known format (image_known tells beforehand); -ERR_IO with errno.
 * Checked    tests/unit/test_render_image.c
 */
#ifndef FIT_RENDER_IMAGE_H
#define FIT_RENDER_IMAGE_H

#include "fit/render/render.h"

int image_known(const char *path, struct err *e);
int image_write(const char *path, const struct picture *picture, const char *origin_json, struct err *e);

const char *image_png_version(void); /* of libpng, as it runs */

/* file: FILE * open for writing; profile: the ICC profile's bytes. */
int image_png(void *file, const struct picture *picture, const unsigned char *profile, size_t profile_size,
              const char *origin_json, struct err *e);
int image_tiff(void *file, const struct picture *picture, const unsigned char *profile, size_t profile_size,
               const char *origin_json, struct err *e);

#endif
