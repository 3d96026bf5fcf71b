#include <string.h>

#include "fit/render/intersect.h"
#include "fit/render/path.h"
#include "fit/render/trace.h"

/* What the lights alone make stays a, b, c; paths add what comes after it. */
void trace_path(const struct trace *t, const struct ray *ray, struct trace_sample *sample,
                struct render_counts *counts) {
    struct vec3 v = vec3_scale(ray->direction, -1);
    struct hit hit;
    counts->camera_rays++;
    sample->paint = -1;
    if (!intersect_nearest(t->scene, ray, &hit)) {
        return;
    }
    counts->hits++;
    sample->paint = hit.paint;
    memset(sample->set, 0, (size_t)t->scene->n_spds * sizeof *sample->set);
    trace_direct_at(t, &hit, v, sample->set, counts);
    for (int r = 0; r < t->repeats; r++) {
        struct sampler sampler;
        struct path path;
        sampler_start(&sampler, 0, sample->pixel, (uint32_t)(sample->index * t->repeats + r));
        path_find(t->beyond, &hit, v, &sampler, &path, counts);
        path_carry(&path, t->scene, 1.0 / t->repeats, sample->indirect);
    }
}
