/* MINPACK's lmder (cminpack) and GSL's multifit_nlinear on a case of goniofit bench: fit_peers CASE.csv REPEATS
 *
 * Each with a plain scalar model written here, one point after the other, and again with goniod's kernel. All fit the same
 * coordinates from the same start with the same weights; what no parameter moves is computed once, as goniod does.
 * Prints the records that fit/bench_run.h describes. */
#include <cminpack.h>
#include <gsl/gsl_blas.h>
#include <gsl/gsl_multifit_nlinear.h>
#include <gsl/gsl_version.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/coordinates.h"
#include "fit/reflectance_batch.h"
#include "fit/stopwatch.h"

#define K 5
#define TOLERANCE 1e-10 /* reflection-model.md 4.3 b */
#define EVALUATIONS_MAX 200
#define REPEATS_MAX 2001
#define POINTS_MAX 2000000

struct angles { /* what no parameter moves */
    double phi2, cos_q, sin2_q, visibility, direct, interreflection;
};

struct fit {
    size_t n;
    double start[K], warm[K];
    double *beta, *weight;
    struct angles *angles;
    struct reflectance_batch batch;
    double *memory, *model, *slope;
    bool kernel, traced;
    const char *name;
    double begun_s;
    int evaluations, n_steps;
    struct step {
        double t_us, chi2, x[K];
        int evaluations;
    } step[EVALUATIONS_MAX];
};

static double radians(double deg) {
    return deg * M_PI / 180;
}

/* reflection-model.md 1.2 to 1.4 as they stand. */
static struct angles angles_of(double theta_i_deg, double theta_v_deg) {
    const double i = radians(theta_i_deg), r = radians(fabs(theta_v_deg)), c = theta_v_deg > 0 ? -1 : 1;
    const double alpha = fmax(i, r), beta = fmin(i, r), u = 2 * beta / M_PI;
    const double phi = radians(fabs(theta_i_deg - theta_v_deg)) / 2,
                 q = radians(fabs(theta_i_deg + theta_v_deg)) / 2;
    const double g = fmin(1, fmin(2 * cos(phi) * cos(r) / cos(q), 2 * cos(phi) * cos(i) / cos(q)));
    return (struct angles){.phi2 = phi * phi,
                           .cos_q = cos(q),
                           .sin2_q = sin(q) * sin(q),
                           .visibility = g / (cos(i) * cos(r)),
                           .direct = c * 0.45 * (sin(alpha) - (c < 0 ? u * u * u : 0)) * tan(beta),
                           .interreflection = 0.17 * (1 - c * u * u)};
}

static double fresnel(double n, double c, double s2, double *slope) {
    const double q = sqrt(n * n - 1 + c * c), g = q + c, rs_root = (n * n - 1) / (g * g),
                 rs = rs_root * rs_root;
    const double t = (c * q - s2) / (c * q + s2), both = c * q + s2;
    const double rs_slope = 2 * rs * (2 * n / (n * n - 1) - 2 * n / (q * g)),
                 t_slope = 2 * s2 * c * (n / q) / (both * both);
    *slope = rs_slope * (1 + t * t) / 2 + rs * t * t_slope;
    return 0.5 * rs * (1 + t * t);
}

static double saturated(double s2, double a, double *by_ln_sigma) {
    *by_ln_sigma = 2 * s2 * a / ((s2 + a) * (s2 + a));
    return s2 / (s2 + a);
}

