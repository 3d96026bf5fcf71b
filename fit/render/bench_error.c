#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/reflectance.h"
#include "fit/render/bench.h"
#include "fit/render/trace.h"
#include "proto/units.h"

struct sampling { /* the samples of one half in one pixel */
    const struct trace *trace;
    int columns, rows; /* of jittered cells */
    unsigned short dice[3];
};

/* The mean of a, b, c; whether some sample met the object, and some did not or met it in shadow. */
static unsigned char sample_pixel(struct sampling *s, int x, int y, struct shade_abc *mean) {
    struct render_counts unused = {0};
    int lit = 0, met = 0, all = s->columns * s->rows;
    *mean = (struct shade_abc){0, 0, 0};
    for (int i = 0; i < all; i++) {
        struct trace_sample sample;
        double u = (i % s->columns + erand48(s->dice)) / s->columns;
        double v = (i / s->columns + erand48(s->dice)) / s->rows;
        struct ray ray = camera_ray(&s->trace->scene->camera, x + u, y + v);
        trace_direct(s->trace, &ray, &sample, &unused);
        if (sample.paint >= 0) {
            met++;
            lit += sample.set[0].a > 0;
            mean->a += sample.set[0].a / all;
            mean->b += sample.set[0].b / all;
            mean->c += sample.set[0].c / all;
        }
    }
    return (unsigned char)((met > 0) | ((met > 0 && lit < all && lit > 0) || (met > 0 && met < all)) << 1);
}

static int fill_half(const struct trace *trace, int grid, int half, struct bench_reference *r,
                     struct err *e) {
    const struct scene *scene = trace->scene;
    struct planes planes;
    int status = planes_make(&planes, scene->image.width, scene->image.height, 1, true, true, e);
    for (int y = 0; y < planes.height && !status; y++) {
        struct sampling s = {trace, grid, grid / 2, {(unsigned short)y, (unsigned short)(half + 1), 77}};
        for (int x = 0; x < planes.width; x++) {
            size_t i = (size_t)y * (size_t)planes.width + (size_t)x;
            struct shade_abc mean;
            unsigned char shown = sample_pixel(&s, x, y, &mean);
            r->shown[i] |= shown;
            planes.paint[i] = shown & 1 ? 0 : -1;
            planes.set[0].a[i] = mean.a;
            planes.set[0].b[i] = mean.b;
            planes.set[0].c[i] = mean.c;
        }
    }
    status = status ? status : render_xyz(scene, &planes, true, r->half[half], e);
    planes_free(&planes);
    return status;
}

static int make_reference(const struct scene *scene, int grid, struct bench_reference *r, struct err *e) {
    struct shade_half(*half)[SCENE_LIGHTS] = calloc(SCENE_PAINTS, sizeof *half);
    struct trace trace = {.scene = scene,
                          .shadow_rays = true,
                          .dark_lights = true,
                          .half = half,
                          .shade_features = SHADE_SIGMA | SHADE_SPECULAR | SHADE_RELATIVES};
    int status =
        half ? bench_reference_make(r, scene, e) : err_set(e, ERR_NOMEM, "no memory for a reference");
    status = status ? status : fill_half(&trace, grid, 0, r, e);
    status = status ? status : fill_half(&trace, grid, 1, r, e);
    free(half);
    return status;
}

