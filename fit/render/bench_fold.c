#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/bench.h"
#include "fit/render/crew.h"
#include "fit/render/intersect.h"
#include "fit/render/path.h"
#include "fit/stopwatch.h"

#define BOUNCES 5
#define ROWS 3 /* 4, 16, 64 paths a pixel */

/* What a path carries: 81 bands, as goniorender does; 4 stratified wavelengths for all light; the same for light over
 * several surfaces alone. */
enum carry { FULL, HERO, HERO_INDIRECT, CARRIES };
static const char *const shorts[CARRIES] = {"81", "4", "4 indirect"};
static const char *const carries[CARRIES] = {"81 bands", "4 wavelengths", "4 wavelengths of indirect light"};

struct results {
    double reference_rmse;
    struct bench_error row[CARRIES][ROWS];
};

struct fold { /* the scene, and what both its renderings and its reference need */
    struct scene *scene;
    struct energy energy;
    struct aim aim;
    struct glints glints;
    struct shade_half half[SCENE_PAINTS][SCENE_LIGHTS]; /* not read: nothing is hoisted */
    double weight[BANDS][3];                            /* of a band's radiance in X, Y, Z */
};

struct point { /* of a pixel: where its centre is seen, and the light alone */
    struct hit hit;
    struct vec3 v;
    struct shade_abc direct;
};

/* The published ones (paper, Experimental results). */
static const struct {
    const char *name, *parameters;
} paints[] = {
    {"0 %", "sigma: 0.2, gamma: 0.2, beta_prime: 15.7, n: 1.7"},
    {"60 %", "sigma: 0.3, gamma: 0.07, beta_prime: 7.6, n: 1.7"},
    {"90 %", "sigma: 0.5, gamma: 0.08, beta_prime: 1.6, n: 2.42"},
};
#define PAINTS 3

static int write_scene(const char *folder, const char *parameters, int pixels, char path[512],
                       struct err *e) {
    snprintf(path, 512, "%s/fold.csv", folder);
    FILE *file = fopen(path, "w");
    if (!file) {
        return err_errno(e, ERR_IO, errno, "%s cannot be written", path);
    }
    fputs("lambda_nm,value\n", file);
    for (int k = 0; k < BANDS; k++) { /* 0.1 to 0.9: strong colours show what a sample of wavelengths costs */
        fprintf(file, "%d,%.6f\n", band_nm(k), 0.5 + 0.4 * tanh((band_nm(k) - 580) / 30.0));
    }
    if (fclose(file) != 0) {
        return err_errno(e, ERR_IO, errno, "%s cannot be written", path);
    }
    snprintf(path, 512, "%s/fold.yaml", folder);
    file = fopen(path, "w");
    if (!file) {
        return err_errno(e, ERR_IO, errno, "%s cannot be written", path);
    }
    fprintf(file,
            "materials: [{name: m, spectrum: fold.csv, %s}]\n"
            "shapes: [fold: {material: m, width_mm: 40, length_mm: 60}]\n"
            "lights: [beam: {theta_deg: 20, azimuth_deg: 180}]\n"
            "camera: {orthographic: {height_mm: 40}}\n"
            "image: {width: %d, height: %d, grid: 1, bounces: %d}\n",
            parameters, pixels, pixels, BOUNCES);
    return fclose(file) == 0 ? 0 : err_errno(e, ERR_IO, errno, "%s cannot be written", path);
}

static int fold_read(struct fold *f, const char *folder, const char *parameters, int pixels, struct err *e) {
    char path[512];
    struct err_list list = {0};
    int status = write_scene(folder, parameters, pixels, path, e);
    f->scene = status ? NULL : scene_read(path, NULL, 0, &list);
    err_list_free(&list);
    if (!f->scene) {
        return status ? status : err_set(e, ERR_INPUT, "the scene %s cannot be read back", path);
    }
    double power[BANDS];
    colour_scale_power(f->scene->spd[0].power, COLOUR_2DEG, power);
    for (int k = 0; k < BANDS * 3; k++) {
        f->weight[k / 3][k % 3] = power[k / 3] * cie_2deg[k / 3][k % 3];
    }
    return 0;
}

static struct point point_at(const struct fold *f, int x, int y) {
    struct point p;
    struct ray ray = camera_ray(&f->scene->camera, x + 0.5, y + 0.5);
    bool met = intersect_nearest(f->scene, &ray, &p.hit); /* the fold fills the picture */
    p.v = vec3_scale(ray.direction, -1);
    p.direct = met ? shade(PATH_FEATURES, &f->scene->paint[0].shade, NULL, p.hit.normal,
                           f->scene->light[0].direction, p.v)
                   : (struct shade_abc){0, 0, 0};
    return p;
}

