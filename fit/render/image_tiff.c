#include "fit/render/image.h"

#include <jansson.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <tiffio.h>
#include <unistd.h>

#define STRIP_BYTES 65536 /* TIFF 6.0 advises some 8 kB; larger strips compress better */

static int fail(TIFF *tiff, void *user, const char *module, const char *format, va_list arguments) {
    struct err *e = user;
    char text[256];
    (void)tiff;
    (void)module;
    vsnprintf(text, sizeof text, format, arguments);
    err_set(e, ERR_IO, "the TIFF cannot be written: %s", text);
    return 1;
}

static int ignore(TIFF *tiff, void *user, const char *module, const char *format, va_list arguments) {
    (void)tiff;
    (void)user;
    (void)module;
    (void)format;
    (void)arguments;
    return 1;
}

/* A TIFF of its own file descriptor, complaining to e and to nobody else. */
static TIFF *open_tiff(FILE *file, struct err *e) {
    TIFFOpenOptions *options = TIFFOpenOptionsAlloc();
    int descriptor = dup(fileno(file));
    TIFF *tiff = NULL;
    if (options && descriptor >= 0) {
        TIFFOpenOptionsSetErrorHandlerExtR(options, fail, e);
        TIFFOpenOptionsSetWarningHandlerExtR(options, ignore, NULL);
        tiff = TIFFFdOpenExt(descriptor, "picture", "w", options);
    }
    if (!tiff && descriptor >= 0) {
        close(descriptor);
    }
    if (options) {
        TIFFOpenOptionsFree(options);
    }
    return tiff;
}

/* TIFF's text is ASCII: everything else is written as JSON's \u. */
static char *ascii_of(const char *json) {
    json_t *value = json_loads(json, JSON_DECODE_ANY, NULL);
    char *text = value ? json_dumps(value, JSON_COMPACT | JSON_ENSURE_ASCII | JSON_ENCODE_ANY) : NULL;
    json_decref(value);
    return text;
}

static bool write_tags(TIFF *tiff, const struct picture *p, const unsigned char *profile, size_t profile_size,
                       const char *description) {
    uint32_t row = 3 * (uint32_t)p->width * (uint32_t)(p->bits / 8);
    return TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, (uint32_t)p->width) &&
           TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, (uint32_t)p->height) &&
           TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, p->bits) &&
           TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 3) &&
           TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_RGB) &&
           TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG) &&
           TIFFSetField(tiff, TIFFTAG_ORIENTATION, ORIENTATION_TOPLEFT) &&
           TIFFSetField(tiff, TIFFTAG_COMPRESSION, COMPRESSION_ADOBE_DEFLATE) &&
           TIFFSetField(tiff, TIFFTAG_PREDICTOR, PREDICTOR_HORIZONTAL) &&
           TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, row < STRIP_BYTES ? STRIP_BYTES / row : 1) &&
           TIFFSetField(tiff, TIFFTAG_ICCPROFILE, (uint32_t)profile_size, profile) &&
           TIFFSetField(tiff, TIFFTAG_SOFTWARE, "goniorender " GONIOD_VERSION) &&
           TIFFSetField(tiff, TIFFTAG_IMAGEDESCRIPTION, description);
}

static bool write_rows(TIFF *tiff, const struct picture *p, uint16_t *row) {
    size_t n = 3 * (size_t)p->width;
    bool good = true;
    for (int y = 0; y < p->height && good; y++) {
        const uint16_t *code = p->rgb + (size_t)y * n;
        unsigned char *bytes = (unsigned char *)row;
        for (size_t i = 0; i < n && p->bits == 8; i++) {
            bytes[i] = (unsigned char)code[i];
        }
        if (p->bits == 16) { /* in the order of this machine, as the file says of itself */
            memcpy(row, code, n * sizeof *row);
        }
        good = TIFFWriteScanline(tiff, row, (uint32_t)y, 0) == 1;
    }
    return good;
}

int image_tiff(void *file, const struct picture *picture, const unsigned char *profile, size_t profile_size,
               const char *origin_json, struct err *e) {
    struct err own = {0}; /* tiff wants somewhere to put it */
    uint16_t *row = malloc(3 * (size_t)picture->width * sizeof *row);
    char *description = ascii_of(origin_json);
    TIFF *tiff = row && description ? open_tiff(file, &own) : NULL;
    bool good = tiff && write_tags(tiff, picture, profile, profile_size, description) &&
                write_rows(tiff, picture, row) && TIFFWriteDirectory(tiff);
    if (tiff) {
        TIFFClose(tiff);
    }
    if (!good && !own.code) {
        err_set(&own, ERR_NOMEM, "no memory to write a TIFF");
    }
    free(description);
    free(row);
    return own.code ? err_set(e, (enum err_code)own.code, "%s", own.text) : 0;
}
