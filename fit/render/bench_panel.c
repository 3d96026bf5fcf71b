#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/reflectance.h"
#include "fit/render/bench.h"
#include "fit/render/trace.h"
#include "fit/stopwatch.h"
#include "proto/units.h"

/* A panel of 100 mm that mirrors a light of 60 mm, 89 mm away, to the camera. */
#define SIDE_MM 100.0
#define LIGHT_MM 60.0

static const struct vec3 light_at = {0, 40, 80}, light_x = {1, 0, 0};

/* rendering.md 4.3: the published sets, and lobes that the light alone can miss. */
const struct bench_panel bench_panel[] = {
    {"g .05 126", .35, .05, 126, 1.40},         {"g .2 15.7", .2, .2, 15.7, 1.70},
    {"g .08 1.6", .5, .08, 1.6, 2.42},          {"g .01 3000", .35, .01, 3000, 1.40},
    {"g .001 315000", .35, .001, 315000, 1.40},
};
const int bench_panels = sizeof bench_panel / sizeof *bench_panel;

static int write_scene(const char *folder, const struct bench_panel *s, int pixels, char path[512],
                       struct err *e) {
    snprintf(path, 512, "%s/panel.yaml", folder);
    FILE *file = fopen(path, "w");
    if (!file) {
        return err_errno(e, ERR_IO, errno, "%s cannot be written", path);
    }
    fprintf(file,
            "materials: [{name: m, spectrum: s.csv, sigma: %g, gamma: %g, beta_prime: %g, n: %g}]\n"
            "shapes: [rectangle: {material: m, width_mm: %g, height_mm: %g}]\n"
            "lights: [rectangle: {at_mm: [%g, %g, %g], width_mm: %g, height_mm: %g}]\n"
            "camera: {orthographic: {height_mm: %g, from: [0, -0.5, 1]}}\n"
            "image: {width: %d, height: %d, grid: 1}\n",
            s->sigma, s->gamma, s->beta_prime, s->n, SIDE_MM, SIDE_MM, light_at.x, light_at.y, light_at.z,
            LIGHT_MM, LIGHT_MM, 0.85 * SIDE_MM, pixels, pixels);
    return fclose(file) == 0 ? 0 : err_errno(e, ERR_IO, errno, "%s cannot be written", path);
}

/* The reference: its own light, lobe and numbers, the model by fit/reflectance.h from angles. */
struct judge {
    struct vec3 z, y; /* where the light shines; along its height */
    double radiance, k, mass, value[MATERIAL_PARAMETERS];
    struct reflectance_optics optics;
    enum reflectance_model model;
    unsigned short dice[3];
};

static struct vec3 on_light(const struct judge *j, double u, double v) {
    return vec3_add(light_at, vec3_add(vec3_scale(light_x, (u - 0.5) * LIGHT_MM),
                                       vec3_scale(j->y, (v - 0.5) * LIGHT_MM)));
}

/* Towards a point of the light; its density per solid angle where points are even over the area. */
static struct vec3 towards(const struct judge *j, struct vec3 from, struct vec3 point, double *density) {
    struct vec3 way = vec3_sub(point, from);
    double d2 = vec3_dot(way, way);
    *density = d2 * sqrt(d2) / (-vec3_dot(way, j->z) * LIGHT_MM * LIGHT_MM);
    return vec3_unit(way);
}

/* Whether the light is met along l, and that density there. */
static bool meets(const struct judge *j, struct vec3 from, struct vec3 l, double *density) {
    double t = vec3_dot(vec3_sub(light_at, from), j->z) / vec3_dot(l, j->z);
    struct vec3 off = vec3_sub(vec3_add(from, vec3_scale(l, t)), light_at);
    towards(j, from, vec3_add(light_at, off), density);
    return t > 0 && fabs(vec3_dot(off, light_x)) < LIGHT_MM / 2 && fabs(vec3_dot(off, j->y)) < LIGHT_MM / 2;
}