/* Residuals, and derivatives by (ln S, ln sigma, ln gamma, ln A45, ln(n - 1)): column j at jacobian + j * n. */
static void plain_model(const struct fit *f, const double *x, double *residual, double *jacobian) {
    const double s = exp(x[0]), s2 = exp(2 * x[1]), gamma2 = exp(2 * x[2]), n = 1 + exp(x[4]);
    double slope_45, h1, k1, j1, f45 = fresnel(n, M_SQRT1_2, 0.5, &slope_45);
    const double h = saturated(s2, 0.33, &h1), k = saturated(s2, 0.09, &k1), j = saturated(s2, 0.13, &j1);
    const double b = exp(x[3]) / f45;
    for (size_t i = 0; i < f->n; i++) {
        const struct angles *a = &f->angles[i];
        const double w = f->weight[i], l1 = 1 - h / 2 + k * a->direct, l2 = j * a->interreflection;
        const double ln_d = -M_LN2 * a->phi2 / gamma2, lobe = exp(ln_d) * a->visibility;
        double slope, fr = fresnel(n, a->cos_q, a->sin2_q, &slope), specular = b * lobe * fr;
        if (residual) {
            residual[i] = (s * l1 + s * s * l2 + specular - f->beta[i]) * w;
        }
        if (jacobian) {
            jacobian[i] = (s * l1 + 2 * s * s * l2) * w;
            jacobian[f->n + i] = (s * (-h1 / 2 + k1 * a->direct) + s * s * j1 * a->interreflection) * w;
            jacobian[2 * f->n + i] = -2 * ln_d * specular * w;
            jacobian[3 * f->n + i] = specular * w;
            jacobian[4 * f->n + i] = b * lobe * (slope - fr * slope_45 / f45) * (n - 1) * w;
        }
    }
}

static void kernel_model(struct fit *f, const double *x, double *residual, double *jacobian) {
    const struct reflectance_optics optics = {.kappa = 1, .q = 1};
    const size_t stride = reflectance_batch_room(f->n);
    double value[MATERIAL_PARAMETERS], chain[K * K];
    coordinates_to_value(REFLECTANCE_COMPOSITE, x, value);
    coordinates_chain(REFLECTANCE_COMPOSITE, value, chain);
    if (reflectance_batch_eval(&f->batch, 0, f->n, REFLECTANCE_COMPOSITE, value, &optics, f->model, f->slope,
                               stride, NULL)) {
        memset(f->model, 0, f->n * sizeof *f->model);
        memset(f->slope, 0, K * stride * sizeof *f->slope);
    }
    for (size_t i = 0; i < f->n && residual; i++) {
        residual[i] = (f->model[i] - f->beta[i]) * f->weight[i];
    }
    for (int j = 0; j < K && jacobian; j++) {
        const double *height = f->slope + 3 * stride, *own = f->slope + (size_t)j * stride;
        const double share = j == 4 ? chain[3 * K + 4] : 0;
        for (size_t i = 0; i < f->n; i++) {
            jacobian[(size_t)j * f->n + i] = (chain[j * K + j] * own[i] + share * height[i]) * f->weight[i];
        }
    }
}

static void evaluate(struct fit *f, const double *x, double *residual, double *jacobian) {
    f->evaluations++;
    if (f->kernel) {
        kernel_model(f, x, residual, jacobian);
    } else {
        plain_model(f, x, residual, jacobian);
    }
}

static void print_record(const struct fit *f, const char *what, const struct step *s) {
    printf("%s,%s,%s,%.4f,%.17g,%d", f->name, f->kernel ? "goniod" : "plain", what, s->t_us, s->chi2,
           s->evaluations);
    for (int j = 0; j < K; j++) {
        printf(",%.17g", s->x[j]);
    }
    putchar('\n');
}

static double now_us(const struct fit *f) {
    return 1e6 * (stopwatch_s() - f->begun_s);
}

/* Kept, to be printed when the fit is over. */
static void keep_step(struct fit *f, double chi2, const double *x) {
    if (f->n_steps < EVALUATIONS_MAX) {
        struct step *s = &f->step[f->n_steps++];
        *s = (struct step){.t_us = now_us(f), .chi2 = chi2, .evaluations = f->evaluations};
        memcpy(s->x, x, sizeof s->x);
    }
}

struct minpack_work { /* allocated once, as its callers do */
    double *residual, *jacobian, *wa4;
};

