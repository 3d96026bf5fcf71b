#include "daemon/replay_private.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/drift.h"
#include "proto/units.h"

#define SLOPE_STEP_DEG 0.02

struct slopes {                     /* of the visible mean, as source and sensor see the surface */
    double of[2];                   /* per degree of each axis: source, sample */
    double by[MATERIAL_PARAMETERS]; /* per unit of each parameter of the estimate */
};

static double seen(const struct recording *r, double theta_i_deg, double theta_v_deg) {
    return simulate_surface_mean(&r->surface[0].surface, &r->form, theta_i_deg, theta_v_deg, r->mean_nm);
}

/* A mirrored geometry has both axes negated, and so both slopes. */
static void find_slopes(const struct recording *r, const struct replay_point *p, struct slopes *s) {
    const double i = p->theta_i_deg, v = p->theta_v_deg, h = SLOPE_STEP_DEG;
    double by_i = (seen(r, i + h, v) - seen(r, i - h, v)) / (2 * h);
    double by_v = (seen(r, i, v + h) - seen(r, i, v - h)) / (2 * h);
    double sign = p->mirrored ? -1 : 1;
    *s = (struct slopes){0};
    if (!isfinite(by_i) || !isfinite(by_v))
        return; /* at grazing angles the surface has no slope to speak of */
    s->of[0] = sign * by_i;
    s->of[1] = sign * (by_v - by_i);
}

static void find_gradient(const struct recording *r, const struct replay_point *p, struct slopes *s) {
    const struct estimate *m = &r->estimate;
    enum reflectance_model model;
    const struct reflectance_optics optics = {m->kappa, m->q, m->polarisation};
    double beta, gradient[MATERIAL_PARAMETERS];
    if (reflectance_find(m->model, &model, NULL) < 0 ||
        aperture_at(&r->form, p->theta_i_deg, p->theta_v_deg, model, m->value, &optics, &beta, gradient,
                    NULL) < 0)
        return;
    for (int j = 0; j < reflectance_parameters(model); j++)
        s->by[reflectance_parameter(model, j)] = gradient[j];
}

/* What the uncertainty of the estimate leaves open. Where a covariance is not known the parameter stays as it is. */
static double of_estimate(const struct estimate *m, const struct slopes *a, const struct slopes *b) {
    double sum = 0;
    for (int i = 0; i < MATERIAL_PARAMETERS; i++)
        for (int k = 0; k < MATERIAL_PARAMETERS; k++) {
            double c = a->by[i] * b->by[k];
            c = c != 0 ? c * (m->statistical[i][k] + m->common[i][k]) : 0;
            sum += isfinite(c) ? c : 0;
        }
    return sum;
}

static double product(const struct slopes *a, const struct slopes *b, const double u_deg[2]) {
    return a->of[0] * b->of[0] * u_deg[0] * u_deg[0] + a->of[1] * b->of[1] * u_deg[1] * u_deg[1];
}

static double drift(const struct derived_point *p, const struct derived_point *q) {
    const double tau_us[2] = {p->tau_us, q->tau_us}, tau_r_us[2] = {p->tau_r_us, q->tau_r_us};
    const struct estimate_bracket b = {
        .n = 2, .tau_us = tau_us, .tau_r_us = tau_r_us, .length_us = p->length_us, .rate = p->rate};
    return p->bracket == q->bracket ? drift_covariance(&b, 0, 1) * p->mean * q->mean : 0;
}

/* What two points of one side share. */
static double shared(const struct derived_point *p, const struct derived_point *q) {
    double sum = drift(p, q);
    for (int i = 0; i < p->n_common; i++)
        for (int k = 0; k < q->n_common; k++)
            if (p->common[i].cause == q->common[k].cause)
                sum += p->common[i].mean * q->common[k].mean;
    return sum;
}

struct sides {
    const struct recording *recording;
    const struct derived *measured, *simulated;
    bool estimated;
    const struct slopes *slopes; /* of each point */
};

static double covariance(const struct sides *s, const struct replay *r, int i, int k) {
    const int *a = r->point[i].row, *b = r->point[k].row;
    double c = shared(&s->measured->point[a[0]], &s->measured->point[b[0]]) +
               shared(&s->simulated->point[a[1]], &s->simulated->point[b[1]]);
    if (!s->estimated)
        return c;
    return c + product(&s->slopes[i], &s->slopes[k], s->recording->u_zero_deg) +
           of_estimate(&s->recording->estimate, &s->slopes[i], &s->slopes[k]);
}

static double independent(const struct sides *s, const struct replay *r, int i) {
    const int *row = r->point[i].row;
    return s->measured->point[row[0]].variance + s->simulated->point[row[1]].variance +
           2 * product(&s->slopes[i], &s->slopes[i], s->recording->u_repeat_deg);
}

int replay_covariance(double *v, struct replay *r, const struct recording *recording,
                      enum replay_surface surface, const struct derived *measured,
                      const struct derived *simulated, struct err *e) {
    struct slopes *slopes = calloc(r->n, sizeof *slopes);
    const struct sides sides = {recording, measured, simulated, surface == REPLAY_ESTIMATE, slopes};
    if (!slopes)
        return err_set(e, ERR_NOMEM, "no memory for the slopes of %d points", r->n);
    for (int i = 0; i < r->n; i++) {
        struct replay_point *p = &r->point[i];
        double *row = v + (size_t)i * r->n;
        find_slopes(recording, p, &slopes[i]);
        if (sides.estimated)
            find_gradient(recording, p, &slopes[i]);
        for (int k = 0; k <= i; k++)
            row[k] = covariance(&sides, r, i, k);
        row[i] += independent(&sides, r, i);
        p->u = sqrt(row[i]);
        p->z = (p->measured - p->simulated) / p->u;
    }
    free(slopes);
    return 0;
}

/* ---- linear algebra ---- */

static int factorise(double *v, int n) {
    for (int i = 0; i < n; i++)
        for (int k = 0; k <= i; k++) {
            double *row = v + (size_t)i * n, *other = v + (size_t)k * n, sum = row[k];
            for (int j = 0; j < k; j++)
                sum -= row[j] * other[j];
            if (i == k && !(sum > 0))
                return -ERR_RANGE;
            row[k] = i == k ? sqrt(sum) : sum / other[k];
        }
    return 0;
}

/* Lower triangle, in place, row by row: row i of the inverse needs only rows above it. */
static void invert(double *v, int n) {
    for (int i = 0; i < n; i++) {
        double *row = v + (size_t)i * n, diagonal = 1 / row[i];
        for (int k = 0; k < i; k++) {
            double sum = 0;
            for (int j = k; j < i; j++)
                sum += row[j] * v[(size_t)j * n + k];
            row[k] = -sum * diagonal;
        }
        row[i] = diagonal;
    }
}

int replay_whiten(double *v, int n, struct err *e) {
    if (factorise(v, n) < 0)
        return err_set(e, ERR_RANGE, "the uncertainties of the points contradict each other");
    invert(v, n);
    return 0;
}
