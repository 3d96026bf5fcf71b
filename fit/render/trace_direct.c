#include <string.h>

#include "fit/render/intersect.h"
#include "fit/render/trace.h"

/* Met anew, or as the first picture of a series met it. */
static bool meet(const struct trace *t, const struct ray *ray, const struct trace_sample *sample,
                 struct hit *hit, struct render_counts *counts) {
    int rays = t->scene->image.grid * t->scene->image.grid;
    struct hit *kept =
        t->hits ? &t->hits->hit[(size_t)sample->pixel * (size_t)rays + (size_t)sample->index] : NULL;
    if (kept && t->hits->known) {
        *hit = *kept;
        return hit->shape >= 0;
    }
    counts->camera_rays++;
    bool met = intersect_nearest(t->scene, ray, hit);
    if (kept) {
        *kept = *hit;
    }
    return met;
}

bool trace_first(const struct trace *t, const struct ray *ray, struct hit *hit, struct trace_sample *sample,
                 struct render_counts *counts) {
    sample->paint = -1;
    if (!meet(t, ray, sample, hit, counts)) {
        return false;
    }
    counts->hits++;
    sample->paint = hit->paint;
    for (int j = 0; j < t->scene->n_spds; j++) {
        sample->set[j] = (struct shade_abc){0, 0, 0};
    }
    if (t->repeats > 0) {
        memset(sample->y, 0, sizeof sample->y);
        sample->brightest = 0;
    }
    return true;
}

void trace_direct_at(const struct trace *t, const struct hit *hit, struct vec3 v, struct shade_abc *set,
                     struct render_counts *counts) {
    const struct scene *scene = t->scene;
    const struct paint *paint = &scene->paint[hit->paint];
    for (int i = 0; i < scene->n_lights; i++) {
        const struct light *light = &scene->light[i];
        if (light_has_extent(light) || (light->share == 0 && !t->dark_lights)) {
            continue;
        }
        struct shade_abc x = trace_shade(t->shade_features, &paint->shade, &t->half[hit->paint][i],
                                         hit->normal, light->direction, v);
        if (x.a == 0 && x.c == 0) {
            continue;
        }
        if (t->shadow_rays) {
            counts->shadow_rays++;
            if (intersect_blocked(scene, hit, light->direction, INFINITY)) {
                continue;
            }
        }
        if (x.a < 0) { /* Oren and Nayar's fit, forward and very rough */
            counts->negative_diffuse++;
            x.a = 0;
        }
        struct shade_abc *sum = &set[light->spd];
        double part = light->share * trace_energy(t, hit, light->direction, v);
        sum->a += part * x.a;
        sum->b += part * x.b;
        sum->c += part * x.c;
    }
}

void trace_direct(const struct trace *t, const struct ray *ray, struct trace_sample *sample,
                  struct render_counts *counts) {
    struct hit hit;
    if (trace_first(t, ray, &hit, sample, counts)) {
        trace_direct_at(t, &hit, vec3_scale(ray->direction, -1), sample->set, counts);
    }
}
