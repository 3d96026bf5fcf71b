#include "fit/normal_equations.h"

#include <math.h>
#include <string.h>

#include "fit/curvature.h"
#include "fit/products.h"

#define BLOCK 64 /* points; their columns stay in the first-level cache */

struct columns { /* of one block, d beta / d parameter */
    double beta[BLOCK], slope[BLOCK * COORDINATES_MAX];
    double root_weight[BLOCK], residual[BLOCK], by_n_twice[BLOCK];
};

struct pass { /* one pass, its parameters and what it has summed up so far */
    const struct problem *p;
    double value[MATERIAL_PARAMETERS], chain[COORDINATES_MAX * COORDINATES_MAX];
    bool curved;
    double sum[PRODUCTS_CELLS], curvature[CURVATURE_SUMS];
    struct along *along;
};

/* What a coordinate moves beside its own parameter (n moves beta' while A is held), in units of its own. The columns are
 * mixed point by point: in the finished sums the digits would be gone where two columns are nearly alike. */
static void mix(struct columns *c, const double *chain, int k, size_t n) {
    for (int j = 0; j < k; j++) {
        for (int a = 0; a < k; a++) {
            if (a == j || chain[a * k + j] == 0) {
                continue;
            }
            const double share = chain[a * k + j] / chain[j * k + j];
            double *to = c->slope + j * BLOCK, *from = c->slope + a * BLOCK;
            for (size_t i = 0; i < n; i++) {
                to[i] += share * from[i];
            }
        }
    }
}

struct along { /* J^T and r^T times the axes of the nuisances */
    double j[NUISANCES_MAX][COORDINATES_MAX], r[NUISANCES_MAX];
};

static void add_along(struct along *along, const struct problem *p, size_t first, size_t n,
                      struct columns *c) {
    for (int z = 0; z < p->nuisance.m; z++) {
        const double *axis = p->nuisance.axis[z] + first;
        for (size_t i = 0; i < n; i++) {
            along->r[z] += axis[i] * c->residual[i];
            for (int a = 0; a < p->k; a++) {
                along->j[z][a] += axis[i] * c->root_weight[i] * c->slope[a * BLOCK + (int)i];
            }
        }
    }
}

/* The nuisances eliminated: B B instead of I between J^T and J (fit/nuisance.h). */
static void take_out(struct normal_equations *s, const struct problem *p, const double *chain,
                     const struct along *along) {
    const int k = p->k;
    for (int z = 0; z < p->nuisance.m; z++) {
        const double *j = along->j[z], removed = p->nuisance.removed[z];
        s->chi2 -= removed * along->r[z] * along->r[z];
        for (int a = 0; a < k; a++) {
            const double own = chain[a * k + a] * j[a];
            s->jtr[a] -= removed * own * along->r[z];
            for (int b = 0; b < k; b++) {
                s->jtj[a * k + b] -= removed * own * chain[b * k + b] * j[b];
            }
        }
    }
}

static int evaluate_block(const struct pass *pass, size_t first, size_t n, struct columns *c, struct err *e) {
    const struct problem *p = pass->p;
    return pass->curved ? reflectance_batch_curve(&p->aperture.batch, first, n, p->model, pass->value,
                                                  &p->optics, c->beta, c->slope, BLOCK, c->by_n_twice, e)
                        : aperture_columns(&p->aperture, first, n, p->model, pass->value, &p->optics, c->beta,
                                           c->slope, BLOCK, e);
}

static void add_curvature(struct pass *pass, size_t first, size_t n, const struct columns *c) {
    const struct problem *p = pass->p;
    const int height = reflectance_column(p->model, MATERIAL_BETA_PRIME),
              index = reflectance_column(p->model, MATERIAL_N);
    const struct curvature_columns columns = {.first = first,
                                              .n = n,
                                              .by_height = height < 0 ? NULL : c->slope + height * BLOCK,
                                              .by_n = index < 0 ? NULL : c->slope + index * BLOCK,
                                              .by_n_twice = c->by_n_twice,
                                              .root_weight = c->root_weight,
                                              .residual = c->residual};
    curvature_add(p, pass->value, &columns, pass->curvature);
}

static int add_block(struct pass *pass, size_t first, size_t n, struct err *e) {
    const struct problem *p = pass->p;
    struct columns c;
    int status = evaluate_block(pass, first, n, &c, e);
    if (status) {
        return status;
    }
    problem_residuals(p, first, n, c.beta, c.residual, c.root_weight);
    for (size_t i = 0; i < n && p->nuisance.m; i++) {
        c.residual[i] -= nuisance_taken(p, first + i);
    }
    for (size_t i = n; i < reflectance_batch_room(n); i++) {
        c.residual[i] = c.root_weight[i] = 0;
    }
    mix(&c, pass->chain, p->k, n);
    products_add(reflectance_batch_width(), p->k, n, c.slope, BLOCK, c.root_weight, c.residual, pass->sum);
    add_along(pass->along, p, first, n, &c);
    if (pass->curved) {
        add_curvature(pass, first, n, &c);
    }
    return 0;
}

/* The triangle of products into the matrices, each column in its coordinate's own unit. */
static void unpack(const double *sum, const double *chain, int k, struct normal_equations *s) {
    const double *last = sum + k * (k + 1) / 2;
    s->chi2 = last[k];
    for (int a = 0; a < k; a++) {
        const double unit = chain[a * k + a];
        s->jtr[a] = unit * last[a];
        for (int b = 0; b <= a; b++) {
            s->jtj[a * k + b] = s->jtj[b * k + a] = unit * chain[b * k + b] * sum[a * (a + 1) / 2 + b];
        }
    }
}

/* The points from first on. */
static int run(struct pass *pass, const double *x, size_t first, struct normal_equations *s, struct err *e) {
    const struct problem *p = pass->p;
    int status = 0;
    coordinates_to_value(p->model, x, pass->value);
    coordinates_chain(p->model, pass->value, pass->chain);
    for (; first < p->n && !status; first += BLOCK) {
        status = add_block(pass, first, p->n - first < BLOCK ? p->n - first : BLOCK, e);
    }
    unpack(pass->sum, pass->chain, p->k, s);
    take_out(s, p, pass->chain, pass->along);
    return status || isfinite(s->chi2) ? status : err_set(e, ERR_RANGE, "the cost of the fit is no number");
}

int normal_equations_form(const struct problem *p, const double *x, struct normal_equations *s,
                          struct err *e) {
    struct along along = {0};
    struct pass pass = {.p = p, .along = &along};
    return run(&pass, x, 0, s, e);
}

int normal_equations_curved(const struct problem *p, const double *x, struct normal_equations *s,
                            double *second, bool *known, struct err *e) {
    struct along along = {0};
    struct pass pass = {.p = p, .along = &along, .curved = curvature_known(p)};
    int status = run(&pass, x, 0, s, e);
    *known =
        pass.curved && !status && curvature_form(p, pass.value, pass.chain, s->jtr, pass.curvature, second);
    return status;
}

int normal_equations_add(const struct problem *p, const double *x, size_t first, struct normal_equations *s,
                         struct err *e) {
    struct along along = {0};
    struct pass pass = {.p = p, .along = &along};
    struct normal_equations more;
    int status = run(&pass, x, first, &more, e);
    s->chi2 += more.chi2;
    for (int a = 0; a < p->k; a++) {
        s->jtr[a] += more.jtr[a];
    }
    for (int c = 0; c < p->k * p->k; c++) {
        s->jtj[c] += more.jtj[c];
    }
    return status;
}
