#include "fit/render/path.h"

#include <string.h>

#include "fit/render/facet.h"
#include "fit/render/intersect.h"

static struct vec3 draw_cosine(struct vec3 n, const double u[2]) {
    struct vec3 s, t;
    double radius = sqrt(u[0]), azimuth = 2 * M_PI * u[1];
    vec3_frame(n, &s, &t);
    struct vec3 across = vec3_add(vec3_scale(s, radius * cos(azimuth)), vec3_scale(t, radius * sin(azimuth)));
    return vec3_add(across, vec3_scale(n, sqrt(1 - u[0])));
}

static void begin(const struct trace *t, const struct hit *hit, struct vec3 v, bool first,
                  struct path_place *place) {
    place->hit = *hit;
    place->v = v;
    aim_from(t->aim, hit, &place->seen);
    glint_from(t->glints, &place->seen, &place->glints);
    gleam_none(&place->gleams);
    if (first) {
        const struct gleam_surface near = {&t->scene->paint[hit->paint].drawn, hit->normal, v,
                                           &t->energy[hit->paint]};
        gleam_from(&place->glints, &place->seen, &near, hit->position, &place->gleams);
    }
    const struct gleam_parts *part = &place->gleams.part;
    double others = 1 - part->gleams - part->facets - part->glints - part->aim, rest = others;
    rest -= place->by_facets = energy_share(&t->energy[hit->paint], vec3_dot(hit->normal, v)) * others;
    rest -= place->by_glints = place->glints.share * rest;
    place->by_aim = place->seen.share * rest;
    place->by_cosine = rest - place->by_aim;
    place->by_gleams = part->gleams;
    place->by_facets += part->facets;
    place->by_glints += part->glints;
    place->by_aim += part->aim;
}

void path_begin(const struct trace *t, const struct hit *hit, struct vec3 v, struct path_place *place) {
    begin(t, hit, v, true, place);
}

/* Of the number left, whether it falls into this way; what is left of it. */
static bool falls_into(double share, double *left) {
    if (*left < share) {
        *left = sampler_within(*left, share);
        return true;
    }
    *left -= share;
    return false;
}

/* One pair of numbers for the way and the direction, wherever it is. */
static bool draw(const struct trace *t, const struct path_place *p, struct sampler *sampler, struct vec3 *l) {
    double u[2];
    sampler_2d(sampler, u);
    if (falls_into(p->by_gleams, &u[0])) {
        *l = gleam_sample(&p->gleams, u);
        return true;
    }
    if (falls_into(p->by_facets, &u[0])) {
        return facet_sample(&t->scene->paint[p->hit.paint].drawn, p->hit.normal, p->v, u, l);
    }
    if (falls_into(p->by_glints, &u[0])) {
        return glint_sample(&p->glints, u, l);
    }
    if (falls_into(p->by_aim, &u[0])) {
        *l = aim_sample(&p->seen, u);
    } else {
        u[0] = sampler_within(u[0], p->by_cosine);
        *l = draw_cosine(p->hit.normal, u);
    }
    return true;
}

static double density_of(const struct trace *t, const struct path_place *p, struct vec3 l) {
    double sum = p->by_cosine * vec3_dot(p->hit.normal, l) / M_PI;
    if (p->by_facets > 0) {
        sum += p->by_facets * facet_density(&t->scene->paint[p->hit.paint].drawn, p->hit.normal, p->v, l);
    }
    sum += p->by_gleams > 0 ? p->by_gleams * gleam_density(&p->gleams, l) : 0;
    sum += p->by_glints > 0 ? p->by_glints * glint_density(&p->glints, l) : 0;
    return sum + (p->by_aim > 0 ? p->by_aim * aim_density(&p->seen, l) : 0);
}

/* A direction l, and what is scattered from it over its density; false: nothing is. */
static bool scatter(const struct trace *t, const struct path_place *p, struct sampler *sampler,
                    struct vec3 *l, struct shade_abc *out, struct render_counts *counts) {
    const struct hit *hit = &p->hit;
    if (!draw(t, p, sampler, l) || !(vec3_dot(hit->normal, *l) > SHADE_GRAZING)) {
        return false;
    }
    *out = shade(PATH_FEATURES, &t->scene->paint[hit->paint].shade, NULL, hit->normal, *l, p->v);
    counts->negative_diffuse += out->a < 0;
    double weight = trace_energy(t, hit, *l, p->v) / (M_PI * density_of(t, p, *l));
    *out = (struct shade_abc){weight * fmax(out->a, 0), weight * out->b, weight * out->c};
    return out->a > 0 || out->c > 0;
}

/* The surface that a ray from `hit` along l meets from its front. */
static bool next_surface(const struct trace *t, const struct hit *hit, struct vec3 l, struct hit *next,
                         struct render_counts *counts) {
    struct ray ray = intersect_leave(t->scene, hit, l);
    counts->indirect_rays++;
    bool met = !shape_shadows_itself(&t->scene->shape[hit->shape], hit, l) &&
               intersect_nearest(t->scene, &ray, next) && vec3_dot(next->normal, l) < 0;
    counts->indirect_hits += met;
    return met;
}

/* Whether the path goes on; *scatter is weighted for the paths that do not. */
static bool goes_on(const struct trace *t, const struct path *path, double *carried,
                    struct shade_abc *scatter, int paint, struct sampler *sampler) {
    double s = t->energy[paint].s_max;
    *carried *= scatter->a * s + scatter->b * s * s + scatter->c;
    if (path->n < PATH_SURE || t->whole_paths) {
        return true;
    }
    double chance = fmin(PATH_GOES_ON, *carried);
    if (!(sampler_1d(sampler) < chance)) {
        return false;
    }
    *carried /= chance;
    *scatter = (struct shade_abc){scatter->a / chance, scatter->b / chance, scatter->c / chance};
    return true;
}

void path_find(const struct trace *t, const struct path_place *first, struct sampler *sampler,
               struct path *path, struct render_counts *counts) {
    struct path_place later;
    const struct path_place *p = first;
    int most = t->scene->image.bounces - 1;
    double carried = 1;
    for (path->n = 0; path->n < most;) {
        struct path_step *step = &path->step[path->n];
        struct hit next;
        struct vec3 l;
        bool more = scatter(t, p, sampler, &l, &step->scatter, counts) &&
                    goes_on(t, path, &carried, &step->scatter, p->hit.paint, sampler) &&
                    next_surface(t, &p->hit, l, &next, counts);
        if (!more) {
            return;
        }
        struct vec3 v = vec3_scale(l, -1);
        step->from = p->hit.paint;
        step->to = next.paint;
        memset(step->light, 0, (size_t)t->scene->n_spds * sizeof *step->light);
        trace_direct_at(t, &next, v, step->light, counts);
        trace_area_at(t, &next, v, sampler, step->light, counts);
        if (++path->n < most) {
            begin(t, &next, v, false, &later);
            p = &later;
        }
    }
}
