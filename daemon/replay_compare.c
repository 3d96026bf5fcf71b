#include "daemon/replay_private.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/quality.h"
#include "proto/units.h"

#define Z_99 2.326
#define SPOILT_SHARE 10 /* one point in so many may be called spoilt; beyond that the whole differs */

/* ---- pairs ---- */

static int counterpart(const struct derived *in, const struct derived_point *p) {
    for (int i = 0; i < in->n; i++) {
        const struct derived_point *q = &in->point[i];
        if (q->theta_i_udeg == p->theta_i_udeg && q->theta_v_udeg == p->theta_v_udeg &&
            q->mirrored == p->mirrored && q->nth == p->nth)
            return i;
    }
    return -1;
}

static int by_geometry(const void *a, const void *b) {
    const struct replay_point *p = a, *q = b;
    if (p->theta_i_deg != q->theta_i_deg)
        return p->theta_i_deg < q->theta_i_deg ? -1 : 1;
    if (p->theta_v_deg != q->theta_v_deg)
        return p->theta_v_deg < q->theta_v_deg ? -1 : 1;
    return p->exposure_id < q->exposure_id ? -1 : p->exposure_id > q->exposure_id;
}

static int pair(struct replay *r, const struct derived *measured, const struct derived *simulated,
                struct err *e) {
    r->point = calloc(measured->n + 1, sizeof *r->point);
    if (!r->point)
        return err_set(e, ERR_NOMEM, "no memory for %d points", measured->n);
    for (int i = 0; i < measured->n; i++) {
        const struct derived_point *m = &measured->point[i];
        int k = counterpart(simulated, m);
        if (k < 0)
            r->n_missing++;
        else
            r->point[r->n++] = (struct replay_point){.theta_i_deg = deg_from_udeg(m->theta_i_udeg),
                                                     .theta_v_deg = deg_from_udeg(m->theta_v_udeg),
                                                     .mirrored = m->mirrored,
                                                     .step = m->step,
                                                     .exposure_id = m->exposure_id,
                                                     .measured = m->mean,
                                                     .simulated = simulated->point[k].mean,
                                                     .row = {i, k}};
    }
    qsort(r->point, r->n, sizeof *r->point, by_geometry);
    if (r->n == 0)
        return err_set(e, ERR_INPUT, "the session holds no final point that could be simulated");
    return 0;
}

/* ---- each point for itself ---- */

