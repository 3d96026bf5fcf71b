#include "fit/bench_case.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit/dice.h"
#include "fit/points.h"
#include "fit/start.h"

#define NOISE_RELATIVE 0.005
#define NOISE_ABSOLUTE 0.001

static double noise_sd(double beta) {
    return hypot(NOISE_RELATIVE * beta, NOISE_ABSOLUTE);
}

static int model_at(const double *value, double theta_i_deg, double theta_v_deg, double *beta,
                    struct err *e) {
    const struct reflectance_optics optics = {.kappa = 1, .q = 1};
    struct reflectance_geometry g;
    int status = reflectance_geometry(&g, theta_i_deg, theta_v_deg, e);
    return status ? status : reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, &optics, beta, NULL, e);
}

/* A broad green on a dark ground around the set's own S. */
static double albedo(double s, int band, int bands) {
    const double x = (band - bands / 2.0) / fmax(1, bands / 8.0);
    return s * (0.7 + 0.9 * exp(-x * x / 2));
}

static int add_point(struct bench_case *c, const double *value, double theta_i_deg, double theta_v_deg,
                     int bands, struct dice *d, struct err *e) {
    double beta = 0, bands_beta[BANDS], bands_u[BANDS];
    int status = model_at(value, theta_i_deg, theta_v_deg, &beta, e);
    for (int b = 0; b < BANDS && !status; b++) {
        double own[MATERIAL_PARAMETERS], clean;
        bands_beta[b] = bands_u[b] = NAN;
        if (b < bands) {
            memcpy(own, value, sizeof own);
            own[MATERIAL_S] = albedo(value[MATERIAL_S], b, bands);
            status = model_at(own, theta_i_deg, theta_v_deg, &clean, e);
            bands_u[b] = noise_sd(clean);
            bands_beta[b] = clean + bands_u[b] * dice_normal(d);
        }
    }
    const double sd = noise_sd(beta), seen = beta + sd * dice_normal(d);
    if (bands == 1) { /* the mean itself */
        bands_beta[0] = seen;
        bands_u[0] = sd;
    }
    const struct fitset_point point = {.theta_i_deg = theta_i_deg,
                                       .theta_v_deg = theta_v_deg,
                                       .beta = seen,
                                       .u_ind = sd,
                                       .bands = bands ? bands_beta : NULL,
                                       .bands_u = bands ? bands_u : NULL};
    return status ? status : fitset_add_point(&c->data, &point, e);
}

static int add_grid(struct bench_case *c, const double *value, int bands, struct dice *d, struct err *e) {
    int status = 0;
    for (int i = 1; i <= 6 && !status; i++) {
        for (int v = -16; v <= 16 && !status; v++) {
            status = add_point(c, value, 10 * i, 5 * v, bands, d, e);
        }
    }
    return status;
}

/* Evenly over the same range: a lattice by the golden ratio, which leaves no angle out. */
static int add_spread(struct bench_case *c, const double *value, size_t points, struct dice *d,
                      struct err *e) {
    int status = 0;
    for (size_t i = 0; i < points && !status; i++) {
        const double share = fmod((double)i * 0.6180339887498949, 1);
        const double theta_i_deg = 10 + 50 * ((double)i + 0.5) / (double)points;
        status = add_point(c, value, theta_i_deg, -80 + 160 * share, 0, d, e);
    }
    return status;
}

static int begin_problem(struct bench_case *c, struct err *e) {
    const struct estimate_input *input;
    int status = fitset_input(&c->data, &input, e);
    return status ? status : problem_init(&c->p, input, e);
}

int bench_case_make(struct bench_case *c, const struct published *set, size_t points, int bands,
                    uint64_t seed, struct err *e) {
    struct dice d = {seed};
    double off[MATERIAL_PARAMETERS] = {0};
    *c = (struct bench_case){.has_truth = true};
    snprintf(c->name, sizeof c->name, "%s", set->name);
    fitset_init(&c->data);
    int status = points ? add_spread(c, set->value, points, &d, e) : add_grid(c, set->value, bands, &d, e);
    if (status || (status = begin_problem(c, e))) {
        return status;
    }
    for (int j = 0; j < MATERIAL_N; j++) {
        off[j] = set->value[j] * (j % 2 ? 1.15 : 0.85);
    }
    off[MATERIAL_N] = 1 + (set->value[MATERIAL_N] - 1) * 1.075;
    coordinates_from_value(c->p.model, off, c->start);
    coordinates_from_value(c->p.model, set->value, c->truth);
    return 0;
}

int bench_case_read(struct bench_case *c, const char *path, struct err *e) {
    const struct points_options options = {
        .mask = {.max_theta_i_deg = 65, .max_theta_v_deg = 75, .in_plane = true},
        .has_u = true,
        .u_relative = 0.05,
        .u_absolute = 0.005};
    struct points_report report = {0};
    struct err_list errors = {0};
    double starts[START_MAX][COORDINATES_MAX];
    const char *base = strrchr(path, '/');
    *c = (struct bench_case){0};
    snprintf(c->name, sizeof c->name, "%.40s", base ? base + 1 : path);
    c->name[strcspn(c->name, ".")] = '\0';
    fitset_init(&c->data);
    int status = points_read(path, &options, &c->data, &report, &errors);
    if (status && errors.n) {
        *e = errors.item[0];
    }
    err_list_free(&errors);
    if (status || (status = begin_problem(c, e))) {
        return status;
    }
    start_find(&c->p, starts);
    memcpy(c->start, starts[0], sizeof c->start);
    return 0;
}

int bench_case_settle(struct bench_case *c, struct err *e) {
    struct solve_result r = {0};
    c->p.n--;
    int status = solve_run(&c->p, c->start, NULL, &r, NULL, e);
    c->p.n++;
    memcpy(c->warm, r.x, sizeof c->warm);
    c->left = r.last;
    if (!status && !(status = solve_by(SOLVE_QR, &c->p, c->start, NULL, &r, NULL, e))) {
        status = solve_run(&c->p, r.x, NULL, &r, NULL, e); /* the last digits */
    }
    memcpy(c->optimum, r.x, sizeof c->optimum);
    c->chi2 = r.chi2;
    return status;
}

void bench_case_free(struct bench_case *c) {
    problem_free(&c->p);
    fitset_free(&c->data);
}
