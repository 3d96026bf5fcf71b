#include "daemon/replay_private.h"

#include <math.h>
#include <string.h>

#include "fit/drift.h"
#include "proto/units.h"

#define SLOPE_STEP_DEG 0.02

struct slopes { /* of the surface's visible mean, per degree of each axis: source, sample */
    double of[2];
};

/* A mirrored geometry has both axes negated, and so both slopes. */
static struct slopes slopes_at(const struct recording *r, const struct replay_point *p) {
    const struct simulate_surface *f = &r->surface[0].surface;
    const double i = p->theta_i_deg, v = p->theta_v_deg, h = SLOPE_STEP_DEG;
    const int *nm = r->mean_nm;
    double by_i = (simulate_surface_mean(f, i + h, v, nm) - simulate_surface_mean(f, i - h, v, nm)) / (2 * h);
    double by_v = (simulate_surface_mean(f, i, v + h, nm) - simulate_surface_mean(f, i, v - h, nm)) / (2 * h);
    double sign = p->mirrored ? -1 : 1;
    bool known =
        isfinite(by_i) && isfinite(by_v); /* at grazing angles the surface has no slope to speak of */
    return known ? (struct slopes){{sign * by_i, sign * (by_v - by_i)}} : (struct slopes){{0, 0}};
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

void replay_covariance(double *v, struct replay *r, const struct recording *recording,
                       enum replay_surface surface, const struct derived *measured,
                       const struct derived *simulated) {
    for (int i = 0; i < r->n; i++) {
        struct replay_point *p = &r->point[i];
        const struct derived_point *pm = &measured->point[p->row[0]], *ps = &simulated->point[p->row[1]];
        const struct slopes a = slopes_at(recording, p);
        for (int k = 0; k <= i; k++) {
            const struct replay_point *q = &r->point[k];
            const struct slopes b = slopes_at(recording, q);
            double *c = &v[(size_t)i * r->n + k];
            *c = shared(pm, &measured->point[q->row[0]]) + shared(ps, &simulated->point[q->row[1]]);
            if (surface == REPLAY_ESTIMATE)
                *c += product(&a, &b, recording->u_zero_deg);
        }
        double *own = &v[(size_t)i * r->n + i];
        *own += pm->variance + ps->variance + 2 * product(&a, &a, recording->u_repeat_deg);
        p->u = sqrt(*own);
        p->z = (p->measured - p->simulated) / p->u;
    }
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
