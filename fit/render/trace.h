/*
 * trace.h — the loop over pixels: tiles of rows over threads, the same bits for any number of them.
 *
 * An integrator says what one camera ray sees: the paint and, for each set of the planes, a, b, c. trace_run divides
 * the picture, adds the samples of a pixel in a fixed order, and keeps what is done when it is cancelled.
 * Checked    tests/unit/test_render.c
 */
#ifndef FIT_RENDER_TRACE_H
#define FIT_RENDER_TRACE_H

#include "fit/render/energy.h"
#include "fit/render/render.h"

#define TRACE_TILE_ROWS 8

struct trace { /* what the integrator may read; prepared once, shared by all threads */
    const struct scene *scene;
    unsigned shade_features;
    bool shadow_rays, dark_lights;
    int repeats;                             /* Monte Carlo samples for each camera ray */
    struct shade_half (*half)[SCENE_LIGHTS]; /* [paint][light], of parallel light and a parallel camera */
    const struct trace *beyond;              /* the first bounce; NULL: there is only one */
    const struct energy *energy;             /* [paint]; beyond the first bounce alone */
};

struct trace_sample {
    uint32_t pixel; /* given: by rows from the top, and which camera ray of the pixel */
    int index;
    double (*indirect)[BANDS]; /* given, of several bounces: [set], to be added to */
    int paint;                 /* -1: the ray meets nothing; the rest is then not read */
    struct shade_abc set[PLANES_SETS];
};

typedef void trace_integrator(const struct trace *t, const struct ray *ray, struct trace_sample *sample,
                              struct render_counts *counts);

/* Lights without extent, one bounce. */
trace_integrator trace_direct;
/* Several bounces. */
trace_integrator trace_path;
/* Adds what a hit sends towards v, of each light without extent, to set[light->spd]. */
void trace_direct_at(const struct trace *t, const struct hit *hit, struct vec3 v, struct shade_abc *set,
                     struct render_counts *counts);

int trace_run(const struct trace *trace, trace_integrator *integrator, const struct render_options *options,
              struct planes *planes, struct render_counts *counts, struct err *e);

#endif