static double of_band(const struct fold *f, const struct shade_abc *x, int k) {
    double s = f->scene->paint[0].s[k];
    return x->a * s + x->b * s * s + x->c;
}

/* The reference: directions by cosine alone from another generator, every bounce followed, every band by itself.
 * first: the numbers of the first direction. */
static void brute_path(const struct fold *f, const struct point *p, const double first[2],
                       unsigned short dice[3], double *spectrum) {
    const struct shade_paint *paint = &f->scene->paint[0].shade;
    struct vec3 light = f->scene->light[0].direction, v = p->v, s, t;
    struct hit at = p->hit, next;
    double carried[BANDS];
    for (int k = 0; k < BANDS; k++) {
        carried[k] = 1;
    }
    for (int bounce = 1; bounce < BOUNCES; bounce++) {
        double u = bounce > 1 ? erand48(dice) : first[0], turn = bounce > 1 ? erand48(dice) : first[1];
        double azimuth = 2 * M_PI * turn, cosine = sqrt(u), sine = sqrt(1 - u);
        vec3_frame(at.normal, &s, &t);
        struct vec3 l =
            vec3_add(vec3_add(vec3_scale(s, sine * cos(azimuth)), vec3_scale(t, sine * sin(azimuth))),
                     vec3_scale(at.normal, cosine));
        struct shade_abc x = shade(PATH_FEATURES, paint, NULL, at.normal, l, v);
        double scale = energy_scale(&f->energy, cosine, vec3_dot(at.normal, v)) / cosine;
        struct ray ray = intersect_leave(f->scene, &at, l);
        if (!intersect_nearest(f->scene, &ray, &next)) {
            return;
        }
        x.a = fmax(x.a, 0);
        v = vec3_scale(l, -1);
        at = next;
        struct shade_abc d = shade(PATH_FEATURES, paint, NULL, at.normal, light, v);
        double shine = energy_scale(&f->energy, vec3_dot(at.normal, light), vec3_dot(at.normal, v));
        bool lit = !intersect_blocked(f->scene, &at, light, INFINITY);
        d.a = fmax(d.a, 0);
        for (int k = 0; k < BANDS; k++) {
            carried[k] *= scale * of_band(f, &x, k);
            spectrum[k] += lit ? carried[k] * shine * of_band(f, &d, k) : 0;
        }
    }
}

struct brute { /* one half of the reference, its rows shared out */
    const struct fold *fold;
    int half, samples;
    double *xyz;
};

static void brute_row(void *work, int y) {
    const struct brute *b = work;
    int width = b->fold->scene->image.width, side = (int)sqrt(b->samples);
    unsigned short dice[3] = {(unsigned short)y, (unsigned short)(b->half + 1), 4711};
    for (int x = 0; x < width; x++) {
        struct point p = point_at(b->fold, x, y);
        double spectrum[BANDS] = {0}, *xyz = b->xyz + 3L * (y * width + x);
        for (int i = 0; i < b->samples; i++) { /* one in each cell of a grid; what is over, anywhere */
            bool cell = i < side * side;
            double first[2] = {erand48(dice), erand48(dice)};
            first[0] = cell ? (i % side + first[0]) / side : first[0];
            first[1] = cell ? (i / side + first[1]) / side : first[1];
            brute_path(b->fold, &p, first, dice, spectrum);
        }
        xyz[0] = xyz[1] = xyz[2] = 0;
        for (int k = 0; k < BANDS * 3; k++) {
            double radiance = of_band(b->fold, &p.direct, k / 3) + spectrum[k / 3] / b->samples;
            xyz[k % 3] += b->fold->weight[k / 3][k % 3] * radiance;
        }
    }
}

static int make_reference(const struct fold *f, int samples, struct bench_reference *r, struct err *e) {
    int status = bench_reference_make(r, f->scene, e);
    if (status) {
        return status;
    }
    memset(r->shown, 1, (size_t)r->n);
    for (int half = 0; half < 2; half++) {
        struct brute b = {f, half, samples / 2, r->half[half]};
        crew_run(f->scene->image.height, &(struct render_options){0}, brute_row, &b);
    }
    return 0;
}

/* What the same path carries at four wavelengths alone. */
static void carry_hero(const struct fold *f, const struct path *path, const int band[4], double *sum) {
    double carried[4] = {1, 1, 1, 1};
    for (int i = 0; i < path->n; i++) {
        for (int h = 0; h < 4; h++) {
            carried[h] *= of_band(f, &path->step[i].scatter, band[h]);
            sum[h] += carried[h] * of_band(f, &path->step[i].light[0], band[h]);
        }
    }
}

