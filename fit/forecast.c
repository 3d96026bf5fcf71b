#include "fit/forecast.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/cholesky.h"
#include "fit/drift.h"
#include "fit/problem.h"

#define U_LN_MAX 0.5 /* as verdict.cc: then a value is a guess, not a result */
/* reflection-model.md 3.2: n and beta' correlate by 0.971 up to 60 deg of incidence, by 0.9985 to 0.9992 up to 40, by
 * 0.9999 up to 30, where an error of the model by 0.1 % is one of several per cent in both. */
#define CORRELATION_MAX 0.9995
#define CONDITION_MAX 1e12 /* of J^T W J: beyond it double precision does not tell the parameters apart */

struct covariance {
    int k;
    double value[MATERIAL_PARAMETERS];
    double chain[COORDINATES_MAX * COORDINATES_MAX];
    double *twice; /* [k][n] room */
    double *peak;  /* [n] beta of the brightest band */
    double *level; /* [n] of the mean, as a part of what a white surface gives at the exposure's target */
    bool *longest; /* [n] whether the exposure is at its longest */
    double *slope; /* [k][n] along the coordinates, weighted, less what the nuisances explain */
    double fisher[COORDINATES_MAX * COORDINATES_MAX];
    double l[COORDINATES_MAX * COORDINATES_MAX]; /* of J^T W J scaled to a unit diagonal */
    double scale[COORDINATES_MAX];
    double statistical[COORDINATES_MAX * COORDINATES_MAX]; /* of the coordinates */
    double common[COORDINATES_MAX * COORDINATES_MAX];
};

static double noise_of(const struct forecast_noise *noise, double beta, double level) {
    double counting = noise->relative * noise->relative / level, read = noise->read / level;
    return sqrt(beta * beta * (counting + read * read + noise->reference * noise->reference) +
                noise->absolute * noise->absolute);
}

/* beta of the brightest band: the lobe has no colour. */
static double peak_of(const struct problem *p, const struct forecast_noise *noise, const double *value,
                      size_t i) {
    const int column = reflectance_column(p->model, MATERIAL_BETA_PRIME);
    const double lobe =
        column < 0 ? 0 : p->gradient[i * (size_t)p->k + (size_t)column] * value[MATERIAL_BETA_PRIME];
    return noise->colour > 0 ? lobe + (p->model_beta[i] - lobe) / noise->colour : p->model_beta[i];
}

/* The model's own values as readings, with the u they would have. */
static int fill_readings(struct problem *p, const struct forecast_noise *noise, const double *value,
                         double *beta, double *u, struct covariance *c, struct err *e) {
    double brightest = 0;
    int status = problem_evaluate(p, value, e);
    for (size_t i = 0; i < p->n && !status; i++) {
        c->peak[i] = fmax(fabs(peak_of(p, noise, value, i)), 1e-12);
        brightest = fmax(brightest, c->peak[i]);
    }
    for (size_t i = 0; i < p->n && !status; i++) {
        const double reached = isfinite(noise->span) ? fmin(1, c->peak[i] / brightest * noise->span) : 1;
        c->longest[i] = reached < 1;
        beta[i] = p->model_beta[i];
        c->level[i] = reached * fmax(fabs(beta[i]) / c->peak[i], 1e-12);
        u[i] = noise_of(noise, fabs(beta[i]), c->level[i]);
    }
    return status;
}

static void take_slopes(struct covariance *c, const struct problem *p) {
    for (int j = 0; j < c->k; j++) {
        double *slope = c->slope + (size_t)j * p->n;
        for (size_t i = 0; i < p->n; i++) {
            slope[i] = 0;
            for (int m = 0; m < c->k; m++) {
                slope[i] += p->gradient[i * (size_t)c->k + (size_t)m] * c->chain[m * c->k + j];
            }
            slope[i] *= p->root_weight[i];
        }
        nuisance_whiten(p, slope);
    }
}

static double dot(size_t n, const double *a, const double *b) {
    double sum = 0;
    for (size_t i = 0; i < n; i++) {
        sum += a[i] * b[i];
    }
    return sum;
}

