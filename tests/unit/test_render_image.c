#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <lcms2.h>
#include <png.h>
#include <tiffio.h>
#include <unistd.h>

#include "fit/render/icc.h"
#include "fit/render/image.h"
#include "fit/render/raster.h"
#include "proto/file.h"

#define WIDTH 5
#define HEIGHT 3

static struct picture picture_of(int bits, uint16_t *rgb) {
    for (int i = 0; i < 3 * WIDTH * HEIGHT; i++)
        rgb[i] = (uint16_t)(i * 1459 % (1 << bits));
    return (struct picture){
        .width = WIDTH, .height = HEIGHT, .bits = bits, .space = COLOUR_DISPLAY_P3, .rgb = rgb};
}

/* Through libpng's reader: the codes, the profile, the origin. */
static void a_png_reads_back(void **state) {
    (void)state;
    char path[] = "/tmp/goniod-picture-XXXXXX.png";
    close(mkstemps(path, 4));
    for (int bits = 8; bits <= 16; bits += 8) {
        uint16_t rgb[3 * WIDTH * HEIGHT];
        unsigned char row[6 * WIDTH];
        struct picture picture = picture_of(bits, rgb);
        struct err e = {0};
        if (image_write(path, &picture, "{\"origin\":\"σ\"}", &e))
            fail_msg("%s", e.text);
        FILE *file = fopen(path, "rb");
        png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
        png_infop info = png_create_info_struct(png);
        png_init_io(png, file);
        png_read_info(png, info);
        assert_int_equal(png_get_image_width(png, info), WIDTH);
        assert_int_equal(png_get_bit_depth(png, info), bits);
        for (int y = 0; y < HEIGHT; y++) {
            png_read_row(png, row, NULL);
            for (int i = 0; i < 3 * WIDTH; i++) {
                int code = bits == 8 ? row[i] : row[2 * i] << 8 | row[2 * i + 1];
                assert_int_equal(code, rgb[y * 3 * WIDTH + i]);
            }
        }
        png_textp text;
        png_charp name;
        png_bytep profile;
        png_uint_32 size;
        int n, compression;
        assert_int_equal(png_get_text(png, info, &text, &n), 1);
        assert_string_equal(text[0].key, "goniod");
        assert_string_equal(text[0].text, "{\"origin\":\"σ\"}");
        assert_true(png_get_iCCP(png, info, &name, &compression, &profile, &size) != 0);
        assert_string_equal(name, "Display P3");
        png_destroy_read_struct(&png, &info, NULL);
        fclose(file);
    }
    unlink(path);
}

/* Through libtiff's reader: the codes, the profile, the origin. */
static void a_tiff_reads_back(void **state) {
    (void)state;
    char path[] = "/tmp/goniod-picture-XXXXXX.tif";
    close(mkstemps(path, 4));
    for (int bits = 8; bits <= 16; bits += 8) {
        uint16_t rgb[3 * WIDTH * HEIGHT], row[3 * WIDTH], depth;
        unsigned char *profile, *expected;
        size_t expected_size;
        uint32_t size, width;
        const char *text;
        struct picture picture = picture_of(bits, rgb);
        struct err e = {0};
        if (image_write(path, &picture, "{\"origin\":\"σ\"}", &e))
            fail_msg("%s", e.text);
        TIFF *tiff = TIFFOpen(path, "r");
        assert_non_null(tiff);
        assert_true(TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &width) && width == WIDTH);
        assert_true(TIFFGetField(tiff, TIFFTAG_BITSPERSAMPLE, &depth) && depth == bits);
        for (int y = 0; y < HEIGHT; y++) {
            assert_int_equal(TIFFReadScanline(tiff, row, (uint32_t)y, 0), 1);
            for (int i = 0; i < 3 * WIDTH; i++)
                assert_int_equal(bits == 8 ? ((unsigned char *)row)[i] : row[i], rgb[y * 3 * WIDTH + i]);
        }
        assert_true(TIFFGetField(tiff, TIFFTAG_IMAGEDESCRIPTION, &text));
        assert_string_equal(text, "{\"origin\":\"\\u03C3\"}");
        assert_true(TIFFGetField(tiff, TIFFTAG_ICCPROFILE, &size, &profile));
        assert_int_equal(icc_make(COLOUR_DISPLAY_P3, &expected, &expected_size, NULL), 0);
        assert_int_equal(size, expected_size);
        assert_memory_equal(profile, expected, size);
        free(expected);
        TIFFClose(tiff);
    }
    unlink(path);
}

