#include "fit/joint_shape.h"

#include <stdlib.h>
#include <string.h>

bool joint_shape_is_diffuse(const struct problem *p, int column) {
    const enum reflectance_kind kind = reflectance_kind(p->model, reflectance_parameter(p->model, column));
    return kind == REFLECTANCE_ROUGHNESS || kind == REFLECTANCE_TRANSMISSION;
}

/* The slope along ln A of an only lobe is that lobe. */
static bool is_height_of_all(const struct problem *p, int column) {
    const enum material_parameter parameter = reflectance_parameter(p->model, column);
    return parameter == MATERIAL_BETA_PRIME && reflectance_column(p->model, MATERIAL_EXTRA_2) < 0;
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
        s->specular[s->k] = diffuse ? -1 : is_height_of_all(s->p, c) ? JOINT_P : s->functions;
        s->functions += diffuse ? 2 : s->specular[s->k] != JOINT_P;
        s->k++;
    }
}

int joint_shape_init(struct joint_shape *s, struct problem *p, const bool *held, struct err *e) {
    *s = (struct joint_shape){.p = p, .n = p->n, .room = reflectance_batch_room(p->n)};
    lay_out(s, held);
    s->f = calloc((size_t)s->functions * (s->n + 1), sizeof(double));
    s->columns = calloc(2 * (s->room + 1) * (size_t)(p->k + 1), sizeof(double));
    if (s->f && s->columns) {
        return 0;
    }
    joint_shape_free(s);
    return err_set(e, ERR_NOMEM, "no memory for a joint fit of %zu points", p->n);
}

void joint_shape_free(struct joint_shape *s) {
    free(s->f);
    free(s->columns);
    *s = (struct joint_shape){0};
}

/* Into a function, a column of the evaluation, less that of an earlier one where it is given. */
static void put_value(struct joint_shape *s, int function, const double *now, const double *before) {
    double *to = s->f + (size_t)function * s->n;
    for (size_t i = 0; i < s->n; i++) {
        to[i] = now[i] - (before ? before[i] : 0);
    }
}

/* Its slope along coordinate j. */
static void put_slope(struct joint_shape *s, int function, const double *chain, int j, const double *now,
                      const double *before) {
    const int k = s->p->k;
    double *to = s->f + (size_t)function * s->n;
    memset(to, 0, s->n * sizeof *to);
    for (int c = 0; c < k; c++) {
        const double share = chain[c * k + j], *slope = now + (size_t)(1 + c) * s->room;
        const double *less = before ? before + (size_t)(1 + c) * s->room : NULL;
        for (size_t i = 0; i < s->n && share != 0; i++) {
            to[i] += share * (slope[i] - (less ? less[i] : 0));
        }
    }
}

struct part { /* of the model, as one choice of its parameters shows it */
    double albedo, q;
    bool lobe;
    int function;
    const int *slopes;
};

/* Without its lobe the model is the diffuse part to the last digit. */
static void leave_out_lobe(enum reflectance_model model, double *value) {
    for (int c = 0; c < reflectance_parameters(model); c++) {
        const enum material_parameter p = reflectance_parameter(model, c);
        if (reflectance_kind(model, p) == REFLECTANCE_HEIGHT) {
            value[p] = 0;
        }
    }
}

static int take_part(struct joint_shape *s, const struct part *part, const double *all, const double *chain,
                     const double *before, double *now, struct err *e) {
    double value[MATERIAL_PARAMETERS];
    struct reflectance_optics optics = s->p->optics;
    memcpy(value, all, sizeof value);
    value[MATERIAL_S] = part->albedo;
    optics.q = part->q;
    if (!part->lobe) {
        leave_out_lobe(s->p->model, value);
    }
    int status = aperture_columns(&s->p->aperture, 0, s->n, s->p->model, value, &optics, now, now + s->room,
                                  s->room, e);
    if (status) {
        return status;
    }
    put_value(s, part->function, now, before);
    for (int j = 0; j < s->k; j++) {
        if (part->slopes[j] > JOINT_P) {
            put_slope(s, part->slopes[j], chain, s->column[j], now, before);
        }
    }
    return 0;
}

int joint_shape_at(struct joint_shape *s, const double *x, struct err *e) {
    double value[MATERIAL_PARAMETERS], chain[COORDINATES_MAX * COORDINATES_MAX];
    double *first = s->columns, *second = first + (s->room + 1) * (size_t)(s->p->k + 1);
    const struct part specular = {0, 1, true, JOINT_P, s->specular};
    const struct part direct = {1, 0, false, JOINT_L1, s->l1}, both = {1, 1, false, JOINT_L2, s->l2};
    coordinates_to_value(s->p->model, x, value);
    coordinates_chain(s->p->model, value, chain);
    int status = take_part(s, &specular, value, chain, NULL, first, e);
    status = status ? status : take_part(s, &direct, value, chain, NULL, first, e);
    return status ? status : take_part(s, &both, value, chain, first, second, e);
}