static int minpack_step(void *context, int m, int n, const double *x, double *residual, double *jacobian,
                        int stride, int flag) {
    struct fit *f = context;
    (void)n;
    (void)stride;
    if (flag == 0) {
        double norm = enorm(m, residual);
        keep_step(f, norm * norm, x);
    } else {
        evaluate(f, x, flag == 1 ? residual : NULL, flag == 2 ? jacobian : NULL);
    }
    return 0;
}

static double minpack_fit(struct fit *f, void *work, double *x) {
    struct minpack_work *w = work;
    double diag[K], qtf[K], wa1[K], wa2[K], wa3[K];
    int pivots[K], m = (int)f->n, evaluations, jacobians;
    lmder(minpack_step, f, m, K, x, w->residual, w->jacobian, m, TOLERANCE, TOLERANCE, 0, EVALUATIONS_MAX,
          diag, 1, 100, f->traced ? 1 : 0, &evaluations, &jacobians, pivots, qtf, wa1, wa2, wa3, w->wa4);
    const double norm = enorm(m, w->residual);
    return norm * norm;
}

static int gsl_residuals(const gsl_vector *x, void *context, gsl_vector *residual) {
    evaluate(context, x->data, residual->data, NULL);
    return GSL_SUCCESS;
}

static double *columns; /* of the Jacobian, for gsl_jacobian, whose context is the fit */

static int gsl_jacobian(const gsl_vector *x, void *context, gsl_matrix *jacobian) {
    struct fit *f = context;
    evaluate(f, x->data, NULL, columns);
    for (size_t i = 0; i < f->n; i++) {
        for (size_t j = 0; j < K; j++) {
            jacobian->data[i * jacobian->tda + j] = columns[j * f->n + i];
        }
    }
    return GSL_SUCCESS;
}

static void gsl_step(const size_t iteration, void *context, const gsl_multifit_nlinear_workspace *space) {
    const gsl_vector *residual = gsl_multifit_nlinear_residual(space);
    double chi2;
    (void)iteration;
    gsl_blas_ddot(residual, residual, &chi2);
    keep_step(context, chi2, gsl_multifit_nlinear_position(space)->data);
}

static double gsl_fit(struct fit *f, void *work, double *x) {
    gsl_multifit_nlinear_workspace *space = work;
    gsl_multifit_nlinear_fdf fdf = {.f = gsl_residuals, .df = gsl_jacobian, .n = f->n, .p = K, .params = f};
    gsl_vector_view start = gsl_vector_view_array(x, K);
    int info;
    double chi2;
    gsl_multifit_nlinear_init(&start.vector, &fdf, space);
    gsl_multifit_nlinear_driver(EVALUATIONS_MAX, TOLERANCE, TOLERANCE, TOLERANCE, f->traced ? gsl_step : NULL,
                                f, &info, space);
    memcpy(x, gsl_multifit_nlinear_position(space)->data, K * sizeof *x);
    const gsl_vector *residual = gsl_multifit_nlinear_residual(space);
    gsl_blas_ddot(residual, residual, &chi2);
    return chi2;
}

typedef double run(struct fit *f, void *work, double *x);

