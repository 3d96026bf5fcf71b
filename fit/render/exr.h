/*
 * exr.h — OpenEXR files of float channels and string attributes: planes, spectral pictures.
 *
 * Scan lines, ZIP, 32-bit floats, one part. Channel names follow OpenEXR: a dot separates layers. Rows are asked for
 * one after the other, so that a picture of 81 channels needs no memory of its size.
 *
 * Errors     -ERR_IO the file cannot be written or read; -ERR_INPUT it is no such EXR, or over EXR_VALUES_MAX values;
 *            -ERR_NOMEM.
 * Source     OpenEXRCore 3.1 (the C interface).
 * Checked    tests/unit/test_render_exr.c
 */
#ifndef FIT_RENDER_EXR_H
#define FIT_RENDER_EXR_H

#include <stddef.h>

#include "proto/err.h"

#define EXR_CHANNELS_MAX 2048
#define EXR_NAME_MAX 64
#define EXR_VALUES_MAX (1LL << 30)

struct exr_text {
    const char *name, *value;
};

struct exr_form { /* what a file to be written holds */
    int width, height, n_channels, n_texts;
    const char (*channel)[EXR_NAME_MAX];
    const struct exr_text *text;
    /* Row y of every channel into row[channel][0 .. width - 1]. */
    void (*fill)(void *arg, int y, float *const *row);
    void *arg;
};

struct exr_image { /* what a file held */
    int width, height, n_channels;
    char channel[EXR_CHANNELS_MAX][EXR_NAME_MAX];
    float *plane[EXR_CHANNELS_MAX]; /* [height * width] */
    char *text;                     /* the value of the attribute asked for, or NULL */
};

int exr_save(const char *path, const struct exr_form *form, struct err *e);
int exr_load(const char *path, const char *text_name, struct exr_image *image, struct err *e);
void exr_free(struct exr_image *image);
const float *exr_plane(const struct exr_image *image, const char *channel); /* NULL if absent */

#endif