/* False: the angles do not tell the parameters. */
static bool invert(struct covariance *c, const struct problem *p) {
    const int k = c->k;
    double fisher[COORDINATES_MAX * COORDINATES_MAX];
    for (int a = 0; a < k * k; a++) {
        c->fisher[a] = fisher[a] =
            dot(p->n, c->slope + (size_t)(a / k) * p->n, c->slope + (size_t)(a % k) * p->n);
    }
    for (int a = 0; a < k; a++) {
        c->scale[a] = fisher[a * k + a] > 0 ? 1 / sqrt(fisher[a * k + a]) : 0;
    }
    for (int a = 0; a < k * k; a++) {
        fisher[a] *= c->scale[a / k] * c->scale[a % k];
    }
    return cholesky_condition(k, fisher) < CONDITION_MAX && cholesky_factor(k, fisher, c->l);
}

/* Variance of what the counting noise alone does: inverse S2^T S2 inverse, S2 the slopes whitened once more. Without
 * nuisances S2 is the slopes, and this the inverse. */
static void add_noise(struct covariance *c, const struct problem *p) {
    const int k = c->k;
    double by[COORDINATES_MAX][COORDINATES_MAX];
    for (int j = 0; j < k; j++) {
        nuisance_whiten(
            p, memcpy(c->twice + (size_t)j * p->n, c->slope + (size_t)j * p->n, p->n * sizeof(double)));
    }
    for (int a = 0; a < k; a++) { /* rows of S2^T S2, then of its product with the inverse */
        for (int b = 0; b < k; b++) {
            by[a][b] = dot(p->n, c->twice + (size_t)a * p->n, c->twice + (size_t)b * p->n) * c->scale[a] *
                       c->scale[b];
        }
        cholesky_solve(k, c->l, by[a], by[a]);
    }
    for (int b = 0; b < k; b++) {
        double column[COORDINATES_MAX];
        for (int a = 0; a < k; a++) {
            column[a] = by[a][b];
        }
        cholesky_solve(k, c->l, column, column);
        for (int a = 0; a < k; a++) {
            c->statistical[a * k + b] = column[a] * c->scale[a] * c->scale[b];
        }
    }
}

/* The lamp between the control readings: the response of the coordinates to each point of a bracket, two by two. */
static void add_drift(struct covariance *c, const struct problem *p, const struct estimate_bracket *b,
                      double *room) {
    const int k = c->k;
    const size_t n = b->point ? b->n : p->n;
    for (size_t x = 0; x < n; x++) {
        const size_t i = b->point ? (size_t)b->point[x] : x;
        double *moved = room + x * COORDINATES_MAX;
        for (int j = 0; j < k; j++) {
            moved[j] = c->twice[(size_t)j * p->n + i] * p->root_weight[i] * p->model_beta[i] * c->scale[j];
        }
        cholesky_solve(k, c->l, moved, moved);
    }
    for (size_t x = 0; x < n; x++) {
        for (size_t y = 0; y < n; y++) {
            const double covariance = drift_covariance(b, x, y);
            const double *at = room + x * COORDINATES_MAX, *to = room + y * COORDINATES_MAX;
            for (int a = 0; a < k * k; a++) {
                c->statistical[a] += covariance * at[a / k] * c->scale[a / k] * to[a % k] * c->scale[a % k];
            }
        }
    }
}

/* One cause: change[i] of beta for one standard uncertainty of it; used up. */
static void add_cause(struct covariance *c, const struct problem *p, double *change) {
    const int k = c->k;
    double moved[COORDINATES_MAX];
    for (size_t i = 0; i < p->n; i++) {
        change[i] *= p->root_weight[i];
    }
    nuisance_whiten(p, change);
    for (int j = 0; j < k; j++) {
        moved[j] = dot(p->n, c->slope + (size_t)j * p->n, change) * c->scale[j];
    }
    cholesky_solve(k, c->l, moved, moved);
    for (int a = 0; a < k * k; a++) {
        c->common[a] += moved[a / k] * c->scale[a / k] * moved[a % k] * c->scale[a % k];
    }
}

static int interval_of(const struct forecast_noise *noise, size_t i) {
    return noise->interval ? noise->interval[i] : 0;
}

/* Which of the exposure times a point is read at: quarter octaves of its brightness, or the longest. */
static int rung_of(const struct covariance *c, size_t i) {
    const int longest = -1000;
    return c->longest[i] ? longest : (int)lround(4 * log2(c->peak[i]));
}

