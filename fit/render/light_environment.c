#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/exr.h"
#include "fit/render/light.h"
#include "fit/render/place.h"
#include "fit/render/raster.h"
#include "fit/render/sha256.h"

/* Of linear red, green and blue (IEC 61966-2-1): a coloured picture counts by its luminance. */
static const double luminance[3] = {0.2126, 0.7152, 0.0722};

static int make_map(struct light_environment *m, int columns, int rows, struct err *e) {
    size_t n = (size_t)columns * (size_t)rows;
    m->columns = columns;
    m->rows = rows;
    m->radiance = malloc(n * sizeof *m->radiance);
    m->row_part = malloc((size_t)(rows + 1) * sizeof *m->row_part);
    m->part = malloc((n + (size_t)rows) * sizeof *m->part);
    return m->radiance && m->row_part && m->part
               ? 0
               : err_set(e, ERR_NOMEM, "no memory for an environment of %d x %d", columns, rows);
}

static int take_exr(struct light_environment *m, const char *path, struct err *e) {
    struct exr_image image;
    int status = exr_load(path, "", &image, e);
    if (status) {
        return status;
    }
    const float *y = exr_plane(&image, "Y"),
                *rgb[3] = {exr_plane(&image, "R"), exr_plane(&image, "G"), exr_plane(&image, "B")};
    if (!y && !(rgb[0] && rgb[1] && rgb[2])) {
        status = err_set(e, ERR_INPUT, "%s has neither a channel Y nor R, G and B", path);
    }
    status = status ? status : make_map(m, image.width, image.height, e);
    for (size_t i = 0; i < (size_t)m->columns * (size_t)m->rows && !status; i++) {
        double sum = 0;
        for (int k = 0; k < 3 && !y; k++) {
            sum += luminance[k] * rgb[k][i];
        }
        m->radiance[i] = y ? y[i] : (float)sum;
    }
    exr_free(&image);
    return status;
}

static int take_png(struct light_environment *m, const char *path, struct err *e) {
    struct raster raster;
    int status = raster_read(path, &raster, e);
    if (status) {
        return status;
    }
    status = make_map(m, raster.width, raster.height, e);
    for (size_t i = 0; i < (size_t)m->columns * (size_t)m->rows && !status; i++) {
        double sum = 0;
        for (int k = 0; k < 3; k++) {
            sum += luminance[k] * raster.rgb[3 * i + (size_t)k];
        }
        m->radiance[i] = (float)sum;
    }
    raster_free(&raster);
    return status;
}

static int check_map(const struct light_environment *m, const char *path, struct err *e) {
    for (size_t i = 0; i < (size_t)m->columns * (size_t)m->rows; i++) {
        if (!(m->radiance[i] >= 0 && isfinite(m->radiance[i]))) {
            return err_set(e, ERR_INPUT, "%s: the radiance at column %d, row %d is %g; it must be 0 or more",
                           path, (int)(i % (size_t)m->columns), (int)(i / (size_t)m->columns),
                           m->radiance[i]);
        }
    }
    return 0;
}

/* cos of the angle from +y of the upper border of a row. */
static double border(const struct light_environment *m, int row) {
    return cos(M_PI * row / m->rows);
}

static double *parts_of(const struct light_environment *m, int row) {
    return m->part + (size_t)row * (size_t)(m->columns + 1);
}

static float *radiances_of(const struct light_environment *m, int row) {
    return m->radiance + (size_t)row * (size_t)m->columns;
}

/* Sums of radiance times solid angle, made parts of 1. */
static double sum_up(struct light_environment *m) {
    m->row_part[0] = 0;
    for (int row = 0; row < m->rows; row++) {
        double *part = parts_of(m, row), size = 2 * M_PI / m->columns * (border(m, row) - border(m, row + 1));
        part[0] = 0;
        for (int i = 0; i < m->columns; i++) {
            part[i + 1] = part[i] + (double)radiances_of(m, row)[i];
        }
        m->row_part[row + 1] = m->row_part[row] + part[m->columns] * size;
        for (int i = 1; i < m->columns && part[m->columns] > 0; i++) {
            part[i] /= part[m->columns];
        }
        part[m->columns] = 1;
    }
    return m->row_part[m->rows];
}

