#include "fit/suggest.h"

#include <math.h>
#include <stdlib.h>

#include "fit/cholesky.h"
#include "proto/units.h"

#define BLIND_DEG 8.0 /* a usual lamp housing in front of the sensor (reflection-model.md 5.1) */
#define KNOWN_BEFORE                                                                                         \
    0.01 /* of every coordinate's Fisher information: a factor e^10 keeps an empty direction finite */
#define STEP_DEG 5
#define VIEW_DEG 80

struct search {
    const struct problem *p;
    const double *value;
    int k, column;
    double chain[COORDINATES_MAX * COORDINATES_MAX];
    double l[COORDINATES_MAX * COORDINATES_MAX],
        scale[COORDINATES_MAX]; /* of the Fisher matrix, unit diagonal */
    double relative;            /* what a new point will be known to, as a share of its value */
    double gain;                /* of the best so far */
    struct suggestion *next;
};

static int ascending(const void *a, const void *b) {
    const double *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

/* The set's own median. */
static int find_relative(struct search *s, struct err *e) {
    const size_t n = s->p->n;
    double *all = malloc((n + 1) * sizeof *all);
    if (!all) {
        return err_set(e, ERR_NOMEM, "no memory to search for the next geometry");
    }
    for (size_t i = 0; i < n; i++) {
        all[i] = s->p->u[i] / fmax(fabs(s->p->input->beta[i]), 0.005);
    }
    qsort(all, n, sizeof *all, ascending);
    s->relative = n > 0 ? all[n / 2] : 0.01;
    free(all);
    return 0;
}

static int factor(struct search *s, const double *fisher, struct err *e) {
    double a[COORDINATES_MAX * COORDINATES_MAX];
    const int k = s->k;
    for (int j = 0; j < k; j++) {
        s->scale[j] = 1 / sqrt(fisher[j * k + j] + KNOWN_BEFORE);
    }
    for (int c = 0; c < k * k; c++) {
        a[c] = (fisher[c] + (c / k == c % k ? KNOWN_BEFORE : 0)) * s->scale[c / k] * s->scale[c % k];
    }
    for (double more = 1e-15; !cholesky_factor(k, a, s->l);
         more *= 10) { /* rounding ate what was known before */
        if (more > 1e-3) {
            return err_set(e, ERR_FIT, "the Fisher information of these points is no number");
        }
        for (int j = 0; j < k; j++) {
            a[j * k + j] += more;
        }
    }
    return 0;
}

/* What one point there would take off the variance. */
static void try_at(struct search *s, double i_deg, double v_deg) {
    double beta = 0, gradient[MATERIAL_PARAMETERS] = {0}, row[COORDINATES_MAX], moved[COORDINATES_MAX];
    const struct problem *p = s->p;
    if (fabs(i_deg + v_deg) < BLIND_DEG || fabs(v_deg) > VIEW_DEG ||
        aperture_at(&p->aperture.form, i_deg, v_deg, p->model, s->value, &p->optics, &beta, gradient, NULL)) {
        return;
    }
    for (int j = 0; j < s->k; j++) {
        row[j] = 0;
        for (int c = 0; c < s->k; c++) {
            row[j] += gradient[c] * s->chain[c * s->k + j] * s->scale[j];
        }
    }
    cholesky_solve(s->k, s->l, row, moved);
    double own = pow(s->relative * beta, 2) + pow(s->relative * 0.005, 2);
    for (int j = 0; j < s->k; j++) {
        own += row[j] * moved[j];
    }
    const double gain = moved[s->column] * moved[s->column] / own;
    if (gain > s->gain) {
        s->gain = gain;
        *s->next = (struct suggestion){i_deg, v_deg};
    }
}

/* Every 5 deg, and the flanks of the lobe, which a step may miss. */
static void try_incidence(struct search *s, double i_deg) {
    static const double widths[] = {-1.5, -0.8, 0.8, 1.5};
    for (int v_deg = -VIEW_DEG; v_deg <= VIEW_DEG; v_deg += STEP_DEG) {
        try_at(s, i_deg, v_deg);
    }
    if (reflectance_column(s->p->model, MATERIAL_GAMMA) < 0) {
        return;
    }
    /* phi is half of theta_v - theta_i */
    const double half_width_deg = 2 * deg_from_rad(s->value[MATERIAL_GAMMA]);
    for (size_t w = 0; w < sizeof widths / sizeof *widths; w++) {
        try_at(s, i_deg, round(2 * (i_deg + widths[w] * half_width_deg)) / 2); /* to 0.5 deg */
    }
}

int suggest_next(const struct problem *p, const double *value, const double *fisher, int column,
                 struct suggestion *next, struct err *e) {
    struct search s = {.p = p, .value = value, .k = p->k, .column = column, .gain = -1, .next = next};
    double reach_deg = 60;
    int status = find_relative(&s, e);
    if (status || (status = factor(&s, fisher, e))) {
        return status;
    }
    coordinates_chain(p->model, value, s.chain);
    for (size_t i = 0; i < p->n; i++) {
        reach_deg = fmax(reach_deg, p->input->theta_i_deg[i]);
    }
    for (double i_deg = 10; i_deg <= reach_deg; i_deg += STEP_DEG) {
        try_incidence(&s, i_deg);
    }
    return 0;
}