static int ascending(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void time_fit(struct fit *f, run *fit, void *work, const char *what, const double *start,
                     int repeats) {
    double t_us[REPEATS_MAX], x[K], chi2 = 0;
    for (int i = -1; i < repeats; i++) {
        memcpy(x, start, sizeof x);
        f->evaluations = 0;
        f->begun_s = stopwatch_s();
        chi2 = fit(f, work, x);
        t_us[i < 0 ? 0 : i] = now_us(f);
    }
    qsort(t_us, (size_t)repeats, sizeof *t_us, ascending);
    struct step last = {.t_us = t_us[repeats / 2], .chi2 = chi2, .evaluations = f->evaluations};
    memcpy(last.x, x, sizeof last.x);
    print_record(f, what, &last);
}

static void run_all(struct fit *f, const char *name, run *fit, void *work, int repeats) {
    f->name = name;
    for (int kernel = 0; kernel < 2; kernel++) {
        double x[K];
        f->kernel = kernel;
        time_fit(f, fit, work, "cold", f->start, repeats);
        time_fit(f, fit, work, "warm", f->warm, repeats);
        memcpy(x, f->start, sizeof x);
        f->traced = true;
        f->evaluations = f->n_steps = 0;
        f->begun_s = stopwatch_s();
        fit(f, work, x);
        f->traced = false;
        for (int i = 0; i < f->n_steps; i++) {
            print_record(f, "trace", &f->step[i]);
        }
    }
}

static void *room(size_t n) {
    void *memory = calloc(n + 1, sizeof(double));
    if (!memory) {
        fputs("fit_peers: no memory\n", stderr);
        exit(1);
    }
    return memory;
}

static bool read_numbers(const char *line, const char *name, double *x) {
    const size_t length = strlen(name);
    return strncmp(line, name, length) == 0 &&
           sscanf(line + length, "%lf %lf %lf %lf %lf", &x[0], &x[1], &x[2], &x[3], &x[4]) == K;
}

static void read_case(struct fit *f, const char *path) {
    FILE *in = fopen(path, "r");
    char line[512];
    size_t capacity = 0;
    struct reflectance_geometry *geometry = NULL;
    while (in && fgets(line, sizeof line, in) && f->n < POINTS_MAX) {
        double i_deg, v_deg, beta, u;
        if (read_numbers(line, "# start", f->start) || read_numbers(line, "# warm", f->warm) ||
            sscanf(line, "%lf,%lf,%lf,%lf", &i_deg, &v_deg, &beta, &u) != 4) {
            continue;
        }
        if (f->n == capacity) {
            capacity = capacity ? 2 * capacity : 256;
            f->beta = realloc(f->beta, capacity * sizeof *f->beta);
            f->weight = realloc(f->weight, capacity * sizeof *f->weight);
            f->angles = realloc(f->angles, capacity * sizeof *f->angles);
            geometry = realloc(geometry, capacity * sizeof *geometry);
        }
        f->beta[f->n] = beta;
        f->weight[f->n] = 1 / u;
        f->angles[f->n] = angles_of(i_deg, v_deg);
        reflectance_geometry(&geometry[f->n++], i_deg, v_deg, NULL);
    }
    if (!in || f->n < K) {
        fprintf(stderr, "fit_peers: %s holds no case\n", path);
        exit(1);
    }
    fclose(in);
    f->memory = room(reflectance_batch_size(f->n));
    f->model = room(reflectance_batch_room(f->n));
    f->slope = room(K * reflectance_batch_room(f->n));
    reflectance_batch_fill(&f->batch, f->n, geometry, f->memory);
    free(geometry);
}

int main(int argc, char **argv) {
    struct fit f = {0};
    const int repeats = argc == 3 ? atoi(argv[2]) : 0;
    if (repeats < 1 || repeats > REPEATS_MAX) {
        fputs("usage: fit_peers CASE.csv REPEATS\n", stderr);
        return 2;
    }
    read_case(&f, argv[1]);
    struct minpack_work minpack = {room(f.n), room(f.n * K), room(f.n)};
    gsl_multifit_nlinear_parameters parameters = gsl_multifit_nlinear_default_parameters();
    parameters.solver = gsl_multifit_nlinear_solver_cholesky; /* its quickest, as TinySolver's is */
    columns = room(f.n * K);
    gsl_multifit_nlinear_workspace *space =
        gsl_multifit_nlinear_alloc(gsl_multifit_nlinear_trust, &parameters, f.n, K);
    printf("# cminpack " CMINPACK_VERSION "\n# GSL %s\n", GSL_VERSION);
    run_all(&f, "MINPACK lmder", minpack_fit, &minpack, repeats);
    run_all(&f, "GSL multifit", gsl_fit, space, repeats);
    gsl_multifit_nlinear_free(space);
    return 0;
}