int light_environment_prepare(struct light *light, const char *folder, struct err *e) {
    struct light_environment *m = &light->environment;
    char path[PLACE_MAX];
    m->frame = frame_make((double[]){0, 0, 0}, m->turn_deg);
    if (light->weight == 0) {
        return 0;
    }
    place_of(path, folder, m->image);
    bool exr = place_ends(m->image, ".exr");
    if (!exr && !place_ends(m->image, ".png")) {
        return err_set(e, ERR_INPUT, "'%s' is no environment: an EXR or a PNG, by its ending .exr or .png",
                       m->image);
    }
    int status = exr ? take_exr(m, path, e) : take_png(m, path, e);
    status = status ? status : sha256_of_file(path, m->sha256, e);
    status = status ? status : check_map(m, path, e);
    double whole = status ? 1 : sum_up(m);
    if (!(whole > 0)) {
        status =
            err_set(e, ERR_INPUT, "%s is dark everywhere; give the light weight 0 to leave it out", path);
    }
    for (int i = 0; i < m->rows && !status; i++) {
        m->row_part[i + 1] /= whole;
    }
    for (size_t i = 0; i < (size_t)m->columns * (size_t)m->rows && !status; i++) {
        m->radiance[i] = (float)(m->radiance[i] * 4 * M_PI / whole);
    }
    return status;
}

void light_environment_free(struct light *light) {
    free(light->environment.radiance);
    free(light->environment.row_part);
    free(light->environment.part);
    light->environment.radiance = NULL;
    light->environment.row_part = light->environment.part = NULL;
}

/* The cell i with part[i] <= u < part[i + 1]; *rest: where in it. */
static int cell_of(const double *part, int n, double u, double *rest) {
    int low = 0, high = n;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (part[middle] <= u) {
            low = middle;
        } else {
            high = middle;
        }
    }
    double width = part[low + 1] - part[low];
    *rest = width > 0 ? (u - part[low]) / width : 0.5;
    return low;
}

static void fill(const struct light_environment *m, int row, int column, struct light_sample *sample) {
    sample->distance_mm = INFINITY;
    sample->radiance = radiances_of(m, row)[column];
    sample->density = sample->radiance / (4 * M_PI); /* its mean is 1: drawn as bright as it is */
}

bool light_environment_sample(const struct light *light, struct vec3 from, const double u[2],
                              struct light_sample *sample) {
    const struct light_environment *m = &light->environment;
    double down, across;
    (void)from;
    if (!m->radiance) {
        return false;
    }
    int row = cell_of(m->row_part, m->rows, u[0], &down);
    int column = cell_of(parts_of(m, row), m->columns, u[1], &across);
    double cosine = border(m, row) + down * (border(m, row + 1) - border(m, row));
    double azimuth = 2 * M_PI * ((column + across) / m->columns - 0.5),
           sine = sqrt((1 - cosine) * (1 + cosine));
    sample->l = frame_out(&m->frame, (struct vec3){sine * sin(azimuth), cosine, -sine * cos(azimuth)});
    fill(m, row, column, sample);
    return sample->radiance > 0;
}

static int index_of(double part, int n) {
    int i = (int)(part * n);
    return i < 0 ? 0 : i >= n ? n - 1 : i;
}

bool light_environment_meet(const struct light *light, struct vec3 from, struct vec3 l,
                            struct light_sample *sample) {
    const struct light_environment *m = &light->environment;
    struct vec3 own = frame_into(&m->frame, l);
    (void)from;
    if (!m->radiance) {
        return false;
    }
    double azimuth = atan2(own.x, -own.z), polar = atan2(hypot(own.x, own.z), own.y);
    fill(m, index_of(polar / M_PI, m->rows), index_of(azimuth / (2 * M_PI) + 0.5, m->columns), sample);
    return true;
}
