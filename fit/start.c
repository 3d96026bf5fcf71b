#include "fit/start.h"

#include <math.h>
#include <string.h>

#define COUNT(array) ((int)(sizeof(array) / sizeof *(array)))
#define START_N 1.5 /* a paint binder; n follows from the data afterwards */

static const double gammas[] = {0.015, 0.03, 0.06, 0.12, 0.25, 0.5};
static const double sigmas[] = {0.1, 0.4};

/* What the richer models have beyond the composite. A second lobe starts as a multiple of the first, in width
 * and in height: both heights then follow from one linear fit. */
static const struct extra {
    double tail, n_d, width_ratio, height_ratio;
} extras[] = {{0.2, 1.2, 3, 0.2}, {1, 1.6, 4, 0.02}};

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

static void try_candidate(const struct problem *p, struct candidate *c) {
    struct normal m = {0};
    double unit[MATERIAL_PARAMETERS];
    memcpy(unit, c->value, sizeof unit);
    unit[MATERIAL_S] = unit[MATERIAL_BETA_PRIME] = 1;
    unit[MATERIAL_EXTRA_2] = c->value[MATERIAL_EXTRA_2];
    const struct reflectance_optics linear = {.kappa = p->optics.kappa,
                                              .polarisation = p->optics.polarisation};
    for (size_t i = 0; i < p->n; i++) {
        struct reflectance_parts parts = {0};
        aperture_parts(&p->aperture, i, p->model, unit, &linear, &parts, NULL);
        double w = p->root_weight[i];
        add_row(&m, w * parts.diffuse, w * parts.specular, w * p->input->beta[i]);
    }
    c->chi2 = solve_pair(&m, &c->value[MATERIAL_S], &c->value[MATERIAL_BETA_PRIME]);
    c->value[MATERIAL_S] = fmax(c->value[MATERIAL_S], 1e-3);
    /* A start without any lobe could not grow one: the bottom of ln A is flat. */
    c->value[MATERIAL_BETA_PRIME] = fmax(c->value[MATERIAL_BETA_PRIME], 0.01);
    c->value[MATERIAL_EXTRA_2] *= c->value[MATERIAL_BETA_PRIME];
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

static void set_extra(enum reflectance_model model, const struct extra *x, double *value) {
    switch (reflectance_kind(model, MATERIAL_EXTRA_1)) {
    case REFLECTANCE_TAIL:
        value[MATERIAL_EXTRA_1] = x->tail;
        break;
    case REFLECTANCE_TRANSMISSION:
        value[MATERIAL_EXTRA_1] = x->n_d;
        break;
    default:
        value[MATERIAL_EXTRA_1] = fmin(x->width_ratio * value[MATERIAL_GAMMA], 0.9);
        value[MATERIAL_EXTRA_2] = x->height_ratio;
    }
}

/* The best candidate of one width. */
static struct candidate of_gamma(const struct problem *p, double gamma) {
    const int n_sigma = reflectance_column(p->model, MATERIAL_SIGMA) >= 0 ? COUNT(sigmas) : 1;
    const int n_extra = reflectance_column(p->model, MATERIAL_EXTRA_1) >= 0 ? COUNT(extras) : 1;
    struct candidate best = {.chi2 = INFINITY};
    for (int j = 0; j < n_sigma * n_extra; j++) {
        struct candidate c = {.value = {0, sigmas[j % n_sigma], gamma, 0, START_N}};
        set_extra(p->model, &extras[j / n_sigma], c.value);
        try_candidate(p, &c);
        if (j == 0 || c.chi2 < best.chi2) {
            best = c;
        }
    }
    return best;
}

int start_find(const struct problem *p, double x[START_MAX][COORDINATES_MAX]) {
    struct candidate best[START_MAX + 1];
    int n = 0, n_gamma = reflectance_column(p->model, MATERIAL_GAMMA) >= 0 ? COUNT(gammas) : 1;
    for (int i = 0; i < n_gamma; i++) {
        struct candidate c = of_gamma(p, gammas[i]);
        insert(best, &n, &c);
    }
    for (int i = 0; i < n; i++) {
        coordinates_from_value(p->model, best[i].value, x[i]);
    }
    return n;
}
