#include <string.h>

#include "fit/render/facet.h"
#include "fit/render/intersect.h"
#include "fit/render/trace.h"

struct place { /* of the light's work: what is the same for all its samples */
    const struct trace *trace;
    const struct hit *hit;
    struct vec3 v;
    struct shade_abc *set;
    struct render_counts *counts;
};

static struct shade_abc shade_at(const struct place *p, struct vec3 l) {
    unsigned features = p->trace->shade_features & ~(unsigned)(SHADE_HOISTED | SHADE_LOBE_CUT);
    return trace_shade(features, &p->trace->scene->paint[p->hit->paint].shade, NULL, p->hit->normal, l, p->v);
}

static bool reaches(const struct place *p, const struct light_sample *s) {
    if (!p->trace->shadow_rays) {
        return true;
    }
    p->counts->shadow_rays++;
    return !intersect_blocked(p->trace->scene, p->hit, s->l, s->distance_mm);
}

static double facets_at(const struct place *p, struct vec3 l) {
    return facet_density(&p->trace->scene->paint[p->hit->paint].drawn, p->hit->normal, p->v, l);
}

/* One direction to the light. Where facets are drawn too, each draw counts by its part of both densities (Veach's
 * balance heuristic), so that neither a small light nor a narrow lobe makes a weight that grows without bound. */
static void add_light_sample(const struct place *p, int i, const struct light_sample *s) {
    const struct light *light = &p->trace->scene->light[i];
    struct shade_abc x = shade_at(p, s->l), *sum = &p->set[light->spd];
    if ((x.a == 0 && x.c == 0) || !reaches(p, s)) {
        return;
    }
    if (x.a < 0) { /* Oren and Nayar's fit, forward and very rough */
        p->counts->negative_diffuse++;
        x.a = 0;
    }
    double light_power = light->share * s->radiance / M_PI * trace_energy(p->trace, p->hit, s->l, p->v);
    double weight = light_power / s->density;
    sum->a += weight * x.a;
    sum->b += weight * x.b;
    if (x.c > 0) {
        bool both = p->trace->facets[p->hit->paint][i];
        sum->c += x.c * (both ? light_power / (s->density + facets_at(p, s->l)) : weight);
    }
}

/* One facet; what it mirrors into the eye may be any of the lights. */
static void add_facet_sample(const struct place *p, const double u[2]) {
    const struct scene *scene = p->trace->scene;
    const bool *facets = p->trace->facets[p->hit->paint];
    struct light_sample s;
    struct shade_abc x = {0, 0, 0};
    if (!facet_sample(&scene->paint[p->hit->paint].drawn, p->hit->normal, p->v, u, &s.l)) {
        return;
    }
    x = shade_at(p, s.l);
    double density = x.c > 0 ? facets_at(p, s.l) : 0;
    double scale = x.c > 0 ? x.c * trace_energy(p->trace, p->hit, s.l, p->v) / M_PI : 0;
    for (int i = 0; i < scene->n_lights && x.c > 0; i++) {
        const struct light *light = &scene->light[i];
        if (facets[i] && light_radiance(light, p->hit->position, s.l, &s) > 0 && reaches(p, &s)) {
            p->set[light->spd].c += scale * light->share * s.radiance / (s.density + density);
        }
    }
}

void trace_area_at(const struct trace *t, const struct hit *hit, struct vec3 v, struct sampler *sampler,
                   struct shade_abc *set, struct render_counts *counts) {
    const struct place place = {t, hit, v, set, counts};
    bool any = false, facets = false;
    double u[2];
    for (int i = 0; i < t->scene->n_lights; i++) {
        const struct light *light = &t->scene->light[i];
        struct light_sample s;
        if (!light_has_extent(light)) {
            continue;
        }
        any = true;
        sampler_2d(sampler, u); /* also for a dark light: the numbers of the others stay */
        facets = facets || t->facets[hit->paint][i];
        if ((light->share > 0 || t->dark_lights) && light_sample(light, hit->position, u, &s)) {
            add_light_sample(&place, i, &s);
        }
    }
    if (any) {
        sampler_2d(sampler, u);
    }
    if (facets && (t->shade_features & SHADE_SPECULAR)) {
        add_facet_sample(&place, u);
    }
}

double trace_area_repeat(const struct trace *t, const struct hit *hit, struct vec3 v, struct sampler *sampler,
                         struct trace_sample *sample, struct render_counts *counts) {
    struct shade_abc own[PLANES_SETS];
    double y = 0;
    memset(own, 0, (size_t)t->scene->n_spds * sizeof *own);
    trace_area_at(t, hit, v, sampler, own, counts);
    for (int j = 0; j < t->scene->n_spds; j++) {
        const double *each = t->y->abc[hit->paint][j];
        y += each[0] * own[j].a + each[1] * own[j].b + each[2] * own[j].c;
        sample->set[j].a += own[j].a / t->repeats;
        sample->set[j].b += own[j].b / t->repeats;
        sample->set[j].c += own[j].c / t->repeats;
    }
    return y;
}

void trace_area(const struct trace *t, const struct ray *ray, struct trace_sample *sample,
                struct render_counts *counts) {
    struct hit hit;
    struct vec3 v = vec3_scale(ray->direction, -1);
    if (!trace_first(t, ray, &hit, sample, counts)) {
        return;
    }
    trace_direct_at(t, &hit, v, sample->set, counts);
    for (int r = 0; r < t->repeats; r++) {
        struct sampler sampler;
        trace_sampler(t, sample, r, &sampler);
        trace_count(t, r, trace_area_repeat(t, &hit, v, &sampler, sample, counts), sample, counts);
    }
}
