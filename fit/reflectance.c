#include "fit/reflectance.h"

#include <math.h>
#include <string.h>

#include "fit/fresnel.h"
#include "fit/lobe.h"
#include "fit/roughness.h"

#define HIGHEST 1e50 /* keeps every product of parameters below overflow */

struct surface { /* what one evaluation needs of the parameters, once for all points */
    const double *value;
    struct roughness rough;
    struct lobe_tail tail;
    double kappa_q, polarisation;
    double t0, t0_log; /* T(0) of n_d and d ln T(0) / d n_d */
};

/* A part of beta at one point; into slope[] (by enum material_parameter, or NULL) its derivatives. */
typedef void diffuse_part(const struct surface *x, const struct reflectance_geometry *g,
                          struct reflectance_parts *parts, double *slope);
typedef double specular_part(const struct surface *x, const struct reflectance_geometry *g, double *slope);

void reflectance_diffuse_factors(const struct reflectance_geometry *g, double sigma, double *l1, double *l2) {
    struct roughness r = roughness_of(sigma);
    *l1 = 1 - 0.5 * r.h.value + r.k.value * g->direct;
    *l2 = r.j.value * g->interreflection;
}

static void lambert(const struct surface *x, const struct reflectance_geometry *g,
                    struct reflectance_parts *parts, double *slope) {
    (void)g;
    parts->diffuse = x->value[MATERIAL_S];
    if (slope) {
        slope[MATERIAL_S] = 1;
    }
}

static void oren_nayar(const struct surface *x, const struct reflectance_geometry *g,
                       struct reflectance_parts *parts, double *slope) {
    const struct roughness *r = &x->rough;
    double s = x->value[MATERIAL_S];
    double l1 = 1 - 0.5 * r->h.value + r->k.value * g->direct;
    double l2 = x->kappa_q * r->j.value * g->interreflection;
    parts->diffuse = s * l1;
    parts->interreflection = s * s * l2;
    if (slope) {
        slope[MATERIAL_S] = l1 + 2 * s * l2;
        slope[MATERIAL_SIGMA] = s * (-0.5 * r->h.slope + r->k.slope * g->direct) +
                                s * s * x->kappa_q * r->j.slope * g->interreflection;
    }
}

/* What was scattered below the surface has passed it twice: Oren and Nayar's part times T T / T(0)^2. */
static void transmitted(const struct surface *x, const struct reflectance_geometry *g,
                        struct reflectance_parts *parts, double *slope) {
    double log_high, log_low, n_d = x->value[MATERIAL_EXTRA_1];
    double high = fresnel_transmittance(g->cos_high, n_d, &log_high) / x->t0;
    double low = fresnel_transmittance(g->cos_low, n_d, &log_low) / x->t0;
    oren_nayar(x, g, parts, slope);
    parts->diffuse *= high * low;
    parts->interreflection *= high * low;
    if (slope) {
        slope[MATERIAL_S] *= high * low;
        slope[MATERIAL_SIGMA] *= high * low;
        slope[MATERIAL_EXTRA_1] =
            (parts->diffuse + parts->interreflection) * ((log_high - x->t0_log) + (log_low - x->t0_log));
    }
}

static double no_lobe(const struct surface *x, const struct reflectance_geometry *g, double *slope) {
    (void)x;
    (void)g;
    (void)slope;
    return 0;
}

/* Where D reached 0 its slopes did so before: 0 times their logarithm, which may be infinite, is avoided. */
static double scaled(double size, double log_slope) {
    return size > 0 ? size * log_slope : 0;
}

static double one_lobe(const struct surface *x, const struct reflectance_geometry *g, const struct lobe *d,
                       double *slope) {
    double f_slope,
        f = fresnel_reflectance(g->cos_q, g->sin2_q, x->value[MATERIAL_N], x->polarisation, &f_slope);
    double amplitude = x->value[MATERIAL_BETA_PRIME];
    double lobe = d->value * g->visibility, unit = lobe * f;
    if (slope) {
        slope[MATERIAL_GAMMA] = scaled(amplitude * unit, d->by_gamma);
        slope[MATERIAL_BETA_PRIME] = unit;
        slope[MATERIAL_N] = amplitude * lobe * f_slope;
    }
    return amplitude * unit;
}