static void add_sample_darks(struct covariance *c, const struct problem *p,
                             const struct forecast_noise *noise, double *change) {
    for (size_t i = 0; i < p->n; i++) {
        const int interval = interval_of(noise, i), rung = rung_of(c, i);
        bool first = true;
        for (size_t j = 0; j < p->n; j++) {
            const bool shares = interval_of(noise, j) == interval && rung_of(c, j) == rung;
            first = first && !(shares && j < i);
            change[j] = shares ? noise->dark / c->level[j] * p->model_beta[j] : 0;
        }
        if (first) {
            add_cause(c, p, change);
        }
    }
}

static void add_reference_darks(struct covariance *c, const struct problem *p,
                                const struct forecast_noise *noise, double *change) {
    for (size_t i = 0; i < p->n; i++) {
        const int interval = interval_of(noise, i);
        bool first = true;
        for (size_t j = 0; j < p->n; j++) {
            first = first && !(interval_of(noise, j) == interval && j < i);
            change[j] = interval_of(noise, j) == interval ? noise->dark * p->model_beta[j] : 0;
        }
        if (first) {
            add_cause(c, p, change);
        }
    }
}

/* What linearisation leaves grows with the level, and a reference is at its target. */
static void add_linearity(struct covariance *c, const struct problem *p, const struct forecast_noise *noise,
                          double *change) {
    for (size_t i = 0; i < p->n; i++) {
        change[i] = noise->linearity * (c->level[i] - 1) * p->model_beta[i];
    }
    add_cause(c, p, change);
}

static void add_controls(struct covariance *c, const struct problem *p, const struct forecast_noise *noise,
                         double *change) {
    for (size_t x = 0; x < noise->n_controls; x++) {
        for (size_t i = 0; i < p->n; i++) {
            change[i] = noise->control[x * p->n + i] * p->model_beta[i];
        }
        add_cause(c, p, change);
    }
}

static void add_causes(struct covariance *c, const struct problem *p, double certificate_rel,
                       const double *none, double *change) {
    struct nuisance_cause own[NUISANCE_CAUSES];
    const int n_own = nuisance_causes(p, none, own);
    for (size_t i = 0; i < p->n; i++) {
        change[i] = certificate_rel * p->model_beta[i];
    }
    add_cause(c, p, change);
    for (int x = 0; x < n_own; x++) {
        for (size_t i = 0; i < p->n; i++) {
            change[i] = own[x].u * (own[x].slope[i] + own[x].spot[i]);
        }
        add_cause(c, p, change);
    }
}

static int add_all(struct covariance *c, const struct problem *p, const struct forecast_noise *noise,
                   double certificate_rel, double *change, struct err *e) {
    const struct estimate_input *in = p->input;
    double *room = calloc((p->n + 1) * COORDINATES_MAX, sizeof *room);
    if (!room) {
        return err_set(e, ERR_NOMEM, "no memory for a forecast of %zu points", p->n);
    }
    add_causes(c, p, certificate_rel, room, change);
    add_noise(c, p);
    for (size_t b = 0; b < in->n_bracket; b++) {
        add_drift(c, p, &in->bracket[b], room);
    }
    if (noise->dark > 0) {
        add_sample_darks(c, p, noise, change);
        add_reference_darks(c, p, noise, change);
    }
    add_linearity(c, p, noise, change);
    add_controls(c, p, noise, change);
    free(room);
    return 0;
}

/* Variance of parameter column j: chain C chain^T. */
static double variance(const struct covariance *c, const double *cells, int i, int j) {
    double sum = 0;
    for (int a = 0; a < c->k; a++) {
        for (int b = 0; b < c->k; b++) {
            sum += c->chain[i * c->k + a] * cells[a * c->k + b] * c->chain[j * c->k + b];
        }
    }
    return sum;
}

static const char *name_of(const struct problem *p, int column) {
    enum material_parameter at = reflectance_parameter(p->model, column);
    return at == MATERIAL_BETA_PRIME ? "beta'" : material_parameter_name(p->input->model, at);
}

/* The parameter that takes column's part most closely, by the independent part. */
static double closest(const struct covariance *c, int column, int *other) {
    double most = 0;
    for (int j = 0; j < c->k; j++) {
        double both = sqrt(variance(c, c->statistical, column, column) * variance(c, c->statistical, j, j));
        double rho = j == column || both == 0 ? 0 : variance(c, c->statistical, column, j) / both;
        if (fabs(rho) > fabs(most)) {
            most = rho;
            *other = j;
        }
    }
    return most;
}

