#include "fit/render/intersect.h"
#include "fit/render/trace.h"

/* The mask is a literal in each case, so that the compiler drops what is not in it. */
static struct shade_abc shade_by(unsigned features, const struct shade_paint *p,
                                 const struct shade_half *half, struct vec3 n, struct vec3 l, struct vec3 v) {
    switch (features) {
#define CASE(mask)                                                                                           \
    case mask:                                                                                               \
        return shade(mask, p, half, n, l, v);
#define CASES(more)                                                                                          \
    CASE(more)                                                                                               \
    CASE((more) | SHADE_SIGMA)                                                                               \
    CASE((more) | SHADE_SPECULAR)                                                                            \
    CASE((more) | SHADE_SPECULAR | SHADE_SIGMA)
        CASES(0)
        CASES(SHADE_HOISTED)
        CASES(SHADE_HOISTED | SHADE_LOBE_CUT)
        CASES(SHADE_RELATIVES)
        CASES(SHADE_RELATIVES | SHADE_HOISTED)
        CASES(SHADE_RELATIVES | SHADE_HOISTED | SHADE_LOBE_CUT)
#undef CASES
#undef CASE
    default: /* there is no other: a lobe is only cut where its half vector is hoisted */
        return shade(SHADE_RELATIVES | SHADE_SIGMA | SHADE_SPECULAR, p, half, n, l, v);
    }
}

void trace_direct_at(const struct trace *t, const struct hit *hit, struct vec3 v, struct shade_abc *set,
                     struct render_counts *counts) {
    const struct scene *scene = t->scene;
    const struct paint *paint = &scene->paint[hit->paint];
    for (int i = 0; i < scene->n_lights; i++) {
        const struct light *light = &scene->light[i];
        if (light->share == 0 && !t->dark_lights) {
            continue;
        }
        struct shade_abc x = shade_by(t->shade_features, &paint->shade, &t->half[hit->paint][i], hit->normal,
                                      light->direction, v);
        if (x.a == 0 && x.c == 0) {
            continue;
        }
        counts->shadow_rays += t->shadow_rays;
        if (t->shadow_rays && intersect_blocked(scene, hit, light->direction, INFINITY)) {
            continue;
        }
        if (x.a < 0) { /* Oren and Nayar's fit, forward and very rough */
            counts->negative_diffuse++;
            x.a = 0;
        }
        struct shade_abc *sum = &set[light->spd];
        double part = light->share;
        if (t->energy) {
            part *= energy_scale(&t->energy[hit->paint], vec3_dot(hit->normal, light->direction),
                                 vec3_dot(hit->normal, v));
        }
        sum->a += part * x.a;
        sum->b += part * x.b;
        sum->c += part * x.c;
    }
}

void trace_direct(const struct trace *t, const struct ray *ray, struct trace_sample *sample,
                  struct render_counts *counts) {
    struct hit hit;
    counts->camera_rays++;
    sample->paint = -1;
    if (!intersect_nearest(t->scene, ray, &hit)) {
        return;
    }
    counts->hits++;
    sample->paint = hit.paint;
    for (int j = 0; j < t->scene->n_spds; j++) {
        sample->set[j] = (struct shade_abc){0, 0, 0};
    }
    trace_direct_at(t, &hit, vec3_scale(ray->direction, -1), sample->set, counts);
}
