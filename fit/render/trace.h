/*
 * trace.h — the loop over pixels: tiles of rows over threads, the same bits for any number of them.
 *
 * An integrator says what one camera ray sees: the paint and, for each set of the planes, a, b, c. trace_run divides
 * the picture, adds the samples of a pixel in a fixed order, and keeps what is done when it is cancelled.
 * Checked    tests/unit/test_render.c
 */
#ifndef FIT_RENDER_TRACE_H
#define FIT_RENDER_TRACE_H

#include "fit/render/render.h"

#define TRACE_TILE_ROWS 8

struct trace { /* what the integrator may read; prepared once, shared by all threads */
    const struct scene *scene;
    unsigned shade_features;
    bool shadow_rays, dark_lights;
    struct shade_half (*half)[SCENE_LIGHTS]; /* [paint][light], of parallel light and a parallel camera */
};

struct trace_sample {
    int paint; /* -1: the ray meets nothing; the rest is then not read */
    struct shade_abc set[PLANES_SETS];
};

typedef void trace_integrator(const struct trace *t, const struct ray *ray, struct trace_sample *sample,
                              struct render_counts *counts);

/* Lights without extent, one bounce. */
trace_integrator trace_direct;

int trace_run(const struct trace *trace, trace_integrator *integrator, const struct render_options *options,
              struct planes *planes, struct render_counts *counts, struct err *e);

#endif