/* The pixel by paths of four stratified wavelengths each; direct: whether the lights' own part is sampled like that. */
static void hero_pixel(const struct fold *f, const struct trace *t, int pixel, int samples, bool direct,
                       double xyz[3]) {
    int width = f->scene->image.width;
    struct point p = point_at(f, pixel % width, pixel / width);
    struct path_place place;
    struct render_counts unused = {0};
    path_begin(t, &p.hit, p.v, &place);
    xyz[0] = xyz[1] = xyz[2] = 0;
    for (int k = 0; k < BANDS * 3 && !direct; k++) {
        xyz[k % 3] += f->weight[k / 3][k % 3] * of_band(f, &p.direct, k / 3);
    }
    for (int r = 0; r < samples; r++) {
        struct sampler sampler;
        struct path path;
        double sum[4] = {0}, start;
        int band[4];
        trace_sampler(t, &(struct trace_sample){.pixel = (uint32_t)pixel}, r, &sampler);
        path_find(t, &place, &sampler, &path, &unused);
        start = sampler_1d(&sampler);
        for (int h = 0; h < 4; h++) {
            band[h] = (int)((h + start) * BANDS / 4);
            sum[h] = direct ? of_band(f, &p.direct, band[h]) : 0;
        }
        carry_hero(f, &path, band, sum);
        for (int h = 0; h < 12; h++) {
            xyz[h % 3] += f->weight[band[h / 3]][h % 3] * sum[h / 3] * BANDS / 4 / samples;
        }
    }
}

static void render_hero(struct fold *f, int samples, bool direct, double *xyz, double *cpu_s) {
    double started = stopwatch_cpu_s();
    energy_make(&f->energy, &f->scene->paint[0], ENERGY_SCALE);
    struct trace t = {.scene = f->scene,
                      .shade_features = PATH_FEATURES,
                      .shadow_rays = true,
                      .half = f->half,
                      .energy = &f->energy,
                      .aim = &f->aim,
                      .glints = &f->glints,
                      .repeats = samples};
    aim_make(&f->aim, f->scene);
    glint_make(&f->glints, f->scene, &f->aim, &f->energy);
    for (int i = 0; i < f->scene->image.width * f->scene->image.height; i++) {
        hero_pixel(f, &t, i, samples, direct, xyz + 3L * i);
    }
    *cpu_s = stopwatch_cpu_s() - started;
}

static int render_full(struct fold *f, int samples, double *xyz, double *cpu_s, struct err *e) {
    struct planes planes;
    struct render_report report = {0};
    double started = stopwatch_cpu_s();
    f->scene->image.samples = samples;
    int status = render_planes(f->scene, &(struct render_options){.threads = 1}, &planes, &report, e);
    if (!status) {
        status = render_xyz(f->scene, &planes, false, xyz, e);
        *cpu_s = stopwatch_cpu_s() - started;
        planes_free(&planes);
    }
    return status;
}

static int measure(struct fold *f, const struct bench_reference *r, int samples, enum carry carry,
                   struct bench_error *out, struct err *e) {
    double *xyz = malloc(3 * (size_t)r->n * sizeof *xyz), white[3];
    int status = xyz ? 0 : err_set(e, ERR_NOMEM, "no memory to compare");
    *out = (struct bench_error){.samples = samples};
    status = status ? status : colour_white(f->scene->spd[0].power, COLOUR_2DEG, white, e);
    if (!status && carry == FULL) {
        status = render_full(f, samples, xyz, &out->trace_s, e);
    } else if (!status) {
        render_hero(f, samples, carry == HERO, xyz, &out->trace_s);
    }
    status = status ? status : bench_compare(r, xyz, white, out, e);
    free(xyz);
    return status;
}

/* In rounds, so that what else the machine does falls on all ways to carry alike; the least of their times. */
static int measure_row(struct fold *f, const struct bench_reference *r, int row, int rounds,
                       struct results *x, struct err *e) {
    double least_s[CARRIES];
    int status = 0;
    for (int i = 0; i < rounds * CARRIES && !status; i++) {
        int carry = i % CARRIES;
        struct bench_error *out = &x->row[carry][row];
        status = measure(f, r, 4 << 2 * row, (enum carry)carry, out, e);
        least_s[carry] = i < CARRIES ? out->trace_s : fmin(least_s[carry], out->trace_s);
        out->trace_s = least_s[carry];
    }
    return status;
}

