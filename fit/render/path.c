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

struct draws { /* of a direction, and how often each is taken; the rest by cosine */
    struct aim_view view;
    struct glint_view glints;
    double facets, flashes, aims;
};

static void find_draws(const struct trace *t, const struct hit *hit, double cos_r, struct draws *d) {
    aim_from(t->aim, hit, &d->view);
    d->facets = energy_share(&t->energy[hit->paint], cos_r);
    glint_from(t->glints, &d->view, &d->glints);
    d->flashes = d->glints.share * (1 - d->facets);
    d->aims = d->view.n_sectors > 0 ? PATH_AIMS * (1 - d->facets - d->flashes) : 0;
}

/* Takes as many numbers wherever it is. */
static bool draw(const struct trace *t, const struct draws *d, const struct hit *hit, struct vec3 v,
                 struct sampler *sampler, struct vec3 *l) {
    double choice[2], u[2];
    sampler_2d(sampler, choice);
    sampler_2d(sampler, u);
    if (choice[0] < d->facets) {
        return facet_sample(&t->scene->paint[hit->paint].drawn, hit->normal, v, u, l);
    }
    if (choice[0] < d->facets + d->flashes) {
        return glint_sample(&d->glints, choice[1], u, l);
    }
    if (choice[0] < d->facets + d->flashes + d->aims) {
        *l = aim_sample(&d->view, choice[1], u);
    } else {
        *l = draw_cosine(hit->normal, u);
    }
    return true;
}

static double density_of(const struct trace *t, const struct draws *d, const struct hit *hit, struct vec3 v,
                         struct vec3 l) {
    const struct shade_paint *drawn = &t->scene->paint[hit->paint].drawn;
    double sum = (1 - d->facets - d->flashes - d->aims) * vec3_dot(hit->normal, l) / M_PI;
    sum += d->facets > 0 ? d->facets * facet_density(drawn, hit->normal, v, l) : 0;
    sum += d->flashes > 0 ? d->flashes * glint_density(&d->glints, l) : 0;
    return sum + (d->aims > 0 ? d->aims * aim_density(&d->view, l) : 0);
}

/* A direction l, and what is scattered from it to v over its density; false: nothing is. */
static bool scatter(const struct trace *t, const struct hit *hit, struct vec3 v, struct sampler *sampler,
                    struct vec3 *l, struct shade_abc *out, struct render_counts *counts) {
    double cos_r = vec3_dot(hit->normal, v);
    struct draws d;
    find_draws(t, hit, cos_r, &d);
    if (!draw(t, &d, hit, v, sampler, l) || !(vec3_dot(hit->normal, *l) > SHADE_GRAZING)) {
        return false;
    }
    *out = shade(PATH_FEATURES, &t->scene->paint[hit->paint].shade, NULL, hit->normal, *l, v);
    counts->negative_diffuse += out->a < 0;
    double weight = trace_energy(t, hit, *l, v) / (M_PI * density_of(t, &d, hit, v, *l));
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
    if (path->n < PATH_SURE) {
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

void path_find(const struct trace *t, const struct hit *hit, struct vec3 v, struct sampler *sampler,
               struct path *path, struct render_counts *counts) {
    struct hit at = *hit, next;
    double carried = 1;
    for (path->n = 0; path->n < t->scene->image.bounces - 1;) {
        struct path_step *step = &path->step[path->n];
        struct vec3 l;
        bool more = scatter(t, &at, v, sampler, &l, &step->scatter, counts) &&
                    goes_on(t, path, &carried, &step->scatter, at.paint, sampler) &&
                    next_surface(t, &at, l, &next, counts);
        if (!more) {
            return;
        }
        step->from = at.paint;
        step->to = next.paint;
        v = vec3_scale(l, -1);
        at = next;
        memset(step->light, 0, (size_t)t->scene->n_spds * sizeof *step->light);
        trace_direct_at(t, &at, v, step->light, counts);
        trace_area_at(t, &at, v, sampler, step->light, counts);
        path->n++;
    }
}

static void carry_step(const struct path_step *step, const struct scene *scene, double *carried,
                       double (*spectrum)[BANDS]) {
    const double *from = scene->paint[step->from].s, *to = scene->paint[step->to].s;
    const struct shade_abc x = step->scatter;
    for (int k = 0; k < BANDS; k++) {
        carried[k] *= (x.b * from[k] + x.a) * from[k] + x.c;
    }
    for (int j = 0; j < scene->n_spds; j++) {
        const struct shade_abc d = step->light[j];
        for (int k = 0; k < BANDS && (d.a > 0 || d.c > 0); k++) {
            spectrum[j][k] += carried[k] * ((d.b * to[k] + d.a) * to[k] + d.c);
        }
    }
}

void path_carry(const struct path *path, const struct scene *scene, double part, double (*spectrum)[BANDS]) {
    double carried[BANDS];
    for (int k = 0; k < BANDS; k++) {
        carried[k] = part;
    }
    for (int i = 0; i < path->n; i++) {
        carry_step(&path->step[i], scene, carried, spectrum);
    }
}