/* a, b and c of one hit again by fit/reflectance.h, from angles instead of vectors. */
static double model_difference(const struct scene *scene, const struct hit *hit, struct vec3 l, struct vec3 v,
                               const struct shade_abc *got) {
    const struct estimate *m = &scene->paint[hit->paint].estimate;
    double ci = vec3_dot(hit->normal, l), cr = vec3_dot(hit->normal, v), value[MATERIAL_PARAMETERS];
    struct vec3 across_l = vec3_sub(l, vec3_scale(hit->normal, ci)),
                across_v = vec3_sub(v, vec3_scale(hit->normal, cr));
    double dphi = atan2(vec3_length(vec3_cross(across_l, across_v)), vec3_dot(across_l, across_v));
    struct reflectance_optics optics = {.kappa = m->kappa, .q = 1};
    struct reflectance_geometry g;
    struct reflectance_parts parts;
    enum reflectance_model model;
    memcpy(value, m->value, sizeof value);
    value[MATERIAL_S] = 1;
    bool evaluated =
        ci > 0.02 && cr > 0.02 && reflectance_find(m->model, &model, NULL) == 0 &&
        reflectance_geometry_general(&g, deg_from_rad(acos(fmin(ci, 1))), deg_from_rad(acos(fmin(cr, 1))),
                                     deg_from_rad(dphi), NULL) == 0 &&
        reflectance_eval_parts(model, &g, value, &optics, &parts, NULL) == 0;
    if (!evaluated) {
        return 0;
    }
    double a = fabs(got->a - fmax(0, ci * parts.diffuse)), b = fabs(got->b - ci * parts.interreflection);
    return fmax(fmax(a, b), fabs(got->c - ci * parts.specular) / (1 + ci * parts.specular));
}

static double model_apart(const struct scene *scene, const struct planes *planes) {
    double apart = 0;
    for (int i = 0; i < planes->width * planes->height; i++) {
        struct ray ray = camera_ray(&scene->camera, i % planes->width + 0.5, i / planes->width + 0.5);
        struct hit hit = {.t_mm = INFINITY};
        if (planes->paint[i] >= 0 && shape_hit(&scene->shape[0], &ray, &hit)) {
            struct shade_abc got = {planes->set[0].a[i], planes->set[0].b[i], planes->set[0].c[i]};
            apart = fmax(apart, model_difference(scene, &hit, scene->light[0].direction,
                                                 vec3_scale(ray.direction, -1), &got));
        }
    }
    return apart;
}

/* Nothing left out: what is compared is the formula. */
static int compare_model(struct scene *scene, struct bench_errors *errors, struct err *e) {
    struct planes planes;
    struct render_report report = {0};
    int status = render_planes(scene, &(struct render_options){.threads = 1, .all_features = true}, &planes,
                               &report, e);
    if (!status) {
        errors->model_apart = model_apart(scene, &planes);
        planes_free(&planes);
    }
    return status;
}

static int error_row(struct scene *scene, const struct bench_reference *reference, int grid,
                     struct bench_error *row, struct err *e) {
    struct planes planes;
    struct render_report report = {0};
    double *xyz = malloc(3 * (size_t)reference->n * sizeof *xyz), white[3];
    scene->image.grid = grid;
    row->samples = grid * grid;
    int status = xyz ? 0 : err_set(e, ERR_NOMEM, "no memory to compare");
    status = status ? status : colour_white(scene->spd[0].power, COLOUR_2DEG, white, e);
    status =
        status ? status : render_planes(scene, &(struct render_options){.threads = 1}, &planes, &report, e);
    if (!status) {
        row->trace_s = report.trace_cpu_s;
        status = render_xyz(scene, &planes, false, xyz, e);
        status = status ? status : bench_compare(reference, xyz, white, row, e);
        planes_free(&planes);
    }
    free(xyz);
    return status;
}

int bench_error_run(const char *folder, const struct bench_scene *s, const struct bench_size *size,
                    struct bench_errors *errors, struct err *e) {
    char path[512];
    struct err_list list = {0};
    struct bench_reference reference = {0};
    *errors = (struct bench_errors){0};
    int status = bench_write_scene(folder, s, size->error_pixels, 1, path, e);
    struct scene *scene = status ? NULL : scene_read(path, NULL, 0, &list);
    err_list_free(&list);
    if (!scene) {
        return status ? status : err_set(e, ERR_INPUT, "the scene %s cannot be read back", path);
    }
    status = compare_model(scene, errors, e);
    status = status ? status : make_reference(scene, size->reference_grid, &reference, e);
    for (int i = 0; i < BENCH_GRIDS && !status; i++) {
        status = error_row(scene, &reference, 1 << i, &errors->row[i], e);
    }
    if (!status) {
        errors->reference_rmse = bench_floor(&reference);
        errors->slope = bench_slope(errors->row, BENCH_GRIDS);
    }
    bench_reference_free(&reference);
    scene_free(scene);
    return status;
}
