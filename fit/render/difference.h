/*
 * difference.h — how different two pictures of the same pixels look: CIEDE2000 pixel by pixel.
 *
 * Compared are the pixels where both show something. Both are seen as CIELAB under the first one's white: X, Y, Z
 * of the second are taken there from its own white by the first scene's chromatic adaptation; with adaptation `none`
 * they stay as they are, so that the colour of the light itself counts. Exposure has no part in it: the perfect
 * diffuser at normal incidence is L* = 100.
 *
 * Errors     difference_make: -ERR_USAGE pictures of different size; -ERR_STATE no pixel shows something in both;
 *            those of render_xyz and white_of. difference_values: those of exr.h.
 * Checked    tests/unit/test_difference.c
 */
#ifndef FIT_RENDER_DIFFERENCE_H
#define FIT_RENDER_DIFFERENCE_H

#include "fit/render/render.h"

struct difference {
    int width, height;
    float *lab[2]; /* [3 * pixels] of each picture */
    float *de;     /* [pixels] CIEDE2000; NaN where not both show something */
    uint64_t n, only[2];
    double mean, median, p95, max;
    int max_x, max_y;      /* the pixel of the largest */
    double mean_lab[2][3]; /* over the pixels compared */
    double white[3];       /* XYZ that CIELAB is relative to */
};

struct difference_side {
    const struct scene *scene;
    const struct planes *planes;
};

int difference_make(const struct difference_side side[2], struct difference *d, struct err *e);
void difference_free(struct difference *d);
/* CIEDE2000 0..top in the colours of viridis, above top its last; black where nothing is compared. */
int difference_picture(const struct difference *d, double top, struct picture *picture, struct err *e);
/* The next of 1, 2, 5, 10, ... that no difference is above. */
double difference_top(const struct difference *d);
/* EXR with the channels dE00, first.L, .a, .b and second.L, .a, .b; "goniod": the origin. */
int difference_values(const char *path, const struct difference *d, const char *origin_json, struct err *e);

#endif
