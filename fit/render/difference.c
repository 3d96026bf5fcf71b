#include "fit/render/difference.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/ciede2000.h"
#include "fit/render/exr.h"
#include "fit/render/white.h"

/* From XYZ of one side to those under the first one's white. */
static int adaptation_of(const struct difference_side side[2], int which, const double white[3],
                         struct colour_matrix *adapt, struct err *e) {
    double own[3];
    int status = white_of(side[which].scene, own, e);
    if (!status) {
        *adapt = colour_adapt((enum colour_adaptation)side[0].scene->image.adaptation, own, white);
    }
    return status;
}

static int fill_lab(const struct difference_side side[2], int which, struct difference *d, struct err *e) {
    size_t n = (size_t)d->width * (size_t)d->height;
    struct colour_matrix adapt;
    double *xyz = malloc(3 * n * sizeof *xyz);
    int status = xyz ? 0 : err_set(e, ERR_NOMEM, "no memory to compare pictures");
    status = status ? status : adaptation_of(side, which, d->white, &adapt, e);
    status = status ? status : render_xyz(side[which].scene, side[which].planes, false, xyz, e);
    for (size_t i = 0; i < n && !status; i++) {
        double seen[3], lab[3];
        colour_apply(&adapt, xyz + 3 * i, seen);
        colour_lab(seen, d->white, lab);
        for (int k = 0; k < 3; k++) {
            d->lab[which][3 * i + (size_t)k] = (float)lab[k];
        }
    }
    free(xyz);
    return status;
}

static void compare_pixel(const struct difference_side side[2], struct difference *d, size_t i, double *sum) {
    bool shown[2] = {side[0].planes->paint[i] >= 0, side[1].planes->paint[i] >= 0};
    double lab[2][3];
    d->de[i] = NAN;
    if (!shown[0] || !shown[1]) {
        d->only[0] += shown[0];
        d->only[1] += shown[1];
        return;
    }
    for (int k = 0; k < 6; k++) {
        lab[k / 3][k % 3] = d->lab[k / 3][3 * i + (size_t)(k % 3)];
        d->mean_lab[k / 3][k % 3] += lab[k / 3][k % 3];
    }
    double de = ciede2000(lab[0], lab[1]);
    d->de[i] = (float)de;
    *sum += de;
    if (d->n++ == 0 || de > d->max) {
        d->max = de;
        d->max_x = (int)(i % (size_t)d->width);
        d->max_y = (int)(i / (size_t)d->width);
    }
}

