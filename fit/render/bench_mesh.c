#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/bench.h"
#include "fit/render/crew.h"
#include "fit/render/embree.h"
#include "fit/render/exr.h"
#include "fit/render/intersect.h"
#include "fit/render/mesh.h"
#include "fit/render/path.h"
#include "fit/stopwatch.h"

#define COLUMNS 32 /* of the surroundings */
#define ROWS 16
#define RINGS 48 /* of the body: 2 RINGS corners around */
#define RADIUS_MM 20
#define SAMPLES 4 /* rows of the table: 4, 16, 64, 256 */

/* --- a body with bulges that stand in each other's light, as PLY, and a sky with a window ---------------- */

static struct vec3 body(double down, double around) {
    double theta = M_PI * down, phi = 2 * M_PI * around;
    double r = RADIUS_MM * (1 + 0.25 * sin(5 * phi) * pow(sin(theta), 3) + 0.1 * cos(6 * theta));
    return (struct vec3){r * sin(theta) * sin(phi), r * cos(theta), r * sin(theta) * cos(phi)};
}

static struct vec3 body_normal(double down, double around) {
    double step = 1e-5;
    struct vec3 south = vec3_sub(body(down + step, around), body(down - step, around));
    return vec3_unit(vec3_cross(south, vec3_sub(body(down, around + step), body(down, around - step))));
}

static void put(FILE *file, struct vec3 v) {
    float values[3] = {(float)v.x, (float)v.y, (float)v.z};
    fwrite(values, sizeof values, 1, file);
}

static int write_body(const char *folder, int rings, struct err *e) {
    char path[512];
    uint32_t n = 2 * (uint32_t)rings;
    snprintf(path, sizeof path, "%s/body.ply", folder);
    FILE *file = fopen(path, "wb");
    if (!file) {
        return err_errno(e, ERR_IO, errno, "%s cannot be written", path);
    }
    fprintf(file,
            "ply\nformat binary_little_endian 1.0\nelement vertex %u\nproperty float x\nproperty float y\n"
            "property float z\nproperty float nx\nproperty float ny\nproperty float nz\nelement face %u\n"
            "property list uchar uint vertex_indices\nend_header\n",
            n * (uint32_t)rings, n * (uint32_t)(rings - 1));
    for (int i = 0; i < rings; i++) {
        for (uint32_t k = 0; k < n; k++) {
            double down = i / (rings - 1.0), around = (double)k / n;
            put(file, body(down, around));
            put(file, body_normal(fmin(fmax(down, 1e-3), 1 - 1e-3), around)); /* the poles have all */
        }
    }
    for (uint32_t i = 0; i + 1 < (uint32_t)rings; i++) {
        for (uint32_t k = 0; k < n; k++) {
            uint32_t a = i * n + k, b = i * n + (k + 1) % n, corner[4] = {a, a + n, b + n, b};
            fputc(4, file);
            fwrite(corner, sizeof corner, 1, file);
        }
    }
    return fclose(file) == 0 ? 0 : err_errno(e, ERR_IO, errno, "%s cannot be written", path);
}

/* Brighter above, and a window of 3 x 3 texels on the left, a hundred times as bright. */
static void fill_sky(void *arg, int y, float *const *row) {
    (void)arg;
    for (int x = 0; x < COLUMNS; x++) {
        bool window = x >= 22 && x < 25 && y >= 4 && y < 7;
        row[0][x] = window ? 100 : y < ROWS / 2 ? 1 : 0.3F;
    }
}

static int write_sky(const char *folder, struct err *e) {
    static const char channel[1][EXR_NAME_MAX] = {"Y"};
    char path[512];
    snprintf(path, sizeof path, "%s/sky.exr", folder);
    struct exr_form form = {COLUMNS, ROWS, 1, 0, channel, NULL, fill_sky, NULL};
    return exr_save(path, &form, e);
}

static struct scene *read_scene(const char *folder, const char *light, int pixels, struct err *e) {
    char path[512], text[1024], sentence[512];
    struct err_list errors = {0};
    snprintf(path, sizeof path, "%s/mesh.yaml", folder);
    int size =
        snprintf(text, sizeof text,
                 "materials: [{name: m, uniform: 0.3, sigma: 0.3, gamma: 0.07, beta_prime: 7.6, n: 1.7}]\n"
                 "shapes: [mesh: {file: body.ply, material: m, turn_deg: [25, 0, 0]}]\n"
                 "lights: [%s]\ncamera: {orthographic: {height_mm: 56}}\n"
                 "image: {width: %d, height: %d, grid: 1}\n",
                 light, pixels, pixels);
    struct scene *scene = scene_read_text(path, text, (size_t)size, NULL, 0, &errors);
    if (!scene) {
        err_set(e, ERR_INPUT, "%.400s", err_format(&errors.item[0], sentence, sizeof sentence));
    }
    err_list_free(&errors);
    return scene;
}

