#include "fit/render/render.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

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
static struct energy *prepare_energies(const struct scene *scene, const struct scene *steady) {
    struct energy *energy = calloc(SCENE_PAINTS, sizeof *energy);
    for (int p = 0; p < scene->n_paints && energy; p++) {
        energy_make(&energy[p], &(steady ? steady : scene)->paint[p],
                    (enum energy_policy)scene->image.energy);
    }
    return energy;
}

/* Y of a, b and c, and of a spectrum, for the noise of what is drawn. */
static int prepare_y(const struct scene *scene, struct trace_y *y, struct err *e) {
    enum colour_observer observer = (enum colour_observer)scene->image.observer;
    int status = 0;
    for (int j = 0; j < scene->n_spds && !status; j++) {
        double scaled[BANDS];
        for (int p = 0; p < scene->n_paints && !status; p++) {
            struct colour_matrix m;
            status = colour_collapse(scene->paint[p].s, scene->spd[j].power, observer, &m, e);
            memcpy(y->abc[p][j], m.m[1], sizeof y->abc[p][j]);
        }
        colour_scale_power(scene->spd[j].power, observer, scaled);
        for (int k = 0; k < BANDS; k++) {
            y->band[j][k] = scaled[k] * colour_cmf(observer)[k][1];
        }
    }
    return status;
}

/* asked: facets wherever there is a lobe. */
static void prepare_random(struct trace *t, bool facets, bool asked) {
    const struct scene *scene = t->scene;
    int rays = scene->image.grid * scene->image.grid, each = TRACE_GROUPS * rays;
    t->repeats = TRACE_GROUPS * ((scene->image.samples + each - 1) / each);
    for (int i = 0; i < scene->n_paints * scene->n_lights && facets; i++) {
        int p = i / scene->n_lights, light = i % scene->n_lights;
        t->facets[p][light] = asked || features_facets(scene, p, light).drawn;
    }
}

struct parts { /* of one rendering, beside its planes */
    struct trace trace, beyond;
    struct trace_y *y;
    struct energy *energy;
    struct aim *aim;
    struct glints *glints;
    bool random, paths;
};

static int prepare(struct parts *x, const struct render_options *options, const struct features *f,
                   struct err *e) {
    const struct scene *scene = x->trace.scene;
    bool asked = options->all_features || options->keep >> FEATURE_FACETS & 1;
    x->paths = kept(f, FEATURE_INTERREFLECTION) && scene->image.bounces > 1;
    x->random = x->paths || kept(f, FEATURE_RANDOM);
    x->trace.half = calloc(SCENE_PAINTS, sizeof *x->trace.half);
    x->y = x->random ? calloc(1, sizeof *x->y) : NULL;
    x->energy = x->paths ? prepare_energies(scene, options->steady) : NULL;
    x->aim = x->paths ? calloc(1, sizeof *x->aim) : NULL;
    x->glints = x->paths ? calloc(1, sizeof *x->glints) : NULL;
    if (!x->trace.half || (x->random && !x->y) || (x->paths && !(x->energy && x->aim && x->glints))) {
        return err_set(e, ERR_NOMEM, "no memory to render");
    }
    prepare_halves(&x->trace);
    if (x->random) {
        prepare_random(&x->trace, kept(f, FEATURE_FACETS), asked);
        x->trace.y = x->y;
    }
    x->beyond = x->trace;
    x->beyond.shade_features = PATH_FEATURES;
    x->beyond.whole_paths = options->steady;
    x->beyond.energy = x->energy;
    x->beyond.aim = x->aim;
    x->beyond.glints = x->glints;
    if (x->paths) {
        aim_make(x->aim, scene);
        glint_make(x->glints, scene, x->aim, x->energy);
    }
    x->trace.beyond = x->paths ? &x->beyond : NULL;
    return x->random ? prepare_y(scene, x->y, e) : 0;
}

/* Without room for them hits are met anew. */
static void prepare_hits(struct trace *t, struct render_hits *hits) {
    const struct scene_image *image = &t->scene->image;
    size_t n = (size_t)image->width * (size_t)image->height * (size_t)(image->grid * image->grid);
    if (hits->n != n) {
        render_hits_free(hits);
        hits->hit = n * sizeof *hits->hit <= FEATURES_HITS_MAX ? malloc(n * sizeof *hits->hit) : NULL;
        hits->n = hits->hit ? n : 0;
    }
    t->hits = hits->hit ? hits : NULL;
}

void render_hits_free(struct render_hits *hits) {
    free(hits->hit);
    *hits = (struct render_hits){0};
}

static int make_planes(const struct parts *x, struct planes *planes, struct err *e) {
    const struct scene *scene = x->trace.scene;
    unsigned shade_features = x->trace.shade_features;
    int status = planes_make(planes, scene->image.width, scene->image.height, scene->n_spds,
                             shade_features & SHADE_SIGMA, shade_features & SHADE_SPECULAR, e);
    status = status || !x->random ? status : planes_add_noise(planes, e);
    return status || !x->paths ? status : planes_add_indirect(planes, e);
}

static double noise_y(const struct planes *p) {
    size_t n = 0;
    double sum = 0;
    for (size_t i = 0; i < (size_t)p->width * (size_t)p->height && p->noise; i++) {
        if (p->paint[i] >= 0) {
            sum += p->noise[i];
            n++;
        }
    }
    return n ? sqrt(sum / (double)n) : 0;
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
    struct parts x = {.trace = {.scene = scene,
                                .shade_features = shade_mask(&report->features),
                                .shadow_rays = kept(&report->features, FEATURE_SHADOW_RAYS),
                                .dark_lights = kept(&report->features, FEATURE_LIGHTS)}};
    *planes = (struct planes){0};
    if (own.hits && !own.all_features && !(own.keep >> FEATURE_EACH_PICTURE & 1)) {
        prepare_hits(&x.trace, own.hits);
    }
    int status = prepare(&x, &own, &report->features, e);
    status = status ? status : make_planes(&x, planes, e);
    trace_integrator *integrator = x.paths ? trace_path : x.random ? trace_area : trace_direct;
    status = status ? status : trace_run(&x.trace, integrator, &own, planes, &report->counts, e);
    if (x.trace.hits) {
        own.hits->known = !status && report->counts.rows_done == planes->height;
    }
    report->samples = x.trace.repeats * scene->image.grid * scene->image.grid;
    report->noise_y = status ? 0 : noise_y(planes);
    free(x.trace.half);
    free(x.y);
    free(x.energy);
    free(x.aim);
    free(x.glints);
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
