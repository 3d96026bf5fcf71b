/*
 * trace.h — the loop over pixels: tiles of rows over threads, the same bits for any number of them.
 *
 * An integrator says what one camera ray sees: the paint and, for each set of the planes, a, b, c. trace_run divides
 * the picture, adds the samples of a pixel in a fixed order, and keeps what is done when it is cancelled.
 *
 * At random  an integrator that draws does so `repeats` times from each hit, repeat r from trace_sampler(.., r, ..). The
 *            repeats belong to TRACE_GROUPS groups drawn independently of each other: how far the groups' Y differ is
 *            the noise of the pixel. trace_count takes the Y of each repeat.
 * Checked    tests/unit/test_render.c, test_trace_area.c, test_render_noise.c
 */
#ifndef FIT_RENDER_TRACE_H
#define FIT_RENDER_TRACE_H

#include "fit/render/glint.h"
#include "fit/render/render.h"
#include "fit/render/sampler.h"

#define TRACE_TILE_ROWS 8
#define TRACE_GROUPS 4

struct trace_y {                              /* what makes Y of what is drawn */
    double abc[SCENE_PAINTS][PLANES_SETS][3]; /* of a, b and c */
    double band[PLANES_SETS][BANDS];          /* of a spectrum */
};

struct trace { /* what the integrator may read; prepared once, shared by all threads */
    const struct scene *scene;
    unsigned shade_features;
    bool shadow_rays, dark_lights;
    bool whole_paths;                        /* none is ended by chance */
    struct shade_half (*half)[SCENE_LIGHTS]; /* [paint][light], of parallel light and a parallel camera */
    int repeats;                             /* a multiple of TRACE_GROUPS; 0: nothing is drawn */
    bool facets[SCENE_PAINTS][SCENE_LIGHTS]; /* the lobe in this light: by facets too (features.h) */
    const struct trace_y *y;                 /* where something is drawn */
    const struct trace *beyond;              /* the first bounce; NULL: there is only one */
    const struct energy *energy;             /* [paint]; beyond the first bounce alone */
    const struct aim *aim;                   /* the same */
    const struct glints *glints;             /* the same */
    struct render_hits *hits;                /* of a series; or NULL */
};

struct trace_sample {
    uint32_t pixel; /* given: by rows from the top, and which camera ray of the pixel */
    int index;
    double (*indirect)[BANDS]; /* given, of several bounces: [set], to be added to */
    int paint;                 /* -1: the ray meets nothing; the rest is then not read */
    struct shade_abc set[PLANES_SETS];
    double y[TRACE_GROUPS]; /* mean Y over each group's repeats; not read where nothing is drawn */
    double brightest;       /* largest Y of them */
};

typedef void trace_integrator(const struct trace *t, const struct ray *ray, struct trace_sample *sample,
                              struct render_counts *counts);

/* Lights without extent, one bounce. */
trace_integrator trace_direct;
/* All lights, one bounce: those with extent at random. */
trace_integrator trace_area;
/* All lights, several bounces. */
trace_integrator trace_path;

/* What a camera ray sees: false and sample->paint -1 where it meets nothing; else the sums of sample are 0. */
bool trace_first(const struct trace *t, const struct ray *ray, struct hit *hit, struct trace_sample *sample,
                 struct render_counts *counts);
/* Adds share times a, b, c of every light without extent, seen from v, to the sets. */
void trace_direct_at(const struct trace *t, const struct hit *hit, struct vec3 v, struct shade_abc *set,
                     struct render_counts *counts);
/* The same of every light with extent, from one random sample of each and one facet; takes as many numbers wherever
 * the hit is. */
void trace_area_at(const struct trace *t, const struct hit *hit, struct vec3 v, struct sampler *sampler,
                   struct shade_abc *set, struct render_counts *counts);
/* One repeat of trace_area_at at the first hit, into the sample's sets; its Y. */
double trace_area_repeat(const struct trace *t, const struct hit *hit, struct vec3 v, struct sampler *sampler,
                         struct trace_sample *sample, struct render_counts *counts);
/* shade() with a literal for each mask that occurs. */
struct shade_abc trace_shade(unsigned features, const struct shade_paint *p, const struct shade_half *half,
                             struct vec3 n, struct vec3 l, struct vec3 v);

static inline double trace_energy(const struct trace *t, const struct hit *hit, struct vec3 l,
                                  struct vec3 v) {
    return t->energy
               ? energy_scale(&t->energy[hit->paint], vec3_dot(hit->normal, l), vec3_dot(hit->normal, v))
               : 1;
}

static inline void trace_sampler(const struct trace *t, const struct trace_sample *sample, int repeat,
                                 struct sampler *sampler) {
    int each = t->repeats / TRACE_GROUPS;
    sampler_start(sampler, (uint32_t)(repeat % TRACE_GROUPS), sample->pixel,
                  (uint32_t)(sample->index * each + repeat / TRACE_GROUPS));
}

void trace_count(const struct trace *t, int repeat, double y, struct trace_sample *sample,
                 struct render_counts *counts);

int trace_run(const struct trace *trace, trace_integrator *integrator, const struct render_options *options,
              struct planes *planes, struct render_counts *counts, struct err *e);

#endif