/* --- the reference: every texel by jittered directions, whatever its radiance --------------------------- */

struct brute {
    const struct scene *scene;
    int half, jitters; /* in each texel */
    double weight[BANDS][3];
    double *xyz;
    unsigned char *shown;
};

static struct shade_abc texel(const struct brute *b, const struct hit *hit, struct vec3 v, int row,
                              int column, unsigned short dice[3]) {
    const struct light *light = &b->scene->light[0];
    struct shade_abc sum = {0, 0, 0};
    double top = cos(M_PI * row / ROWS), bottom = cos(M_PI * (row + 1) / ROWS);
    double part = (top - bottom) * 2 * M_PI / COLUMNS / M_PI / b->jitters;
    for (int i = 0; i < b->jitters; i++) {
        double y = top + erand48(dice) * (bottom - top), sine = sqrt((1 - y) * (1 + y));
        double azimuth = 2 * M_PI * ((column + erand48(dice)) / COLUMNS - 0.5);
        struct vec3 l = {sine * sin(azimuth), y, -sine * cos(azimuth)};
        struct shade_abc x = shade(PATH_FEATURES, &b->scene->paint[0].shade, NULL, hit->normal, l, v);
        struct light_sample s;
        if ((x.a == 0 && x.c == 0) || intersect_blocked(b->scene, hit, l, INFINITY)) {
            continue;
        }
        double radiance = light_radiance(light, hit->position, l, &s) * part;
        sum.a += radiance * fmax(x.a, 0);
        sum.b += radiance * x.b;
        sum.c += radiance * x.c;
    }
    return sum;
}

static void brute_row(void *work, int y) {
    const struct brute *b = work;
    int width = b->scene->image.width;
    unsigned short dice[3] = {(unsigned short)y, (unsigned short)(b->half + 1), 815};
    for (int x = 0; x < width; x++) {
        struct ray ray = camera_ray(&b->scene->camera, x + 0.5, y + 0.5);
        struct shade_abc sum = {0, 0, 0};
        double *xyz = b->xyz + 3L * (y * width + x);
        struct hit hit;
        bool met = intersect_nearest(b->scene, &ray, &hit);
        b->shown[y * width + x] = met;
        for (int i = 0; i < ROWS * COLUMNS && met; i++) {
            struct shade_abc one =
                texel(b, &hit, vec3_scale(ray.direction, -1), i / COLUMNS, i % COLUMNS, dice);
            sum = (struct shade_abc){sum.a + one.a, sum.b + one.b, sum.c + one.c};
        }
        xyz[0] = xyz[1] = xyz[2] = 0;
        for (int k = 0; k < BANDS * 3; k++) {
            double s = b->scene->paint[0].s[k / 3];
            xyz[k % 3] += b->weight[k / 3][k % 3] * (sum.a * s + sum.b * s * s + sum.c);
        }
    }
}

static int make_reference(const struct scene *scene, int jitters, struct bench_reference *r, struct err *e) {
    struct brute b = {.scene = scene, .jitters = jitters};
    double power[BANDS];
    int status = bench_reference_make(r, scene, e);
    if (status) {
        return status;
    }
    colour_scale_power(scene->spd[0].power, COLOUR_2DEG, power);
    for (int k = 0; k < BANDS * 3; k++) {
        b.weight[k / 3][k % 3] = power[k / 3] * cie_2deg[k / 3][k % 3];
    }
    b.shown = r->shown;
    for (b.half = 0; b.half < 2; b.half++) {
        b.xyz = r->half[b.half];
        crew_run(scene->image.height, &(struct render_options){0}, brute_row, &b);
    }
    return 0;
}

/* --- the report -------------------------------------------------------------------------------------------- */

static int measure(struct scene *scene, const struct bench_reference *r, struct bench_error *out,
                   struct err *e) {
    struct planes planes;
    struct render_report report = {0};
    double *xyz = malloc(3 * (size_t)r->n * sizeof *xyz), white[3];
    scene->image.samples = out->samples;
    int status = xyz ? colour_white(scene->spd[0].power, COLOUR_2DEG, white, e)
                     : err_set(e, ERR_NOMEM, "no memory to compare");
    status =
        status ? status : render_planes(scene, &(struct render_options){.threads = 1}, &planes, &report, e);
    if (!status) {
        status = render_xyz(scene, &planes, false, xyz, e);
        out->trace_s = report.trace_cpu_s;
        planes_free(&planes);
    }
    status = status ? status : bench_compare(r, xyz, white, out, e);
    free(xyz);
    return status;
}

