#include "fit/render/image.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit/render/icc.h"

typedef int image_writer(void *file, const struct picture *picture, const unsigned char *profile,
                         size_t profile_size, const char *origin_json, struct err *e);

static const struct {
    const char *ending;
    image_writer *write;
} formats[] = {{".png", image_png}, {".tif", image_tiff}, {".tiff", image_tiff}};
#define FORMATS (sizeof formats / sizeof *formats)

static image_writer *writer_of(const char *path) {
    const char *dot = strrchr(path, '.');
    for (size_t i = 0; dot && i < FORMATS; i++) {
        if (strcmp(dot, formats[i].ending) == 0) {
            return formats[i].write;
        }
    }
    return NULL;
}

int image_known(const char *path, struct err *e) {
    return writer_of(path) ? 0 : err_set(e, ERR_USAGE, "%s: a picture is written as .png or .tif", path);
}

static int write_whole(const char *part, image_writer *write, const struct picture *picture,
                       const char *origin_json, struct err *e) {
    unsigned char *profile = NULL;
    size_t profile_size = 0;
    int status = icc_make(picture->space, &profile, &profile_size, e);
    FILE *file = status ? NULL : fopen(part, "wb");
    if (!status && !file) {
        status = err_errno(e, ERR_IO, errno, "%s cannot be written", part);
    }
    status = status ? status : write(file, picture, profile, profile_size, origin_json, e);
    if (file && fclose(file) != 0 && !status) {
        status = err_errno(e, ERR_IO, errno, "%s cannot be written", part);
    }
    free(profile);
    return status;
}

int image_write(const char *path, const struct picture *picture, const char *origin_json, struct err *e) {
    char part[4096];
    image_writer *write = writer_of(path);
    if (!write) {
        return image_known(path, e);
    }
    snprintf(part, sizeof part, "%s.part", path);
    int status = write_whole(part, write, picture, origin_json, e);
    if (!status && rename(part, path) != 0) {
        status = err_errno(e, ERR_IO, errno, "%s cannot be written", path);
    }
    if (status) {
        unlink(part);
    }
    return status;
}
