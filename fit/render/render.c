#include "fit/render/render.h"

#include <stdlib.h>

#include "fit/render/crew.h"
#include "fit/render/path.h"
#include "fit/render/trace.h"
#include "fit/stopwatch.h"

static bool kept(const struct features *f, enum feature feature) {
    return f->line[feature].kept;
}

static unsigned shade_mask(const struct features *f) {
    bool hoisted = !kept(f, FEATURE_EACH_DIRECTION), specular = kept(f, FEATURE_SPECULAR);
    return (kept(f, FEATURE_RELATIVES) ? SHADE_RELATIVES : 0) | (kept(f, FEATURE_SIGMA) ? SHADE_SIGMA : 0) |
           (specular ? SHADE_SPECULAR : 0) |
           (hoisted && (specular || kept(f, FEATURE_SIGMA)) ? SHADE_HOISTED : 0) |
           (hoisted && specular && !kept(f, FEATURE_LOBE_TAIL) ? SHADE_LOBE_CUT : 0);
}

/* What parallel light, seen by a parallel camera, has in common for all points. */
static void prepare_halves(struct trace *t) {
    const struct scene *scene = t->scene;
    struct vec3 v = vec3_scale(scene->camera.forward, -1);
    for (int p = 0; p < scene->n_paints; p++) {
        for (int i = 0; i < scene->n_lights; i++) {
            const struct light *light = &scene->light[i];
            t->half[p][i] = shade_half(&scene->paint[p].shade, light->direction, v);
            if (t->shade_features & SHADE_LOBE_CUT) {
                t->half[p][i].cut = features_lobe_cut(scene, &scene->paint[p], light);
            }
        }
    }
}

/* NULL: no memory. */
static struct energy *prepare_energies(const struct scene *scene) {
    struct energy *energy = calloc(SCENE_PAINTS, sizeof *energy);
    for (int p = 0; p < scene->n_paints && energy; p++) {
        energy_make(&energy[p], &scene->paint[p], (enum energy_policy)scene->image.energy);
    }
    return energy;
}

int render_planes(const struct scene *scene, const struct render_options *options, struct planes *planes,
                  struct render_report *report, struct err *e) {
    struct render_options own = *options;
    double started = stopwatch_s(), cpu = stopwatch_cpu_s();
    own.threads = crew_threads(own.threads);
    features_find(scene, own.all_features, &report->features);
    for (int i = 0; i < FEATURES; i++) {
        if (own.keep >> i & 1) {
            report->features.line[i] = (struct feature_line){true, 0, "asked for"};
        }
    }
    struct trace trace = {.scene = scene,
                          .shade_features = shade_mask(&report->features),
                          .shadow_rays = kept(&report->features, FEATURE_SHADOW_RAYS),
                          .dark_lights = kept(&report->features, FEATURE_LIGHTS),
                          .half = calloc(SCENE_PAINTS, sizeof *trace.half)};
    bool paths = kept(&report->features, FEATURE_INTERREFLECTION) && scene->image.bounces > 1;
    struct energy *energy = paths ? prepare_energies(scene) : NULL;
    if (!trace.half || (paths && !energy)) {
        free(trace.half);
        return err_set(e, ERR_NOMEM, "no memory to render");
    }
    trace.repeats = 4;
    struct trace beyond = trace;
    beyond.shade_features = PATH_FEATURES;
    beyond.energy = energy;
    trace.beyond = paths ? &beyond : NULL;
    prepare_halves(&trace);
    int status = planes_make(planes, scene->image.width, scene->image.height, scene->n_spds,
                             trace.shade_features & SHADE_SIGMA, trace.shade_features & SHADE_SPECULAR, e);
    status = status || !paths ? status : planes_add_indirect(planes, e);
    status = status ? status
                    : trace_run(&trace, paths ? trace_path : trace_direct, &own, planes, &report->counts, e);
    free(trace.half);
    free(energy);
    report->threads = own.threads;
    report->trace_s = stopwatch_s() - started;
    report->trace_cpu_s = stopwatch_cpu_s() - cpu;
    if (!status && report->counts.rows_done == 0) {
        status = err_set(e, ERR_CANCELLED, "cancelled before a single row was done");
    }
    if (status) {
        planes_free(planes);
    }
    return status;
}

int render_whole(const struct scene *scene, const struct render_options *options, struct planes *planes,
                 struct render_report *report, struct err *e) {
    int status = render_planes(scene, options, planes, report, e);
    if (!status && report->counts.rows_done < planes->height) {
        planes_free(planes);
        status = err_set(e, ERR_CANCELLED, "interrupted; nothing was written");
    }
    return status;
}
