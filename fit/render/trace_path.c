#include <string.h>

#include "fit/render/path.h"
#include "fit/render/trace.h"

/* The spectrum of one path into the sample's; its Y. */
static double take_spectrum(const struct trace *t, const struct path *path, struct trace_sample *sample) {
    double own[PLANES_SETS][BANDS], y = 0;
    if (path->n == 0) {
        return 0;
    }
    memset(own, 0, (size_t)t->scene->n_spds * sizeof *own);
    path_carry(path, t->scene, 1.0 / t->repeats, own);
    for (int j = 0; j < t->scene->n_spds; j++) {
        for (int k = 0; k < BANDS; k++) {
            y += t->y->band[j][k] * own[j][k];
            sample->indirect[j][k] += own[j][k];
        }
    }
    return y * t->repeats;
}

/* What the lights alone make stays a, b, c; paths add what comes after it. */
void trace_path(const struct trace *t, const struct ray *ray, struct trace_sample *sample,
                struct render_counts *counts) {
    struct vec3 v = vec3_scale(ray->direction, -1);
    struct hit hit;
    struct path_place place;
    if (!trace_first(t, ray, &hit, sample, counts)) {
        return;
    }
    trace_direct_at(t, &hit, v, sample->set, counts);
    path_begin(t->beyond, &hit, v, &place);
    for (int r = 0; r < t->repeats; r++) {
        struct sampler sampler;
        struct path path;
        trace_sampler(t, sample, r, &sampler);
        double y = trace_area_repeat(t, &hit, v, &sampler, sample, counts);
        path_find(t->beyond, &place, &sampler, &path, counts);
        trace_count(t, r, y + take_spectrum(t, &path, sample), sample, counts);
    }
}