static double gaussian(const struct surface *x, const struct reflectance_geometry *g, double *slope) {
    struct lobe d = lobe_gaussian(g->phi_rad, x->value[MATERIAL_GAMMA]);
    return one_lobe(x, g, &d, slope);
}

static double heavy_tail(const struct surface *x, const struct reflectance_geometry *g, double *slope) {
    struct lobe d = lobe_tailed(&x->tail, g->phi_rad, x->value[MATERIAL_GAMMA]);
    double specular = one_lobe(x, g, &d, slope);
    if (slope) {
        slope[MATERIAL_EXTRA_1] = scaled(specular, d.by_tail);
    }
    return specular;
}

static double two_lobes(const struct surface *x, const struct reflectance_geometry *g, double *slope) {
    struct lobe d = lobe_gaussian(g->phi_rad, x->value[MATERIAL_GAMMA]);
    struct lobe d2 = lobe_gaussian(g->phi_rad, x->value[MATERIAL_EXTRA_1]);
    double amplitude = x->value[MATERIAL_BETA_PRIME], amplitude_2 = x->value[MATERIAL_EXTRA_2];
    double f_slope,
        f = fresnel_reflectance(g->cos_q, g->sin2_q, x->value[MATERIAL_N], x->polarisation, &f_slope);
    double unit = d.value * g->visibility * f, unit_2 = d2.value * g->visibility * f;
    if (slope) {
        slope[MATERIAL_GAMMA] = scaled(amplitude * unit, d.by_gamma);
        slope[MATERIAL_BETA_PRIME] = unit;
        slope[MATERIAL_N] = (amplitude * d.value + amplitude_2 * d2.value) * g->visibility * f_slope;
        slope[MATERIAL_EXTRA_1] = scaled(amplitude_2 * unit_2, d2.by_gamma);
        slope[MATERIAL_EXTRA_2] = unit_2;
    }
    return amplitude * unit + amplitude_2 * unit_2;
}

#define DIFFUSE_KINDS [MATERIAL_S] = REFLECTANCE_ALBEDO, [MATERIAL_SIGMA] = REFLECTANCE_ROUGHNESS
#define LOBE_KINDS                                                                                           \
    [MATERIAL_GAMMA] = REFLECTANCE_WIDTH, [MATERIAL_BETA_PRIME] = REFLECTANCE_HEIGHT,                        \
    [MATERIAL_N] = REFLECTANCE_INDEX
#define COMPOSITE_COLUMNS MATERIAL_S, MATERIAL_SIGMA, MATERIAL_GAMMA, MATERIAL_BETA_PRIME, MATERIAL_N

