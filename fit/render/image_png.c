#include "fit/render/image.h"
#include "fit/render/raster.h"

#include <errno.h>
#include <png.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#define LEVEL 3 /* of zlib: a third of the time of 6 for some percent more bytes */

static void fail(png_structp png, png_const_charp text) {
    struct err *e = png_get_error_ptr(png);
    err_set(e, ERR_IO, "the PNG cannot be written: %s", text);
    png_longjmp(png, 1);
}

static void ignore(png_structp png, png_const_charp text) {
    (void)png;
    (void)text;
}

static void write_header(png_structp png, png_infop info, const struct picture *p,
                         const unsigned char *profile, size_t profile_size, const char *origin_json) {
    char key[] = "goniod", language[] = "", *json = (char *)origin_json;
    png_text text = {.compression = PNG_ITXT_COMPRESSION_zTXt,
                     .key = key,
                     .text = json,
                     .lang = language,
                     .lang_key = key,
                     .itxt_length = strlen(origin_json)};
    png_set_IHDR(png, info, (png_uint_32)p->width, (png_uint_32)p->height, p->bits, PNG_COLOR_TYPE_RGB,
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_iCCP(png, info, colour_space_name(p->space), PNG_COMPRESSION_TYPE_BASE, profile,
                 (png_uint_32)profile_size);
    png_set_text(png, info, &text, 1);
    png_set_compression_level(png, LEVEL);
    png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB | PNG_FILTER_UP);
    png_write_info(png, info);
}

static void write_rows(png_structp png, const struct picture *p, unsigned char *row) {
    size_t n = 3 * (size_t)p->width;
    for (int y = 0; y < p->height; y++) {
        const uint16_t *code = p->rgb + (size_t)y * n;
        for (size_t i = 0; i < n && p->bits == 8; i++) {
            row[i] = (unsigned char)code[i];
        }
        for (size_t i = 0; i < n && p->bits == 16; i++) { /* network order */
            row[2 * i] = (unsigned char)(code[i] >> 8);
            row[2 * i + 1] = (unsigned char)code[i];
        }
        png_write_row(png, row);
    }
}

int image_png(void *file, const struct picture *picture, const unsigned char *profile, size_t profile_size,
              const char *origin_json, struct err *e) {
    struct err own = {0}; /* png wants somewhere to put it */
    unsigned char *row = malloc(6 * (size_t)picture->width);
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &own, fail, ignore);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    if (!info || !row) {
        err_set(&own, ERR_NOMEM, "no memory to write a PNG");
    } else if (setjmp(png_jmpbuf(png)) == 0) {
        png_init_io(png, file);
        write_header(png, info, picture, profile, profile_size, origin_json);
        write_rows(png, picture, row);
        png_write_end(png, NULL);
    }
    png_destroy_write_struct(png ? &png : NULL, info ? &info : NULL);
    free(row);
    return own.code ? err_set(e, (enum err_code)own.code, "%s", own.text) : 0;
}

static void refuse(png_structp png, png_const_charp text) {
    struct err *e = png_get_error_ptr(png);
    err_set(e, ERR_INPUT, "it is no PNG that can be read: %s", text);
    png_longjmp(png, 1);
}

static void take_rows(png_structp png, struct raster *raster, int passes) {
    size_t n = 3 * (size_t)raster->width;
    for (int pass = 0; pass < passes; pass++) {
        for (int y = 0; y < raster->height; y++) {
            png_read_row(png, (png_bytep)(raster->rgb + (size_t)y * n), NULL);
        }
    }
}

#define DEFLATE_RATIO 1032 /* no more bytes come out of one: zlib's technical notes */

static uint64_t bytes_in(png_structp png) {
    struct stat status;
    FILE *file = png_get_io_ptr(png);
    return fstat(fileno(file), &status) == 0 ? (uint64_t)status.st_size : 0;
}

/* Whatever is inside, as RGB of 16 bits in the order of this machine. */
static void take_picture(png_structp png, png_infop info, struct raster *raster, struct err *e) {
    png_read_info(png, info);
    uint64_t width = png_get_image_width(png, info), height = png_get_image_height(png, info);
    if (width * height > RASTER_PIXELS_MAX) {
        err_set(e, ERR_INPUT, "it has %llu pixels; at most %d are read", (unsigned long long)(width * height),
                RASTER_PIXELS_MAX);
        return;
    }
    if (height * png_get_rowbytes(png, info) > DEFLATE_RATIO * bytes_in(png)) {
        err_set(e, ERR_INPUT, "it is too short to hold %llu x %llu pixels", (unsigned long long)width,
                (unsigned long long)height);
        return;
    }
    png_set_expand_16(png);
    png_set_gray_to_rgb(png);
    png_set_strip_alpha(png);
    png_set_swap(png);
    int passes = png_set_interlace_handling(png);
    png_read_update_info(png, info);
    raster->width = (int)width;
    raster->height = (int)height;
    raster->rgb = calloc(3 * width * height, sizeof *raster->rgb);
    if (!raster->rgb) {
        err_set(e, ERR_NOMEM, "no memory for %d x %d pixels", raster->width, raster->height);
        return;
    }
    take_rows(png, raster, passes);
}

int raster_read(const char *path, struct raster *raster, struct err *e) {
    struct err own = {0};
    FILE *file = fopen(path, "rb");
    if (!file) {
        return err_errno(e, ERR_IO, errno, "%s cannot be read", path);
    }
    *raster = (struct raster){0};
    png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &own, refuse, ignore);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    if (!info) {
        err_set(&own, ERR_NOMEM, "no memory to read a PNG");
    } else if (setjmp(png_jmpbuf(png)) == 0) {
        png_init_io(png, file);
        take_picture(png, info, raster, &own);
    }
    png_destroy_read_struct(png ? &png : NULL, info ? &info : NULL, NULL);
    fclose(file);
    if (own.code) {
        raster_free(raster);
        return err_set(e, (enum err_code)own.code, "%s: %s", path, own.text);
    }
    return 0;
}

void raster_free(struct raster *raster) {
    free(raster->rgb);
    *raster = (struct raster){0};
}

const char *image_png_version(void) {
    return png_get_libpng_ver(NULL);
}
