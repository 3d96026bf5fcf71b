#include "fit/joint_shape.h"

#include <stdlib.h>
#include <string.h>

bool joint_shape_is_diffuse(const struct problem *p, int column) {
    const enum reflectance_kind kind = reflectance_kind(p->model, reflectance_parameter(p->model, column));
    return kind == REFLECTANCE_ROUGHNESS || kind == REFLECTANCE_TRANSMISSION;
}

static void lay_out(struct joint_shape *s, const bool *held) {
    s->functions = JOINT_P + 1;
    for (int c = 0; c < s->p->k; c++) {
        if (held[c] || reflectance_parameter(s->p->model, c) == MATERIAL_S) {
            continue;
        }
        const bool diffuse = joint_shape_is_diffuse(s->p, c);
        s->column[s->k] = c;
        s->l1[s->k] = diffuse ? s->functions : -1;
        s->l2[s->k] = diffuse ? s->functions + 1 : -1;
        s->specular[s->k] = diffuse ? -1 : s->functions;
        s->functions += diffuse ? 2 : 1;
        s->k++;
    }
}

int joint_shape_init(struct joint_shape *s, struct problem *p, const bool *held, struct err *e) {
    *s = (struct joint_shape){.p = p, .n = p->n};
    lay_out(s, held);
    s->f = calloc((size_t)s->functions * (s->n + 1), sizeof(double));
    s->beta = calloc(s->n + 1, sizeof(double));
    s->gradient = calloc((s->n + 1) * (size_t)p->k, sizeof(double));
    if (s->f && s->beta && s->gradient) {
        return 0;
    }
    joint_shape_free(s);
    return err_set(e, ERR_NOMEM, "no memory for a joint fit of %zu points", p->n);
}

void joint_shape_free(struct joint_shape *s) {
    free(s->f);
    free(s->beta);
    free(s->gradient);
    *s = (struct joint_shape){0};
}

/* Slope of the last evaluation along coordinate j, less that of an earlier one where it is given. */
static void put_slope(struct joint_shape *s, int function, const double *chain, int j, const double *before) {
    const int k = s->p->k;
    for (size_t i = 0; i < s->n; i++) {
        double sum = 0;
        for (int c = 0; c < k; c++) {
            const double g = s->p->gradient[i * (size_t)k + (size_t)c];
            sum += (before ? g - before[i * (size_t)k + (size_t)c] : g) * chain[c * k + j];
        }
        s->f[(size_t)function * s->n + i] = sum;
    }
}

static void put_value(struct joint_shape *s, int function, const double *before) {
    for (size_t i = 0; i < s->n; i++) {
        s->f[(size_t)function * s->n + i] = s->p->model_beta[i] - (before ? before[i] : 0);
    }
}

/* The model with S and q as given; function and slopes are its difference from the evaluation before. */
static int take_part(struct joint_shape *s, double *value, double albedo, double q, int function,
                     const int *slopes, const double *chain, struct err *e) {
    const size_t cells = s->n * (size_t)s->p->k;
    const bool first = function == JOINT_P;
    value[MATERIAL_S] = albedo;
    s->p->optics.q = q;
    int status = problem_evaluate(s->p, value, e);
    if (status) {
        return status;
    }
    put_value(s, function, first ? NULL : s->beta);
    for (int j = 0; j < s->k; j++) {
        if (slopes[j] >= 0) {
            put_slope(s, slopes[j], chain, s->column[j], first ? NULL : s->gradient);
        }
    }
    memcpy(s->beta, s->p->model_beta, s->n * sizeof(double));
    memcpy(s->gradient, s->p->gradient, cells * sizeof(double));
    return 0;
}

int joint_shape_at(struct joint_shape *s, const double *x, struct err *e) {
    double value[MATERIAL_PARAMETERS], chain[COORDINATES_MAX * COORDINATES_MAX];
    coordinates_to_value(s->p->model, x, value);
    coordinates_chain(s->p->model, value, chain);
    int status = take_part(s, value, 0, 1, JOINT_P, s->specular, chain, e);
    status = status ? status : take_part(s, value, 1, 0, JOINT_L1, s->l1, chain, e);
    return status ? status : take_part(s, value, 1, 1, JOINT_L2, s->l2, chain, e);
}