static int run(const char *folder, const char *parameters, const struct bench_size *size, struct results *out,
               struct err *e) {
    struct fold *f = calloc(1, sizeof *f);
    struct bench_reference reference = {0};
    *out = (struct results){0};
    int status = f ? fold_read(f, folder, parameters, size->fold_pixels, e)
                   : err_set(e, ERR_NOMEM, "no memory for a scene");
    if (!status) {
        energy_make(&f->energy, &f->scene->paint[0], ENERGY_SCALE);
        status = make_reference(f, size->fold_samples, &reference, e);
    }
    for (int row = 0; row < ROWS && !status; row++) {
        status = measure_row(f, &reference, row, size->repeats, out, e);
    }
    out->reference_rmse = status ? 0 : bench_floor(&reference);
    bench_reference_free(&reference);
    scene_free(f ? f->scene : NULL);
    free(f);
    return status;
}

static double efficiency(const struct bench_error *r) {
    return 1 / (r->relmse * r->trace_s);
}

const char *bench_fold_name(int block) {
    static char name[64];
    snprintf(name, sizeof name, "%s %s", paints[block / CARRIES].name, shorts[block % CARRIES]);
    return name;
}

static void write_rows(int paint, const struct results *x, FILE *rows) {
    for (int i = 0; i < ROWS * CARRIES; i++) {
        const struct bench_error *r = &x->row[i / ROWS][i % ROWS];
        fprintf(rows, "S4 %s,%d,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g\n%s",
                bench_fold_name(paint * CARRIES + i / ROWS), r->samples, r->rmse, r->edge_rmse, r->inner_rmse,
                r->relmse, r->largest, r->de_mean, r->de_p95, r->de_largest, r->trace_s, x->reference_rmse,
                i % ROWS == ROWS - 1 ? "\n\n" : "");
    }
}

static void print_rows(const char *paint, const struct results *x, FILE *out) {
    for (int i = 0; i < ROWS * CARRIES; i++) {
        const struct bench_error *r = &x->row[i / ROWS][i % ROWS];
        bool at_floor = x->reference_rmse > r->rmse / 10;
        fprintf(out, "| %s | %s | %d | %.2e%s | %.2e | %.3f | %.3f | %.3f | %.2e |\n", paint,
                carries[i / ROWS], r->samples, r->rmse, at_floor ? " at reference floor" : "", r->relmse,
                r->de_mean, r->de_p95, r->trace_s, efficiency(r));
    }
}

/* The least over the rows of how much more 81 bands are worth. */
static double gain(const struct results *x, enum carry over) {
    double least = INFINITY;
    for (int i = 0; i < ROWS; i++) {
        least = fmin(least, efficiency(&x->row[FULL][i]) / efficiency(&x->row[over][i]));
    }
    return least;
}

static void print_figures(const struct results *x, FILE *out) {
    fputs("\n| paint | slope of log RMSE | floor | 1/(relMSE s) of 81 bands over 4 wavelengths, least of the "
          "rows; 3 to reach | over 4 wavelengths of indirect light |\n|---|---|---|---|---|\n",
          out);
    for (int p = 0; p < PAINTS; p++) {
        double over = gain(&x[p], HERO);
        fprintf(out, "| %s | %.2f | %.1e | %.1f %s | %.1f |\n", paints[p].name,
                bench_slope(x[p].row[FULL], ROWS), x[p].reference_rmse, over, over >= 3 ? "met" : "not met",
                gain(&x[p], HERO_INDIRECT));
    }
    fputc('\n', out);
}

int bench_fold_report(const char *folder, const struct bench_size *size, FILE *out, FILE *rows,
                      struct err *e) {
    struct results x[PAINTS];
    int status = 0;
    fprintf(
        out,
        "## A fold, 5 bounces (S4)\n\nTwo perpendicular sides of one paint, S 0.1 to 0.9 and else as "
        "published for that much water; %d x %d pixels\n"
        "at their centres; reference %d paths a pixel in two halves, directions by cosine alone from another "
        "generator, the first jittered.\n"
        "Beside it the same paths with 4 stratified wavelengths each instead of 81 bands, for all light or "
        "only for what\n"
        "came over several surfaces. CPU of tracing and colouring, one thread, the quietest of %d rounds.\n\n"
        "| paint | carried | paths a pixel | RMSE | relMSE | DE2000 mean | 95 %% | CPU s | 1/(relMSE s) |\n"
        "|---|---|---|---|---|---|---|---|---|\n",
        size->fold_pixels, size->fold_pixels, size->fold_samples, size->repeats);
    for (int p = 0; p < PAINTS && !status; p++) {
        fprintf(stderr, "errors of the fold of %s ...\n", paints[p].name);
        status = run(folder, paints[p].parameters, size, &x[p], e);
        if (!status) {
            print_rows(paints[p].name, &x[p], out);
            if (rows) {
                write_rows(p, &x[p], rows);
            }
        }
    }
    if (!status) {
        print_figures(x, out);
    }
    return status;
}
