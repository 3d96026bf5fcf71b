#include "fit/normal_equations.h"

#include <math.h>
#include <string.h>

#define BLOCK 64 /* points; their rows of COORDINATES_MAX columns stay in the first-level cache */

/* d beta / d parameter into weighted d beta / d coordinate; chain is nearly diagonal. */
static void chain_row(const double *gradient, const double *chain, int k, double weight, double *row) {
    for (int j = 0; j < k; j++) {
        double sum = 0;
        for (int m = 0; m < k; m++) {
            sum += gradient[m] * chain[m * k + j];
        }
        row[j] = sum * weight;
    }
}

static void add_row(struct normal_equations *s, const double *row, double residual, int k) {
    s->chi2 += residual * residual;
    for (int a = 0; a < k; a++) {
        s->jtr[a] += row[a] * residual;
        for (int b = 0; b <= a; b++) {
            s->jtj[a * k + b] += row[a] * row[b];
        }
    }
}

struct along { /* J^T and r^T times the axes of the nuisances */
    double j[NUISANCES_MAX][COORDINATES_MAX], r[NUISANCES_MAX];
};

static void add_along(struct along *along, const struct problem *p, size_t point, const double *row,
                      double residual) {
    for (int z = 0; z < p->nuisance.m; z++) {
        double axis = p->nuisance.axis[z][point];
        along->r[z] += axis * residual;
        for (int a = 0; a < p->k; a++) {
            along->j[z][a] += axis * row[a];
        }
    }
}

/* The nuisances eliminated: B B instead of I between J^T and J (fit/nuisance.h). */
static void take_out(struct normal_equations *s, const struct problem *p, const struct along *along) {
    for (int z = 0; z < p->nuisance.m; z++) {
        const double *j = along->j[z], removed = p->nuisance.removed[z];
        s->chi2 -= removed * along->r[z] * along->r[z];
        for (int a = 0; a < p->k; a++) {
            s->jtr[a] -= removed * j[a] * along->r[z];
            for (int b = 0; b <= a; b++) {
                s->jtj[a * p->k + b] -= removed * j[a] * j[b];
            }
        }
    }
}

static int add_block(const struct problem *p, const double *value, const double *chain, size_t first,
                     size_t n, struct normal_equations *s, struct along *along, struct err *e) {
    double beta[BLOCK], gradient[BLOCK * COORDINATES_MAX], row[COORDINATES_MAX];
    int status = problem_rows(p, value, first, n, beta, gradient, e);
    for (size_t i = 0; i < n && !status; i++) {
        double weight = p->root_weight[first + i];
        chain_row(gradient + i * (size_t)p->k, chain, p->k, weight, row);
        double residual = (beta[i] - p->input->beta[first + i]) * weight - nuisance_taken(p, first + i);
        add_row(s, row, residual, p->k);
        add_along(along, p, first + i, row, residual);
    }
    return status;
}

int normal_equations_form(const struct problem *p, const double *x, struct normal_equations *s,
                          struct err *e) {
    double value[MATERIAL_PARAMETERS], chain[COORDINATES_MAX * COORDINATES_MAX];
    int k = p->k, status = 0;
    struct along along = {0};
    memset(s, 0, sizeof *s);
    coordinates_to_value(p->model, x, value);
    coordinates_chain(p->model, value, chain);
    for (size_t first = 0; first < p->n && !status; first += BLOCK) {
        size_t n = p->n - first < BLOCK ? p->n - first : BLOCK;
        status = add_block(p, value, chain, first, n, s, &along, e);
    }
    take_out(s, p, &along);
    for (int a = 0; a < k; a++) {
        for (int b = 0; b < a; b++) {
            s->jtj[b * k + a] = s->jtj[a * k + b];
        }
    }
    return status || isfinite(s->chi2) ? status : err_set(e, ERR_RANGE, "the cost of the fit is no number");
}