static int print_errors(const char *folder, const struct bench_size *size, FILE *out, struct err *e) {
    struct bench_error row[SAMPLES] = {0};
    struct bench_reference reference = {0};
    int status = write_body(folder, RINGS, e);
    status = status ? status : write_sky(folder, e);
    struct scene *scene =
        status ? NULL : read_scene(folder, "environment: {image: sky.exr}", size->fold_pixels, e);
    if (scene) {
        fprintf(out,
                "A body with bulges of %zu triangles with normals, painted as with 60 %% of water, under a "
                "sky of "
                "%d x %d texels\nwith a window; %d x %d pixels at their centres, one thread. Reference: each "
                "texel by "
                "itself, %d directions in two halves.\n\n"
                "| samples of light | RMSE | relMSE | DE2000 mean | 95 %% | trace CPU s | 1/(relMSE s) |\n"
                "|---|---|---|---|---|---|---|\n",
                shape_mesh(&scene->shape[0])->n_triangles, COLUMNS, ROWS, size->fold_pixels,
                size->fold_pixels, 2 * size->mesh_jitters);
    }
    status = scene ? make_reference(scene, size->mesh_jitters, &reference, e) : -ERR_INPUT;
    for (int i = 0; i < SAMPLES && !status; i++) {
        row[i].samples = 4 << 2 * i;
        status = measure(scene, &reference, &row[i], e);
    }
    double floor = status ? 0 : bench_floor(&reference);
    for (int i = 0; i < SAMPLES && !status; i++) {
        const struct bench_error *x = &row[i];
        fprintf(out, "| %d | %.2e%s | %.2e | %.3f | %.3f | %.3f | %.2e |\n", x->samples, x->rmse,
                floor > x->rmse / 10 ? " at reference floor" : "", x->relmse, x->de_mean, x->de_p95,
                x->trace_s, 1 / (x->relmse * x->trace_s));
    }
    if (!status) {
        fprintf(out, "\nSlope of log RMSE over log samples %.2f; floor %.1e.\n\n", bench_slope(row, SAMPLES),
                floor);
    }
    bench_reference_free(&reference);
    scene_free(scene);
    return status;
}

/* Reading the file and building the tree, and tracing in parallel light, of finer and finer bodies. */
static int print_sizes(const char *folder, const struct bench_size *size, FILE *out, struct err *e) {
    int pixels = size->time_pixels / 2, status = 0;
    for (int rings = RINGS; rings <= size->mesh_rings && !status; rings *= 4) {
        struct planes planes;
        struct render_report report = {0};
        status = write_body(folder, rings, e);
        double started = stopwatch_cpu_s();
        struct scene *scene = status ? NULL : read_scene(folder, "beam: {theta_deg: 40}", pixels, e);
        double read_s = stopwatch_cpu_s() - started;
        status = scene ? render_planes(scene, &(struct render_options){.threads = 1}, &planes, &report, e)
                       : -ERR_INPUT;
        if (!status) {
            uint64_t rays = report.counts.camera_rays + report.counts.shadow_rays;
            fprintf(out, "| %zu | %.3f | %.3f | %.0f |\n", shape_mesh(&scene->shape[0])->n_triangles, read_s,
                    report.trace_cpu_s, 1e9 * report.trace_cpu_s / (double)rays);
            planes_free(&planes);
        }
        scene_free(scene);
    }
    return status;
}

int bench_mesh_report(const char *folder, const struct bench_size *size, FILE *out, struct err *e) {
    struct err missing = {0};
    fputs("## S5: a mesh in an environment\n\n", out);
    if (embree_load(&missing)) {
        fprintf(out, "Left out: %s.\n\n", missing.text);
        return 0;
    }
    fprintf(stderr, "errors of the mesh ...\n");
    int status = print_errors(folder, size, out, e);
    if (!status) {
        fprintf(
            out,
            "Finer bodies in parallel light, %d x %d pixels, one sample, one thread, CPU:\n\n"
            "| triangles | read and build s | trace s | ns a ray, shading included |\n|---|---|---|---|\n",
            size->time_pixels / 2, size->time_pixels / 2);
        status = print_sizes(folder, size, out, e);
    }
    fputc('\n', out);
    return status;
}