static void judge(const struct covariance *c, const struct problem *p, struct forecast *f) {
    for (int j = 0; j < c->k; j++) {
        const enum material_parameter at = reflectance_parameter(p->model, j);
        const double size = coordinates_scale(p->model, c->value, j);
        int other = j;
        const double rho = closest(c, j, &other);
        f->statistical[at] = sqrt(variance(c, c->statistical, j, j));
        f->common[at] = sqrt(variance(c, c->common, j, j));
        f->u[at] = hypot(f->statistical[at], f->common[at]);
        if (fabs(rho) > CORRELATION_MAX) {
            snprintf(f->why[at], sizeof f->why[at],
                     "at these angles it cannot be told from %s (correlation %.5f): its u rests on a model "
                     "without error",
                     name_of(p, other), rho);
        } else if (!(f->u[at] <= U_LN_MAX * size)) {
            snprintf(f->why[at], sizeof f->why[at], "its u is %.0f %% of %s%s",
                     100 * fmin(f->u[at] / size, 1e4), name_of(p, j), at == MATERIAL_N ? " - 1" : "");
        }
        f->not_identifiable[at] = f->why[at][0] != 0;
    }
}

static void know_nothing(const struct problem *p, struct forecast *f) {
    for (int j = 0; j < p->k; j++) {
        const enum material_parameter at = reflectance_parameter(p->model, j);
        f->u[at] = f->statistical[at] = INFINITY;
        f->not_identifiable[at] = true;
        snprintf(f->why[at], sizeof f->why[at], "these angles do not determine the model's %d parameters",
                 p->k);
    }
}

static int advise(const struct covariance *c, const struct problem *p, struct forecast *f, struct err *e) {
    int status = 0;
    for (int j = 0; j < p->k && !status; j++) {
        const enum material_parameter at = reflectance_parameter(p->model, j);
        if (f->not_identifiable[at]) {
            status = suggest_next(p, c->value, c->fisher, j, &f->next[at], e);
        }
    }
    return status;
}

static int forecast_problem(struct problem *p, const struct forecast_noise *noise, double certificate_rel,
                            const double *value, double *readings, bool *longest, struct forecast *f,
                            struct err *e) {
    struct covariance c = {.k = p->k,
                           .longest = longest,
                           .peak = readings + 3 * p->n,
                           .level = readings + 4 * p->n,
                           .slope = readings + 5 * p->n,
                           .twice = readings + (5 + COORDINATES_MAX) * p->n};
    double *beta = readings, *u = readings + p->n, *change = readings + 2 * p->n;
    int status = fill_readings(p, noise, value, beta, u, &c, e);
    if (status || (status = problem_reweigh(p, value, e))) {
        return status;
    }
    memcpy(c.value, value, sizeof c.value);
    coordinates_chain(p->model, value, c.chain);
    take_slopes(&c, p);
    if (!invert(&c, p)) {
        know_nothing(p, f);
        return advise(&c, p, f, e);
    }
    if ((status = add_all(&c, p, noise, certificate_rel, change, e))) {
        return status;
    }
    judge(&c, p, f);
    return advise(&c, p, f, e);
}

int forecast_make(const struct estimate_input *angles, const struct forecast_noise *noise,
                  double certificate_rel, const double *value, struct forecast *forecast, struct err *e) {
    struct problem p;
    struct estimate_input in = *angles;
    *forecast = (struct forecast){0};
    double *readings = calloc((5 + 2 * COORDINATES_MAX) * (angles->n + 1), sizeof *readings);
    bool *longest = calloc(angles->n + 1, sizeof *longest);
    if (!readings || !longest) {
        free(readings);
        free(longest);
        return err_set(e, ERR_NOMEM, "no memory for a forecast of %zu points", angles->n);
    }
    for (size_t i = 0; i < 2 * angles->n; i++) {
        readings[i] = 1;
    }
    in.beta = readings;
    in.u_ind = readings + angles->n;
    int status = problem_init(&p, &in, e);
    if (!status) {
        status = forecast_problem(&p, noise, certificate_rel, value, readings, longest, forecast, e);
        problem_free(&p);
    }
    free(readings);
    free(longest);
    return status;
}
