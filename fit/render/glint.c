#include "fit/render/glint.h"

#include "fit/render/facet.h"
#include "fit/render/sampler.h"

#define MOST 0.5 /* of the draws: other light is not to be starved */

static bool direction_of(const struct light *light, struct vec3 from, struct vec3 *l) {
    struct vec3 middle = {light->at_mm[0], light->at_mm[1], light->at_mm[2]};
    *l = light->kind == LIGHT_BEAM ? light->direction : vec3_unit(vec3_sub(middle, from));
    return light->kind != LIGHT_ENVIRONMENT && light->share > 0;
}

static void add_glint(struct glints *glints, const struct scene *scene, const struct aim_target *target,
                      int index, const struct light *light, const struct energy *energy) {
    struct glint g = {.target = index,
                      .shape = target,
                      .drawn = &scene->paint[target->paint].drawn,
                      .normal = vec3_unit(vec3_cross(target->u, target->v)),
                      .energy = &energy[target->paint],
                      .light = light->share};
    bool shines = direction_of(light, target->middle, &g.l) && vec3_dot(g.l, g.normal) > 0;
    g.share = shines ? energy_share(&energy[target->paint], vec3_dot(g.l, g.normal)) : 0;
    if (g.share > 0 && glints->n < GLINTS) {
        glints->glint[glints->n++] = g;
    }
}

void glint_make(struct glints *glints, const struct scene *scene, const struct aim *aim,
                const struct energy *energy) {
    glints->n = 0;
    for (int i = 0; i < aim->n * scene->n_lights; i++) {
        int target = i / scene->n_lights;
        const struct aim_target *t = &aim->target[target];
        if (t->flat && t->paint >= 0) {
            add_glint(glints, scene, t, target, &scene->light[i % scene->n_lights], energy);
        }
    }
}

void glint_from(const struct glints *glints, const struct aim_view *seen, struct glint_view *view) {
    view->n = 0;
    view->sum = 0;
    for (int i = 0; i < glints->n; i++) {
        bool is_seen = false;
        for (int k = 0; k < seen->n_sectors; k++) {
            is_seen = is_seen || seen->target[k] == glints->glint[i].target;
        }
        if (is_seen) {
            view->glint[view->n++] = &glints->glint[i];
            view->sum += glints->glint[i].share;
        }
    }
    view->share = shade_least(view->sum, MOST);
}

bool glint_sample(const struct glint_view *view, const double u[2], struct vec3 *l) {
    double rest = u[0] * view->sum;
    int i = 0;
    while (i + 1 < view->n && rest >= view->glint[i]->share) {
        rest -= view->glint[i++]->share;
    }
    const struct glint *g = view->glint[i];
    const double own[2] = {sampler_within(rest, g->share), u[1]};
    struct vec3 o;
    bool drawn = facet_sample(g->drawn, g->normal, g->l, own, &o);
    *l = vec3_scale(o, -1);
    return drawn;
}

double glint_density(const struct glint_view *view, struct vec3 l) {
    double sum = 0;
    for (int i = 0; i < view->n; i++) {
        const struct glint *g = view->glint[i];
        sum += g->share * facet_density(g->drawn, g->normal, g->l, vec3_scale(l, -1));
    }
    return view->n > 0 ? sum / view->sum : 0;
}