/* So that the perfect diffuser at the origin has Y = 1: the length of the sum of L cos(theta_l) l / d^2, by midpoints. */
static double radiance_of(const struct judge *j) {
    enum { N = 500 };
    struct vec3 sum = {0, 0, 0};
    for (int i = 0; i < N * N; i++) {
        double density;
        struct vec3 l =
            towards(j, (struct vec3){0, 0, 0}, on_light(j, (i % N + 0.5) / N, (i / N + 0.5) / N), &density);
        sum = vec3_add(sum, vec3_scale(l, 1 / (density * N * N)));
    }
    return M_PI / vec3_length(sum);
}

static int set_up(struct judge *j, const struct scene *scene, int half, struct err *e) {
    const struct estimate *m = &scene->paint[0].estimate;
    j->z = vec3_scale(vec3_unit(light_at), -1);
    j->y = vec3_cross(j->z, light_x);
    j->radiance = radiance_of(j);
    j->k = M_LN2 / (m->value[MATERIAL_GAMMA] * m->value[MATERIAL_GAMMA]);
    j->mass = -expm1(-j->k * M_PI * M_PI / 4);
    memcpy(j->value, m->value, sizeof j->value);
    j->value[MATERIAL_S] = 1;
    j->optics = (struct reflectance_optics){.kappa = m->kappa, .q = 1};
    memcpy(j->dice, (unsigned short[]){3, (unsigned short)(half + 1), 99}, sizeof j->dice);
    return reflectance_find(m->model, &j->model, e);
}

static struct vec3 draw_facet(const struct judge *j, struct vec3 v, double u, double azimuth) {
    double phi = sqrt(-log1p(-u * j->mass) / j->k);
    struct vec3 h = {sin(phi) * cos(azimuth), sin(phi) * sin(azimuth), cos(phi)};
    return vec3_sub(vec3_scale(h, 2 * vec3_dot(v, h)), v);
}

static double facet_density_of(const struct judge *j, struct vec3 v, struct vec3 l) {
    struct vec3 h = vec3_unit(vec3_add(v, l));
    double sine = hypot(h.x, h.y), phi = atan2(sine, h.z);
    double density = j->k * exp(-j->k * phi * phi) / (M_PI * j->mass) * (sine > 0 ? phi / sine : 1);
    return density / (4 * vec3_dot(v, h));
}

static struct shade_abc model_at(const struct judge *j, struct vec3 v, struct vec3 l) {
    struct reflectance_geometry g;
    struct reflectance_parts parts;
    double dphi = atan2(fabs(l.x * v.y - l.y * v.x), l.x * v.x + l.y * v.y);
    if (l.z <= 0 ||
        reflectance_geometry_general(&g, deg_from_rad(atan2(hypot(l.x, l.y), l.z)),
                                     deg_from_rad(atan2(hypot(v.x, v.y), v.z)), deg_from_rad(dphi), NULL) ||
        reflectance_eval_parts(j->model, &g, j->value, &j->optics, &parts, NULL)) {
        return (struct shade_abc){0, 0, 0};
    }
    return (struct shade_abc){l.z * parts.diffuse, l.z * parts.interreflection, l.z * parts.specular};
}

static struct shade_abc judge_point(struct judge *j, struct vec3 from, struct vec3 v, int columns, int rows) {
    struct shade_abc sum = {0, 0, 0};
    int n = columns * rows;
    for (int i = 0; i < n; i++) {
        double power = j->radiance / M_PI / n, density;
        struct vec3 point =
            on_light(j, (i % columns + erand48(j->dice)) / columns, (i / columns + erand48(j->dice)) / rows);
        struct vec3 l = towards(j, from, point, &density);
        struct shade_abc x = model_at(j, v, l);
        sum.a += x.a * power / density;
        sum.b += x.b * power / density;
        sum.c += x.c * power / (density + facet_density_of(j, v, l));
        l = draw_facet(j, v, (i % columns + erand48(j->dice)) / columns,
                       2 * M_PI * (i / columns + erand48(j->dice)) / rows);
        if (meets(j, from, l, &density)) {
            sum.c += model_at(j, v, l).c * power / (density + facet_density_of(j, v, l));
        }
    }
    return sum;
}