static int by_size(const void *a, const void *b) {
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* The least of the values that a part of all does not exceed. */
static double quantile(const float *sorted, size_t n, double part) {
    size_t rank = (size_t)ceil(part * (double)n);
    return sorted[rank > 0 ? rank - 1 : 0];
}

static int summarise(struct difference *d, double sum, struct err *e) {
    size_t pixels = (size_t)d->width * (size_t)d->height, n = 0;
    float *sorted = malloc(pixels * sizeof *sorted);
    if (!sorted) {
        return err_set(e, ERR_NOMEM, "no memory to compare pictures");
    }
    for (size_t i = 0; i < pixels; i++) {
        if (!isnan(d->de[i])) {
            sorted[n++] = d->de[i];
        }
    }
    qsort(sorted, n, sizeof *sorted, by_size);
    if (n > 0) {
        d->mean = sum / (double)n;
        d->median = quantile(sorted, n, 0.5);
        d->p95 = quantile(sorted, n, 0.95);
        for (int k = 0; k < 6; k++) {
            d->mean_lab[k / 3][k % 3] /= (double)n;
        }
    }
    free(sorted);
    return n > 0 ? 0 : err_set(e, ERR_STATE, "no pixel shows something in both pictures");
}

int difference_make(const struct difference_side side[2], struct difference *d, struct err *e) {
    const struct planes *p = side[0].planes;
    size_t n = (size_t)p->width * (size_t)p->height;
    double sum = 0;
    *d = (struct difference){.width = p->width, .height = p->height};
    if (side[1].planes->width != p->width || side[1].planes->height != p->height) {
        return err_set(e, ERR_USAGE, "%d x %d and %d x %d pixels cannot be compared; give both one size",
                       p->width, p->height, side[1].planes->width, side[1].planes->height);
    }
    d->lab[0] = malloc(3 * n * sizeof *d->lab[0]);
    d->lab[1] = malloc(3 * n * sizeof *d->lab[1]);
    d->de = malloc(n * sizeof *d->de);
    int status = d->lab[0] && d->lab[1] && d->de ? 0 : err_set(e, ERR_NOMEM, "no memory to compare pictures");
    status = status ? status : white_of(side[0].scene, d->white, e);
    status = status ? status : fill_lab(side, 0, d, e);
    status = status ? status : fill_lab(side, 1, d, e);
    for (size_t i = 0; i < n && !status; i++) {
        compare_pixel(side, d, i, &sum);
    }
    status = status ? status : summarise(d, sum, e);
    if (status) {
        difference_free(d);
    }
    return status;
}

void difference_free(struct difference *d) {
    free(d->lab[0]);
    free(d->lab[1]);
    free(d->de);
    d->lab[0] = d->lab[1] = d->de = NULL;
}

double difference_top(const struct difference *d) {
    static const double step[] = {1, 2, 5};
    for (double decade = 0.01; decade < 1e3; decade *= 10) {
        for (int i = 0; i < 3; i++) {
            if (d->max <= step[i] * decade) {
                return step[i] * decade;
            }
        }
    }
    return d->max;
}

/* Nine points of viridis (van der Walt and Smith 2015, CC0), eighths of its range; straight lines between them. */
static const double viridis[][3] = {{68, 1, 84},    {72, 40, 120},  {62, 74, 137},
                                    {49, 104, 142}, {38, 130, 142}, {31, 158, 137},
                                    {53, 183, 121}, {110, 206, 88}, {253, 231, 37}};
#define VIRIDIS_PARTS 8

static void shade_value(double part, uint16_t code[3]) {
    double at = fmin(fmax(part, 0), 1) * VIRIDIS_PARTS;
    int i = at < VIRIDIS_PARTS ? (int)at : VIRIDIS_PARTS - 1;
    for (int k = 0; k < 3; k++) {
        code[k] = (uint16_t)lround(viridis[i][k] + (at - i) * (viridis[i + 1][k] - viridis[i][k]));
    }
}

int difference_picture(const struct difference *d, double top, struct picture *picture, struct err *e) {
    size_t n = (size_t)d->width * (size_t)d->height;
    *picture = (struct picture){.width = d->width,
                                .height = d->height,
                                .bits = 8,
                                .space = COLOUR_SRGB,
                                .rgb = calloc(3 * n, sizeof *picture->rgb)};
    if (!picture->rgb) {
        return err_set(e, ERR_NOMEM, "no memory for the picture");
    }
    for (size_t i = 0; i < n; i++) {
        if (!isnan(d->de[i])) {
            shade_value(d->de[i] / top, picture->rgb + 3 * i);
            picture->clipped += d->de[i] > top;
        }
    }
    return 0;
}

static void fill_row(void *arg, int y, float *const *row) {
    const struct difference *d = arg;
    for (int x = 0; x < d->width; x++) {
        size_t i = (size_t)y * (size_t)d->width + (size_t)x;
        row[0][x] = d->de[i];
        for (int k = 0; k < 6; k++) {
            row[1 + k][x] = d->lab[k / 3][3 * i + (size_t)(k % 3)];
        }
    }
}

int difference_values(const char *path, const struct difference *d, const char *origin_json, struct err *e) {
    static const char channel[][EXR_NAME_MAX] = {"dE00",     "first.L",  "first.a", "first.b",
                                                 "second.L", "second.a", "second.b"};
    const struct exr_text text = {"goniod", origin_json};
    struct exr_form form = {.width = d->width,
                            .height = d->height,
                            .n_channels = sizeof channel / sizeof *channel,
                            .n_texts = 1,
                            .channel = channel,
                            .text = &text,
                            .fill = fill_row,
                            .arg = (void *)d};
    return exr_save(path, &form, e);
}
