#include "fit/reflectance_batch.h"

#include "fit/fresnel.h"
#include "fit/reflectance_wide.h"
#include "fit/roughness.h"

static const struct reflectance_geometry harmless = {1, 0, 1, 0, 0, 0, 1, 1}; /* along the normal */

void reflectance_batch_fill(struct reflectance_batch *batch, size_t n, const struct reflectance_geometry *g,
                            double *memory) {
    size_t room = reflectance_batch_size(n) / REFLECTANCE_BATCH_COLUMNS;
    batch->n = n;
    for (int c = 0; c < REFLECTANCE_BATCH_COLUMNS; c++) {
        batch->column[c] = memory + (size_t)c * room;
    }
    for (size_t i = 0; i < room; i++) {
        const struct reflectance_geometry *x = i < n ? &g[i] : &harmless;
        const double member[] = {x->visibility, x->phi_rad,         x->cos_q,    x->sin2_q,
                                 x->direct,     x->interreflection, x->cos_high, x->cos_low};
        for (int c = 0; c < REFLECTANCE_BATCH_COLUMNS; c++) {
            batch->column[c][i] = member[c];
        }
    }
}

static void prepare_diffuse(struct reflectance_wide *x, const double *value, double kappa_q) {
    struct roughness r = roughness_of(value[MATERIAL_SIGMA]);
    double s = value[MATERIAL_S];
    x->s2_kappa_q = s * s * kappa_q;
    x->s_kappa_q = 2 * s * kappa_q;
    x->c1 = 1 - 0.5 * r.h.value;
    x->k = r.k.value;
    x->j = r.j.value;
    x->c1_slope = -0.5 * r.h.slope;
    x->k_slope = r.k.slope;
    x->j_slope = r.j.slope;
}

static void prepare_specular(struct reflectance_wide *x, const double *value, double polarisation) {
    x->height = value[MATERIAL_BETA_PRIME];
    x->inverse_gamma = 1 / value[MATERIAL_GAMMA];
    x->n = value[MATERIAL_N];
    x->n2_1 = (x->n - 1) * (x->n + 1);
    x->perpendicular = 1 + polarisation;
    x->parallel = 1 - polarisation;
}

static void prepare_extra(struct reflectance_wide *x, enum reflectance_kind kind, const double *value) {
    double extra = value[MATERIAL_EXTRA_1];
    if (kind == REFLECTANCE_TAIL) {
        x->tail = lobe_tail_of(extra);
    } else if (kind == REFLECTANCE_TRANSMISSION) {
        x->n_d = extra;
        x->t0 = fresnel_transmittance_normal(extra, &x->t0_log);
    } else {
        x->inverse_gamma_2 = 1 / extra;
        x->height_2 = value[MATERIAL_EXTRA_2];
    }
}

static void prepare(struct reflectance_wide *x, enum reflectance_model model, const double *value,
                    const struct reflectance_optics *optics) {
    *x = (struct reflectance_wide){.s = value[MATERIAL_S]};
    if (reflectance_column(model, MATERIAL_SIGMA) >= 0) {
        prepare_diffuse(x, value, optics->kappa * optics->q);
    }
    if (reflectance_column(model, MATERIAL_GAMMA) >= 0) {
        prepare_specular(x, value, optics->polarisation);
    }
    if (reflectance_column(model, MATERIAL_EXTRA_1) >= 0) {
        prepare_extra(x, reflectance_kind(model, MATERIAL_EXTRA_1), value);
    }
}

static void view_of(struct reflectance_wide_view *v, const struct reflectance_batch *batch, size_t first,
                    size_t n, enum reflectance_model model, double *beta, double *slope, size_t stride) {
    *v = (struct reflectance_wide_view){.n = reflectance_batch_room(n), .beta = beta};
    for (int c = 0; c < REFLECTANCE_BATCH_COLUMNS; c++) {
        v->in[c] = batch->column[c] + first;
    }
    for (int j = 0; j < reflectance_parameters(model); j++) {
        v->slope[reflectance_parameter(model, j)] = slope + (size_t)j * stride;
    }
}

enum reflectance_width reflectance_batch_width(void) {
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")) {
        return REFLECTANCE_AVX512;
    }
    return __builtin_cpu_supports("avx2") ? REFLECTANCE_AVX2 : REFLECTANCE_SSE2;
}

int reflectance_batch_eval_with(enum reflectance_width width, const struct reflectance_batch *batch,
                                size_t first, size_t n, enum reflectance_model model, const double *value,
                                const struct reflectance_optics *optics, double *beta, double *slope,
                                size_t stride, struct err *e) {
    struct reflectance_wide x;
    struct reflectance_wide_view v;
    int status = reflectance_check(model, value, optics, e);
    if (!status) {
        prepare(&x, model, value, optics);
        view_of(&v, batch, first, n, model, beta, slope, stride);
        reflectance_wide_run(width, model, &x, &v);
    }
    return status;
}

int reflectance_batch_curve(const struct reflectance_batch *batch, size_t first, size_t n,
                            enum reflectance_model model, const double *value,
                            const struct reflectance_optics *optics, double *beta, double *slope,
                            size_t stride, double *by_n_twice, struct err *e) {
    struct reflectance_wide x;
    struct reflectance_wide_view v;
    int status = reflectance_check(model, value, optics, e);
    if (!status) {
        prepare(&x, model, value, optics);
        view_of(&v, batch, first, n, model, beta, slope, stride);
        v.by_n_twice = by_n_twice;
        reflectance_wide_run(reflectance_batch_width(), model, &x, &v);
    }
    return status;
}

int reflectance_batch_eval(const struct reflectance_batch *batch, size_t first, size_t n,
                           enum reflectance_model model, const double *value,
                           const struct reflectance_optics *optics, double *beta, double *slope,
                           size_t stride, struct err *e) {
    return reflectance_batch_eval_with(reflectance_batch_width(), batch, first, n, model, value, optics, beta,
                                       slope, stride, e);
}
