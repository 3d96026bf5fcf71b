#include <math.h>
#include <stdlib.h>

#include "fit/render/bench.h"
#include "fit/render/cie.h"
#include "fit/render/tint.h"
#include "fit/stopwatch.h"

static struct scene *read_scene(const char *path, struct err *e) {
    struct err_list list = {0};
    struct scene *scene = scene_read(path, NULL, 0, &list);
    if (!scene) {
        err_set(e, ERR_INPUT, "the scene %s cannot be read back", path);
    }
    err_list_free(&list);
    return scene;
}

static double smaller(double a, double b) {
    return a < b ? a : b;
}

/* Every row of planes through a matrix into rows that stay in the cache. */
static void tint_rows(const struct planes *p, const struct colour_matrix *m, double *row) {
    size_t width = (size_t)p->width;
    for (int y = 0; y < p->height; y++) {
        size_t at = (size_t)y * width;
        for (size_t i = 0; i < 3 * width; i++) {
            row[i] = 0;
        }
        tint_add(m, width, p->set[0].a + at, p->set[0].b + at, p->set[0].c + at,
                 (double *const[]){row, row + width, row + 2 * width});
    }
}

int bench_recolour(const char *folder, const struct bench_size *size, struct bench_recolour *out,
                   struct err *e) {
    char path[512];
    struct planes planes = {0};
    struct render_report report = {0};
    *out = (struct bench_recolour){.rgb_s = INFINITY, .codes_s = INFINITY};
    int status = bench_write_scene(folder, &bench_scene[1], size->time_pixels, 1, path, e);
    struct scene *scene = status ? NULL : read_scene(path, e);
    double *row = malloc(3 * (size_t)size->time_pixels * sizeof *row);
    status =
        scene && row ? render_planes(scene, &(struct render_options){0}, &planes, &report, e) : -ERR_NOMEM;
    for (int i = 0; i < 3 * size->repeats && !status; i++) {
        struct colour_matrix m;
        struct picture picture = {0};
        double started = stopwatch_s();
        status = colour_collapse(scene->paint[0].s, scene->spd[0].power, COLOUR_2DEG, &m, e);
        tint_rows(&planes, &m, row);
        out->rgb_s = smaller(out->rgb_s, stopwatch_s() - started);
        started = stopwatch_s();
        status = status ? status : render_picture(scene, &planes, false, &picture, e);
        out->codes_s = smaller(out->codes_s, stopwatch_s() - started);
        picture_free(&picture);
    }
    free(row);
    planes_free(&planes);
    scene_free(scene);
    return status;
}

static double largest_difference(const double *a, const double *b, size_t n) {
    double largest = 0;
    for (size_t i = 0; i < n; i++) {
        largest = fmax(largest, fabs(a[i] - b[i]));
    }
    return largest;
}

/* One pass with `keep` kept (~0u: all); CPU seconds of tracing and colouring, and X, Y, Z. */
static int one_way(const struct scene *scene, unsigned keep, double *cpu_s, double *xyz,
                   struct render_report *report, struct err *e) {
    struct planes planes;
    double started = stopwatch_cpu_s();
    int status =
        render_planes(scene, &(struct render_options){.threads = 1, .keep = keep}, &planes, report, e);
    if (!status) {
        status = render_xyz(scene, &planes, report->features.line[FEATURE_WAVELENGTHS].kept, xyz, e);
        *cpu_s = stopwatch_cpu_s() - started;
        planes_free(&planes);
    }
    return status;
}

int bench_ablation(const char *folder, const struct bench_size *size, struct bench_ablation *out,
                   struct err *e) {
    char path[512];
    int pixels = size->time_pixels / 2;
    size_t n = 3 * (size_t)pixels * (size_t)pixels;
    struct render_report lean, kept;
    *out = (struct bench_ablation){0};
    int status = bench_write_scene(folder, &bench_scene[1], pixels, 1, path, e);
    struct scene *scene = status ? NULL : read_scene(path, e);
    double *xyz[2] = {malloc(n * sizeof(double)), malloc(n * sizeof(double))};
    status = scene && xyz[0] && xyz[1] ? one_way(scene, 0, &out->lean_s, xyz[0], &lean, e) : -ERR_NOMEM;
    out->bound = status ? 0 : features_bound(&lean.features);
    for (int i = 0; i <= FEATURES && !status; i++) {
        bool idle = i == FEATURE_INTERREFLECTION || i == FEATURE_FACETS || i == FEATURE_MESHES;
        if (idle || (i < FEATURES && lean.features.line[i].kept)) { /* idle: this scene has none of it */
            continue;
        }
        out->left_out[i] = true;
        status = one_way(scene, i < FEATURES ? 1u << i : ~0u, &out->kept_s[i], xyz[1], &kept, e);
        out->apart[i] = largest_difference(xyz[0], xyz[1], n);
    }
    free(xyz[0]);
    free(xyz[1]);
    scene_free(scene);
    return status;
}

/* X, Y, Z of S under a light by bands first, first + step, ... last. */
static void coarse(const double *s, const double *power, int first, int last, int step, double xyz[3]) {
    double scale = 0;
    xyz[0] = xyz[1] = xyz[2] = 0;
    for (int k = first; k <= last; k += step) {
        scale += power[k] * cie_2deg[k][1];
        for (int i = 0; i < 3; i++) {
            xyz[i] += s[k] * power[k] * cie_2deg[k][i];
        }
    }
    for (int i = 0; i < 3; i++) {
        xyz[i] /= scale;
    }
}

double bench_grid_error(const struct cie_illuminant *light, const struct bench_grid *grid) {
    double s[BANDS], fine[3], rough[3], worst = 0;
    for (int k = 0; k < BANDS; k++) {
        double x = (band_nm(k) - 530) / 40.0;
        s[k] = 0.05 + 0.25 * exp(-x * x);
    }
    coarse(s, light->power, 0, BANDS - 1, 1, fine);
    coarse(s, light->power, grid->first, grid->last, grid->step, rough);
    for (int i = 0; i < 3; i++) {
        worst = fmax(worst, fabs(rough[i] - fine[i]) / fine[1]);
    }
    return worst;
}
