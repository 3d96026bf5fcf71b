#include "fit/start.h"

#include <math.h>
#include <string.h>

#define START_N 1.5 /* a paint binder; n follows from the data afterwards */

static const double gammas[] = {0.015, 0.03, 0.06, 0.12, 0.25, 0.5};
static const double sigmas[] = {0.1, 0.4};

struct candidate {
    double value[MATERIAL_PARAMETERS];
    double chi2;
};

/* Weighted normal equations of beta = S diffuse + b specular. */
struct normal {
    double dd, ds, ss, dy, sy, yy;
};

static void add_row(struct normal *m, double diffuse, double specular, double y) {
    m->dd += diffuse * diffuse;
    m->ds += diffuse * specular;
    m->ss += specular * specular;
    m->dy += diffuse * y;
    m->sy += specular * y;
    m->yy += y * y;
}

/* S and beta' of a normal equation, neither negative. Returns chi2. */
static double solve_pair(const struct normal *m, double *s, double *b) {
    double det = m->dd * m->ss - m->ds * m->ds;
    *s = 0;
    *b = 0;
    if (det > 1e-14 * m->dd * m->ss) {
        *s = (m->dy * m->ss - m->sy * m->ds) / det;
        *b = (m->sy * m->dd - m->dy * m->ds) / det;
    }
    if (*s <= 0 || *b <= 0) {
        *s = m->dd > 0 ? fmax(m->dy / m->dd, 0) : 0;
        *b = 0;
    }
    return m->yy - 2 * (*s * m->dy + *b * m->sy) + *s * *s * m->dd + 2 * *s * *b * m->ds + *b * *b * m->ss;
}

static bool model_has(enum reflectance_model model, enum material_parameter parameter) {
    for (int j = 0; j < reflectance_parameters(model); j++) {
        if (reflectance_parameter(model, j) == parameter) {
            return true;
        }
    }
    return false;
}

static void try_candidate(const struct problem *p, struct candidate *c) {
    struct normal m = {0};
    double unit[MATERIAL_PARAMETERS];
    memcpy(unit, c->value, sizeof unit);
    unit[MATERIAL_S] = unit[MATERIAL_BETA_PRIME] = 1;
    for (size_t i = 0; i < p->n; i++) {
        struct reflectance_parts parts = {0};
        aperture_parts(&p->aperture, i, p->model, unit, p->kappa, 0, &parts, NULL);
        double w = p->root_weight[i];
        add_row(&m, w * parts.diffuse, w * parts.specular, w * p->input->beta[i]);
    }
    c->chi2 = solve_pair(&m, &c->value[MATERIAL_S], &c->value[MATERIAL_BETA_PRIME]);
    c->value[MATERIAL_S] = fmax(c->value[MATERIAL_S], 1e-3);
    /* A start without any lobe could not grow one: the bottom of ln A is flat. */
    c->value[MATERIAL_BETA_PRIME] = fmax(c->value[MATERIAL_BETA_PRIME], 0.01);
}

static void insert(struct candidate *best, int *n, const struct candidate *c) {
    int at = *n < START_MAX ? (*n)++ : START_MAX;
    if (at == START_MAX) {
        if (c->chi2 >= best[START_MAX - 1].chi2) {
            return;
        }
        at = START_MAX - 1;
    }
    for (; at > 0 && c->chi2 < best[at - 1].chi2; at--) {
        best[at] = best[at - 1];
    }
    best[at] = *c;
}

int start_find(const struct problem *p, double x[START_MAX][COORDINATES_MAX]) {
    struct candidate best[START_MAX + 1];
    int n = 0;
    int n_gamma = model_has(p->model, MATERIAL_GAMMA) ? sizeof gammas / sizeof *gammas : 1;
    int n_sigma = model_has(p->model, MATERIAL_SIGMA) ? sizeof sigmas / sizeof *sigmas : 1;
    for (int i = 0; i < n_gamma; i++) {
        struct candidate of_gamma = {.chi2 = INFINITY};
        for (int j = 0; j < n_sigma; j++) {
            struct candidate c = {.value = {0, sigmas[j], gammas[i], 0, START_N}};
            try_candidate(p, &c);
            if (j == 0 || c.chi2 < of_gamma.chi2) {
                of_gamma = c;
            }
        }
        insert(best, &n, &of_gamma);
    }
    for (int i = 0; i < n; i++) {
        coordinates_from_value(p->model, best[i].value, x[i]);
    }
    return n;
}