static void a_raster_is_what_was_written(void **state) {
    (void)state;
    char path[] = "/tmp/goniod-picture-XXXXXX.png", *bytes;
    size_t size;
    uint16_t rgb[3 * WIDTH * HEIGHT];
    struct raster raster;
    close(mkstemps(path, 4));
    for (int bits = 8; bits <= 16; bits += 8) {
        struct picture picture = picture_of(bits, rgb);
        assert_int_equal(image_write(path, &picture, "{}", NULL), 0);
        assert_int_equal(raster_read(path, &raster, NULL), 0);
        assert_true(raster.width == WIDTH && raster.height == HEIGHT);
        for (int i = 0; i < 3 * WIDTH * HEIGHT; i++)
            assert_int_equal(raster.rgb[i], bits == 8 ? 257 * rgb[i] : rgb[i]);
        raster_free(&raster);
    }
    assert_int_equal(file_read(path, 1 << 20, &bytes, &size, NULL), 0);
    for (size_t cut = 0; cut < size - 12;
         cut += 7) { /* a file that ends too soon; IEND alone may be missing */
        FILE *file = fopen(path, "wb");
        fwrite(bytes, 1, cut, file);
        fclose(file);
        assert_true(raster_read(path, &raster, NULL) < 0);
    }
    free(bytes);
    unlink(path);
    assert_int_equal(raster_read(path, &raster, NULL), -ERR_IO);
}

static void same_bytes(char *path) {
    char *first, *second;
    size_t size[2];
    uint16_t rgb[3 * WIDTH * HEIGHT];
    struct picture picture = picture_of(16, rgb);
    close(mkstemps(path, 4));
    assert_int_equal(image_write(path, &picture, "{}", NULL), 0);
    assert_int_equal(file_read(path, 1 << 20, &first, &size[0], NULL), 0);
    assert_int_equal(image_write(path, &picture, "{}", NULL), 0);
    assert_int_equal(file_read(path, 1 << 20, &second, &size[1], NULL), 0);
    assert_int_equal(size[0], size[1]);
    assert_memory_equal(first, second, size[0]);
    free(first);
    free(second);
    unlink(path);
}

static void the_same_picture_gives_the_same_bytes(void **state) {
    (void)state;
    char png[] = "/tmp/goniod-picture-XXXXXX.png", tiff[] = "/tmp/goniod-picture-XXXXXX.tif";
    same_bytes(png);
    same_bytes(tiff);
}

/* Little CMS, given our profile, makes of linear greys and primaries what the curve and the matrix say. */
static void the_profile_is_the_space(void **state) {
    (void)state;
    for (int space = 0; space < COLOUR_SPACES; space++) {
        unsigned char *bytes;
        size_t size;
        assert_int_equal(icc_make((enum colour_space)space, &bytes, &size, NULL), 0);
        cmsHPROFILE profile = cmsOpenProfileFromMem(bytes, (cmsUInt32Number)size),
                    xyz = cmsCreateXYZProfile();
        cmsHTRANSFORM transform = cmsCreateTransform(profile, TYPE_RGB_DBL, xyz, TYPE_XYZ_DBL,
                                                     INTENT_RELATIVE_COLORIMETRIC, cmsFLAGS_NOOPTIMIZE);
        assert_non_null(transform);
        const struct colour_curve *curve = colour_curve((enum colour_space)space);
        double grey[3] = {.5, .5, .5}, got[3];
        cmsDoTransform(transform, grey, got, 1);
        double linear = curve->gain == 0 ? pow(.5, curve->gamma) : pow((.5 + .055) / 1.055, 2.4);
        assert_true(fabs(got[1] - linear) < 1e-4); /* PCS: the space's white is D50's Y = 1 */
        /* Green's Y, adapted to D50 by Bradford. */
        double d50[3] = {.9642, 1, .8249}, white[3], green[3], own[3] = {0, 1, 0};
        struct colour_matrix from = colour_from_xyz((enum colour_space)space), to = colour_inverse(&from),
                             adapt;
        colour_space_white((enum colour_space)space, white);
        adapt = colour_adapt(COLOUR_BRADFORD, white, d50);
        to = colour_multiply(&adapt, &to);
        colour_apply(&to, own, green);
        cmsDoTransform(transform, own, got, 1);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(got[i] - green[i]) < 2e-4);
        cmsDeleteTransform(transform);
        cmsCloseProfile(profile);
        cmsCloseProfile(xyz);
        free(bytes);
    }
}

static void what_cannot_be_written_is_said(void **state) {
    (void)state;
    uint16_t rgb[3 * WIDTH * HEIGHT];
    struct picture picture = picture_of(8, rgb);
    struct err e = {0};
    assert_int_equal(image_write("/nonexistent/x.png", &picture, "{}", &e), -ERR_IO);
    assert_int_equal(image_write("x.jpg", &picture, "{}", NULL), -ERR_USAGE);
    assert_int_equal(image_known("x", NULL), -ERR_USAGE);
    if (access("/dev/full", W_OK) == 0) {
        FILE *full = fopen("/dev/full", "wb");
        unsigned char *profile;
        size_t size;
        setvbuf(full, NULL, _IONBF, 0);
        assert_int_equal(icc_make(COLOUR_SRGB, &profile, &size, NULL), 0);
        assert_int_equal(image_png(full, &picture, profile, size, "{}", NULL), -ERR_IO);
        assert_int_equal(image_tiff(full, &picture, profile, size, "{}", NULL), -ERR_IO);
        free(profile);
        fclose(full);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_png_reads_back),
        cmocka_unit_test(a_tiff_reads_back),
        cmocka_unit_test(a_raster_is_what_was_written),
        cmocka_unit_test(the_same_picture_gives_the_same_bytes),
        cmocka_unit_test(the_profile_is_the_space),
        cmocka_unit_test(what_cannot_be_written_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