static int ascending(const void *a, const void *b) {
    const double *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

static double median(double *value, int n) {
    qsort(value, n, sizeof *value, ascending);
    return (value[(n - 1) / 2] + value[n / 2]) / 2;
}

static void find_medians(struct replay *r, double *room) {
    int inside = 0;
    for (int i = 0; i < r->n; i++) {
        room[i] = fabs(r->point[i].z);
        inside += room[i] <= 2;
    }
    r->within_2u = inside / (double)r->n;
    r->median_z = median(room, r->n);
    for (int i = 0; i < r->n; i++) {
        const struct replay_point *p = &r->point[i];
        room[i] = fabs(p->measured - p->simulated) / fmax(fabs(p->measured), 0.005); /* measurement.md 10 */
    }
    r->median_relative = median(room, r->n);
}

static void add_to_sweep(struct replay *r, const struct replay_point *p) {
    struct replay_sweep *s = r->n_sweeps ? &r->sweep[r->n_sweeps - 1] : NULL;
    if (!s || s->theta_i_deg != p->theta_i_deg) {
        if (r->n_sweeps == REPLAY_SWEEPS)
            return;
        s = &r->sweep[r->n_sweeps++];
        *s = (struct replay_sweep){.theta_i_deg = p->theta_i_deg};
    }
    s->mean_z = (s->mean_z * s->n + p->z) / (s->n + 1);
    s->chi2 += p->z * p->z;
    s->n++;
}

/* ---- all together, shared parts apart ---- */

struct whitened { /* root * measured, root * simulated; their difference has independent unit variances */
    int n;
    double *root, *measured, *simulated;
};

static void multiply(struct whitened *w, const struct replay *r) {
    for (int i = 0; i < w->n; i++)
        for (int k = 0; k <= i; k++) {
            double c = w->root[(size_t)i * w->n + k];
            w->measured[i] += c * r->point[k].measured;
            w->simulated[i] += c * r->point[k].simulated;
        }
}

static double chi2_of(const struct whitened *w, double factor) {
    double sum = 0;
    for (int i = 0; i < w->n; i++) {
        double y = w->measured[i] - factor * w->simulated[i];
        sum += y * y;
    }
    return sum;
}

/* Weighted point by point: with V, which may itself hold a common factor, the weights would pull it away from 1. */
static double factor_of(const struct replay *r) {
    double up = 0, down = 0;
    for (int i = 0; i < r->n; i++) {
        const struct replay_point *p = &r->point[i];
        up += p->measured * p->simulated / (p->u * p->u);
        down += p->simulated * p->simulated / (p->u * p->u);
    }
    return up / down;
}

/* An error of the model changes slowly from view to view; noise, or a point that was spoilt, does not. */
static void look_along(struct replay *r, const struct whitened *w) {
    double together = 0, squares = 0;
    int pairs = 0;
    for (int i = 0; i < r->n; i++) {
        double y = w->measured[i] - w->simulated[i];
        squares += y * y;
        if (i + 1 == r->n || r->point[i + 1].theta_i_deg != r->point[i].theta_i_deg)
            continue;
        together += y * (w->measured[i + 1] - w->simulated[i + 1]);
        pairs++;
    }
    r->along = squares > 0 ? together / squares : 0;
    r->along_limit = pairs ? Z_99 / sqrt(pairs) : 1;
}

/* ---- single points against all others ---- */

struct others { /* W = V^-1 and W d; a point taken out is one of infinite variance */
    int n;
    double *w, *wd, chi2;
};

static void prepare_others(struct others *o, const struct replay *r, const double *root) {
    int n = o->n = r->n;
    for (int i = 0; i < n; i++)
        for (int k = 0; k < n; k++) {
            double sum = 0;
            for (int j = i > k ? i : k; j < n; j++)
                sum += root[(size_t)j * n + i] * root[(size_t)j * n + k];
            o->w[(size_t)i * n + k] = sum;
            o->wd[i] += sum * (r->point[k].measured - r->point[k].simulated);
        }
    for (int i = 0; i < n; i++)
        o->chi2 += o->wd[i] * (r->point[i].measured - r->point[i].simulated);
}

static double against_others(const struct others *o, int k) {
    double w = o->w[(size_t)k * o->n + k];
    return w > 0 ? o->wd[k] / sqrt(w) : 0;
}

static int most_unlike(const struct others *o) {
    int worst = 0;
    for (int k = 1; k < o->n; k++)
        if (fabs(against_others(o, k)) > fabs(against_others(o, worst)))
            worst = k;
    return worst;
}

static void take_out(struct others *o, int k, double *column) {
    double w = o->w[(size_t)k * o->n + k], share = o->wd[k] / w;
    o->chi2 -= o->wd[k] * share;
    for (int i = 0; i < o->n; i++)
        column[i] = o->w[(size_t)i * o->n + k];
    for (int i = 0; i < o->n; i++) {
        o->wd[i] -= column[i] * share;
        for (int j = 0; j < o->n; j++)
            o->w[(size_t)i * o->n + j] -= column[i] * column[j] / w;
    }
    for (int i = 0; i < o->n; i++) /* what rounding leaves of it */
        o->w[(size_t)i * o->n + k] = o->w[(size_t)k * o->n + i] = 0;
    o->wd[k] = 0;
}

/* Whether the rest agrees once the spoilt points are out. */
static bool few_are_spoilt(struct replay *r, struct others *o, double *column) {
    int worst = most_unlike(o);
    while (fabs(against_others(o, worst)) > REPLAY_Z_MAX && r->n_beyond * SPOILT_SHARE < r->n) {
        take_out(o, worst, column);
        r->n_beyond++;
        worst = most_unlike(o);
    }
    int rest = r->n - r->n_beyond;
    return r->n_beyond > 0 && rest > 0 && fabs(against_others(o, worst)) <= REPLAY_Z_MAX &&
           o->chi2 <= quality_chi2_limit(rest, 2.0 * rest);
}

/* ---- what it looks like ---- */

static bool points_agree(const struct replay *r) {
    for (int i = 0; i < r->n; i++)
        if (fabs(r->point[i].z) > REPLAY_Z_MAX || fabs(r->point[i].t) > REPLAY_Z_MAX)
            return false;
    return true;
}

static enum replay_cause find_cause(struct replay *r, const struct whitened *w, struct others *o,
                                    double *column) {
    if (r->chi2 <= r->chi2_limit && points_agree(r))
        return r->n_missing ? REPLAY_MISSING : REPLAY_AGREES;
    if (chi2_of(w, r->factor) <= r->chi2_limit)
        return REPLAY_FACTOR;
    if (r->along > r->along_limit)
        return REPLAY_MODEL;
    return few_are_spoilt(r, o, column) ? REPLAY_POINTS : REPLAY_SCATTER;
}

static void judge(struct replay *r, struct whitened *w, struct others *o, double *column) {
    find_medians(r, column);
    for (int i = 0; i < r->n; i++)
        add_to_sweep(r, &r->point[i]);
    multiply(w, r);
    prepare_others(o, r, w->root);
    for (int i = 0; i < r->n; i++)
        r->point[i].t = against_others(o, i);
    look_along(r, w);
    r->factor = factor_of(r);
    r->chi2 = chi2_of(w, 1);
    r->chi2_limit = quality_chi2_limit(r->n, 2.0 * r->n);
    r->cause = find_cause(r, w, o, column);
}

int replay_compare(struct replay *r, const struct recording *recording, enum replay_surface surface,
                   const struct derived *measured, const struct derived *simulated, struct err *e) {
    int rc = pair(r, measured, simulated, e);
    if (rc < 0)
        return rc;
    size_t n = (size_t)r->n;
    double *room = calloc(2 * n * n + 4 * n, sizeof *room);
    if (!room)
        return err_set(e, ERR_NOMEM, "no memory for the covariance of %d points", r->n);
    struct whitened w = {r->n, room, room + 2 * n * n, room + 2 * n * n + n};
    struct others o = {.w = room + n * n, .wd = room + 2 * n * n + 2 * n};
    r->identical =
        measured->size == simulated->size && !memcmp(measured->rows, simulated->rows, measured->size);
    rc = replay_covariance(w.root, r, recording, surface, measured, simulated, e);
    if (rc == 0)
        rc = replay_whiten(w.root, r->n, e);
    if (rc == 0)
        judge(r, &w, &o, room + 2 * n * n + 3 * n);
    free(room);
    return rc;
}
