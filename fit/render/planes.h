/*
 * planes.h — a picture before any colour: for each pixel the paint it shows and a, b, c for each spectrum of light.
 *
 * radiance(k) = sum over sets j of E_j(k) (a_j S(k) + b_j S(k)^2 + c_j), S of the pixel's paint. A pixel that shows
 * several paints keeps the one seen first here and the others in `extra`, so that any colour made from the planes
 * is exact: another illuminant, observer or S never traces a ray again.
 *
 * indirect   light that came over several surfaces, where the scene asks for more than one bounce: r_j(k) in
 *                radiance(k) = sum over sets j of E_j(k) (a_j S(k) + b_j S(k)^2 + c_j + r_j(k)),
 *            of all paints of the pixel together. Linear in E, so that another illuminant still only colours; another S
 *            is another picture.
 *
 * Shapes     a, b, c [height * width] by rows from the top; b or c NULL: left out (0 everywhere). paint -1: nothing.
 *            extra[] in the order of pixels. indirect [height * width][BANDS], 32-bit floats, or NULL.
 *            noise [height * width]: the variance of each pixel's Y, as the scene colours it, by what was drawn at
 *            random; NULL: nothing was.
 * Checked    tests/unit/test_render.c
 */
#ifndef FIT_RENDER_PLANES_H
#define FIT_RENDER_PLANES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fit/render/shade.h"
#include "proto/bands.h"
#include "proto/err.h"

#define PLANES_SETS 16

struct planes_extra {
    uint32_t pixel;
    int16_t paint, set;
    struct shade_abc abc;
};

struct planes {
    int width, height, n_sets;
    struct {
        double *a, *b, *c;
        float *indirect;
    } set[PLANES_SETS];
    int16_t *paint;
    double *noise;
    struct planes_extra *extra;
    size_t n_extra, extra_capacity;
    size_t bytes; /* of all planes */
};

int planes_make(struct planes *p, int width, int height, int n_sets, bool with_b, bool with_c, struct err *e);
/* All 0; of 81 values for each pixel and set. */
int planes_add_indirect(struct planes *p, struct err *e);
bool planes_have_indirect(const struct planes *p);
int planes_add_noise(struct planes *p, struct err *e);
void planes_free(struct planes *p);
int planes_add_extra(struct planes *p, const struct planes_extra *extra, size_t n, struct err *e);

#endif