static int judge_half(const struct scene *scene, int half, int grid, struct bench_reference *r,
                      struct err *e) {
    struct judge j;
    struct planes planes;
    int status = set_up(&j, scene, half, e);
    status =
        status ? status : planes_make(&planes, scene->image.width, scene->image.height, 1, true, true, e);
    for (int i = 0; i < r->n && !status; i++) {
        struct ray ray = camera_ray(&scene->camera, i % planes.width + 0.5, i / planes.width + 0.5);
        struct vec3 from = vec3_sub(ray.origin, vec3_scale(ray.direction, ray.origin.z / ray.direction.z));
        bool met = fabs(from.x) < SIDE_MM / 2 && fabs(from.y) < SIDE_MM / 2;
        r->shown[i] = met;
        if (met) {
            struct shade_abc x = judge_point(&j, from, vec3_scale(ray.direction, -1), grid, grid / 2);
            planes.paint[i] = 0;
            planes.set[0].a[i] = x.a;
            planes.set[0].b[i] = x.b;
            planes.set[0].c[i] = x.c;
        }
    }
    if (!status) {
        status = render_xyz(scene, &planes, true, r->half[half], e);
        planes_free(&planes);
    }
    return status;
}

static int judge_all(const struct scene *scene, int grid, struct bench_reference *r, struct err *e) {
    int status = bench_reference_make(r, scene, e);
    status = status ? status : judge_half(scene, 0, grid, r, e);
    return status ? status : judge_half(scene, 1, grid, r, e);
}

/* One estimator with so many samples, whatever the scene would choose. */
static int run_one(const struct scene *scene, bool facets, const struct bench_reference *r,
                   struct bench_error *out, struct err *e) {
    double white[3], started = stopwatch_cpu_s(), *xyz = malloc(3 * (size_t)r->n * sizeof *xyz);
    struct trace_y *y = calloc(1, sizeof *y);
    struct trace trace = {.scene = scene,
                          .shade_features = SHADE_SIGMA | SHADE_SPECULAR,
                          .repeats = out->samples,
                          .facets = {{facets}},
                          .y = y};
    struct planes planes = {0};
    struct render_counts counts;
    int status = xyz && y ? 0 : err_set(e, ERR_NOMEM, "no memory to compare");
    status =
        status ? status : planes_make(&planes, scene->image.width, scene->image.height, 1, true, true, e);
    status = status
                 ? status
                 : trace_run(&trace, trace_area, &(struct render_options){.threads = 1}, &planes, &counts, e);
    out->trace_s = stopwatch_cpu_s() - started;
    status = status ? status : render_xyz(scene, &planes, false, xyz, e);
    status = status ? status : colour_white(scene->spd[0].power, COLOUR_2DEG, white, e);
    status = status ? status : bench_compare(r, xyz, white, out, e);
    planes_free(&planes);
    free(xyz);
    free(y);
    return status;
}

int bench_panel_run(const char *folder, const struct bench_panel *s, const struct bench_size *size,
                    struct bench_panel_errors *out, struct err *e) {
    struct bench_reference r = {0};
    struct err_list errors = {0};
    char path[512];
    int status = write_scene(folder, s, size->panel_pixels, path, e);
    struct scene *scene = status ? NULL : scene_read(path, NULL, 0, &errors);
    if (!scene) {
        status = status ? status : err_set(e, ERR_INPUT, "%s", errors.item[0].text);
        err_list_free(&errors);
        return status;
    }
    *out = (struct bench_panel_errors){.chosen = features_facets(scene, 0, 0).drawn};
    status = judge_all(scene, size->reference_grid, &r, e);
    for (int i = 0; i < 2 * BENCH_GRIDS && !status; i++) {
        struct bench_error *row = &out->by[i / BENCH_GRIDS].row[i % BENCH_GRIDS];
        row->samples = TRACE_GROUPS << 2 * (i % BENCH_GRIDS);
        status = run_one(scene, i >= BENCH_GRIDS, &r, row, e);
    }
    for (int k = 0; k < 2 && !status; k++) {
        out->by[k].reference_rmse = bench_floor(&r);
        out->by[k].slope = bench_slope(out->by[k].row, BENCH_GRIDS);
    }
    bench_reference_free(&r);
    scene_free(scene);
    return status;
}