static const struct {
    const char *name;
    diffuse_part *diffuse;
    specular_part *specular;
    int k;
    enum material_parameter parameter[MATERIAL_PARAMETERS];
    enum reflectance_kind kind[MATERIAL_PARAMETERS]; /* by enum material_parameter */
} models[REFLECTANCE_MODELS] = {
    [REFLECTANCE_LAMBERT] = {"lambert", lambert, no_lobe, 1, {MATERIAL_S}, {DIFFUSE_KINDS}},
    [REFLECTANCE_OREN_NAYAR] =
        {"oren-nayar", oren_nayar, no_lobe, 2, {MATERIAL_S, MATERIAL_SIGMA}, {DIFFUSE_KINDS}},
    [REFLECTANCE_EQ1] = {"eq1",
                         lambert,
                         gaussian,
                         4,
                         {MATERIAL_S, MATERIAL_GAMMA, MATERIAL_BETA_PRIME, MATERIAL_N},
                         {DIFFUSE_KINDS, LOBE_KINDS}},
    [REFLECTANCE_COMPOSITE] =
        {"composite", oren_nayar, gaussian, 5, {COMPOSITE_COLUMNS}, {DIFFUSE_KINDS, LOBE_KINDS}},
    [REFLECTANCE_HEAVY_TAIL] = {"heavy-tail",
                                oren_nayar,
                                heavy_tail,
                                6,
                                {COMPOSITE_COLUMNS, MATERIAL_EXTRA_1},
                                {DIFFUSE_KINDS, LOBE_KINDS, [MATERIAL_EXTRA_1] = REFLECTANCE_TAIL}},
    [REFLECTANCE_TRANSMITTED] = {"transmitted",
                                 transmitted,
                                 gaussian,
                                 6,
                                 {COMPOSITE_COLUMNS, MATERIAL_EXTRA_1},
                                 {DIFFUSE_KINDS, LOBE_KINDS, [MATERIAL_EXTRA_1] = REFLECTANCE_TRANSMISSION}},
    [REFLECTANCE_TWO_LOBE] =
        {"two-lobe",
         oren_nayar,
         two_lobes,
         7,
         {COMPOSITE_COLUMNS, MATERIAL_EXTRA_1, MATERIAL_EXTRA_2},
         {DIFFUSE_KINDS,
          LOBE_KINDS, [MATERIAL_EXTRA_1] = REFLECTANCE_WIDTH, [MATERIAL_EXTRA_2] = REFLECTANCE_HEIGHT}},
};

static const struct {
    double low, high;
    bool low_inside;
} domains[] = {
    [REFLECTANCE_ALBEDO] = {0, HIGHEST, true},       [REFLECTANCE_ROUGHNESS] = {0, HIGHEST, false},
    [REFLECTANCE_WIDTH] = {0, HIGHEST, false},       [REFLECTANCE_HEIGHT] = {0, HIGHEST, true},
    [REFLECTANCE_INDEX] = {1, HIGHEST, false},       [REFLECTANCE_TAIL] = {0, 2, true},
    [REFLECTANCE_TRANSMISSION] = {1, HIGHEST, true},
};

int reflectance_find(const char *name, enum reflectance_model *model, struct err *e) {
    for (int i = 0; i < REFLECTANCE_MODELS; i++) {
        if (strcmp(name, models[i].name) == 0) {
            *model = (enum reflectance_model)i;
            return 0;
        }
    }
    return err_set(
        e, ERR_USAGE,
        "there is no model '%s'; known are lambert, oren-nayar, eq1, composite, heavy-tail, transmitted "
        "and two-lobe",
        name);
}

const char *reflectance_name(enum reflectance_model model) {
    return models[model].name;
}

int reflectance_parameters(enum reflectance_model model) {
    return models[model].k;
}

enum material_parameter reflectance_parameter(enum reflectance_model model, int column) {
    return models[model].parameter[column];
}

enum reflectance_kind reflectance_kind(enum reflectance_model model, enum material_parameter parameter) {
    return models[model].kind[parameter];
}

int reflectance_column(enum reflectance_model model, enum material_parameter parameter) {
    for (int j = 0; j < models[model].k; j++) {
        if (models[model].parameter[j] == parameter) {
            return j;
        }
    }
    return -1;
}

int reflectance_check(enum reflectance_model model, const double *value,
                      const struct reflectance_optics *optics, struct err *e) {
    for (int j = 0; j < models[model].k; j++) {
        enum material_parameter p = models[model].parameter[j];
        enum reflectance_kind kind = models[model].kind[p];
        double low = domains[kind].low, high = domains[kind].high;
        if (!(value[p] <= high && (domains[kind].low_inside ? value[p] >= low : value[p] > low))) {
            return err_set(e, ERR_RANGE, "%s of the model %s is %g; it must be %s %g and at most %g",
                           material_parameter_name(models[model].name, (int)p), models[model].name, value[p],
                           domains[kind].low_inside ? ">=" : ">", low, high);
        }
    }
    double kappa = optics->kappa, q = optics->q;
    if (!(kappa >= 0 && q >= 0 && kappa <= HIGHEST && q <= HIGHEST)) {
        return err_set(e, ERR_RANGE, "kappa is %g and q %g; both must be in 0 .. 1e50", kappa, q);
    }
    if (!(fabs(optics->polarisation) <= 1)) {
        return err_set(e, ERR_RANGE, "the polarisation is %g; it must be in -1 .. 1", optics->polarisation);
    }
    return 0;
}

static bool has(enum reflectance_model model, enum material_parameter p, enum reflectance_kind kind) {
    return reflectance_column(model, p) >= 0 && models[model].kind[p] == kind;
}

static int prepare(struct surface *x, enum reflectance_model model, const double *value,
                   const struct reflectance_optics *optics, struct err *e) {
    int status = reflectance_check(model, value, optics, e);
    if (status) {
        return status;
    }
    *x = (struct surface){
        .value = value, .kappa_q = optics->kappa * optics->q, .polarisation = optics->polarisation};
    if (has(model, MATERIAL_SIGMA, REFLECTANCE_ROUGHNESS)) {
        x->rough = roughness_of(value[MATERIAL_SIGMA]);
    }
    if (has(model, MATERIAL_EXTRA_1, REFLECTANCE_TAIL)) {
        x->tail = lobe_tail_of(value[MATERIAL_EXTRA_1]);
    }
    if (has(model, MATERIAL_EXTRA_1, REFLECTANCE_TRANSMISSION)) {
        x->t0 = fresnel_transmittance_normal(value[MATERIAL_EXTRA_1], &x->t0_log);
    }
    return 0;
}

int reflectance_eval(enum reflectance_model model, size_t n, const struct reflectance_geometry *g,
                     const double *value, const struct reflectance_optics *optics, double *beta,
                     double *gradient, struct err *e) {
    struct surface x;
    int k = models[model].k, status = prepare(&x, model, value, optics, e);
    if (status) {
        return status;
    }
    for (size_t i = 0; i < n; i++) {
        struct reflectance_parts parts = {0};
        double slope[MATERIAL_PARAMETERS], *into = gradient ? slope : NULL;
        models[model].diffuse(&x, &g[i], &parts, into);
        beta[i] = parts.diffuse + parts.interreflection + models[model].specular(&x, &g[i], into);
        for (int j = 0; gradient && j < k; j++) {
            gradient[i * (size_t)k + (size_t)j] = slope[models[model].parameter[j]];
        }
    }
    return 0;
}

int reflectance_eval_parts(enum reflectance_model model, const struct reflectance_geometry *g,
                           const double *value, const struct reflectance_optics *optics,
                           struct reflectance_parts *parts, struct err *e) {
    struct surface x;
    int status = prepare(&x, model, value, optics, e);
    if (status) {
        return status;
    }
    *parts = (struct reflectance_parts){0};
    models[model].diffuse(&x, g, parts, NULL);
    parts->specular = models[model].specular(&x, g, NULL);
    return 0;
}

/* The specular part is linear in F, and F in P: its slope is the part with dF / dP in place of F. */
int reflectance_polarisation_slope(enum reflectance_model model, size_t n,
                                   const struct reflectance_geometry *g, const double *value, double *slope,
                                   struct err *e) {
    static const struct reflectance_optics unpolarised = {.kappa = 1, .q = 1};
    struct surface x;
    int status = prepare(&x, model, value, &unpolarised, e);
    for (size_t i = 0; i < n && !status; i++) {
        double f_slope, n_of = value[MATERIAL_N], specular = models[model].specular(&x, &g[i], NULL);
        slope[i] = specular > 0 ? specular * (fresnel_polarisation_slope(g[i].cos_q, g[i].sin2_q, n_of) /
                                              fresnel_reflectance(g[i].cos_q, g[i].sin2_q, n_of, 0, &f_slope))
                                : 0;
    }
    return status;
}
