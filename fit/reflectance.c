#include "fit/reflectance.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "proto/units.h"

#define HIGHEST 1e50 /* keeps every product of parameters below overflow */

static const struct {
    const char *name;
    int k;
    enum material_parameter parameter[5];
} models[REFLECTANCE_MODELS] = {
    [REFLECTANCE_LAMBERT] = {"lambert", 1, {MATERIAL_S}},
    [REFLECTANCE_OREN_NAYAR] = {"oren-nayar", 2, {MATERIAL_S, MATERIAL_SIGMA}},
    [REFLECTANCE_EQ1] = {"eq1", 4, {MATERIAL_S, MATERIAL_GAMMA, MATERIAL_BETA_PRIME, MATERIAL_N}},
    [REFLECTANCE_COMPOSITE] = {"composite",
                               5,
                               {MATERIAL_S, MATERIAL_SIGMA, MATERIAL_GAMMA, MATERIAL_BETA_PRIME, MATERIAL_N}},
};

int reflectance_find(const char *name, enum reflectance_model *model, struct err *e) {
    for (int i = 0; i < REFLECTANCE_MODELS; i++) {
        if (strcmp(name, models[i].name) == 0) {
            *model = (enum reflectance_model)i;
            return 0;
        }
    }
    return err_set(e, ERR_USAGE, "there is no model '%s'; known are lambert, oren-nayar, eq1 and composite",
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

/* Sine and cosine of x in [0, 90] deg from whichever of x and its complement keeps the digits: near 90 deg
 * the radian of x has lost them. */
static double sin_deg(double x_deg, double complement_deg) {
    return x_deg <= 45 ? sin(rad_from_deg(x_deg)) : cos(rad_from_deg(complement_deg));
}

static double cos_deg(double x_deg, double complement_deg) {
    return sin_deg(complement_deg, x_deg);
}

/* cos(dphi) C2 tan(beta_) / k; high = alpha, low = beta_ of Oren and Nayar (reflection-model.md 2.2). */
static double direct_term(double high_deg, double low_deg, bool forward) {
    double rest_deg = 90 - low_deg;
    double tangent = low_deg > 45 ? 1 / tan(rad_from_deg(rest_deg)) : tan(rad_from_deg(low_deg));
    double sine = sin_deg(high_deg, 90 - high_deg);
    if (!forward) {
        return 0.45 * sine * tangent;
    }
    double u = low_deg / 90, v = rest_deg / 90;
    if (low_deg <= 45) {
        return -0.45 * (sine - u * u * u) * tangent;
    }
    /* Both angles towards 90 deg: 0 times infinity in the plain form, 6 / pi in this one. */
    double half = sin(rad_from_deg(90 - high_deg) / 2);
    return -0.45 * (v * (3 - 3 * v + v * v) - 2 * half * half) * tangent;
}

/* G / (cos cos) in one piece: taken apart it is 0 / 0 at grazing. */
static double visibility(double cos_i, double cos_r, double cos_q) {
    double shadowed = (1 + fmin(cos_i, cos_r) / fmax(cos_i, cos_r)) / (cos_q * cos_q);
    return fmin(1 / (cos_i * cos_r), shadowed);
}

int reflectance_geometry(struct reflectance_geometry *g, double theta_i_deg, double theta_v_deg,
                         struct err *e) {
    if (!(theta_i_deg >= 0 && theta_i_deg < 90 && fabs(theta_v_deg) < 90)) {
        return err_set(
            e, ERR_RANGE,
            "incidence %g deg, viewing %g deg is outside the model, which needs 0 <= theta_i < 90 and "
            "-90 < theta_v < 90",
            theta_i_deg, theta_v_deg);
    }
    /* Along the normal there are no sides; one formula then serves both, and exchange keeps its bits. */
    bool forward = theta_v_deg > 0 && theta_i_deg > 0;
    double theta_r_deg = fabs(theta_v_deg);
    double high_deg = fmax(theta_i_deg, theta_r_deg), low_deg = fmin(theta_i_deg, theta_r_deg);
    /* In plane the half angles are exact sums: which of the two is phi depends on the side. */
    double sum_deg = (high_deg + low_deg) / 2, difference_deg = (high_deg - low_deg) / 2;
    double sum_rest_deg = ((90 - high_deg) + (90 - low_deg)) / 2;
    double q_deg = forward ? sum_deg : difference_deg;
    double q_rest_deg = forward ? sum_rest_deg : 90 - difference_deg;
    double sin_q = sin_deg(q_deg, q_rest_deg);
    double u = low_deg / 90;
    g->phi_rad = rad_from_deg(forward ? difference_deg : sum_deg);
    g->cos_q = cos_deg(q_deg, q_rest_deg);
    g->sin2_q = sin_q * sin_q;
    g->visibility =
        visibility(cos_deg(theta_i_deg, 90 - theta_i_deg), cos_deg(theta_r_deg, 90 - theta_r_deg), g->cos_q);
    g->direct = direct_term(high_deg, low_deg, forward);
    g->interreflection = 0.17 * (forward ? 1 + u * u : (90 - low_deg) / 90 * (1 + u));
    return 0;
}

/* x^2 / (x^2 + a) and its derivative: the saturating factors of Oren and Nayar. */
struct saturation {
    double value, slope;
};

static struct saturation saturate(double sigma, double a) {
    double s2 = sigma * sigma, sum = s2 + a;
    return (struct saturation){1 / (1 + a / s2), 2 * sigma * (a / sum) / sum}; /* sigma^2 may be 0 or inf */
}

struct roughness { /* everything of Oren and Nayar that depends on sigma alone */
    struct saturation h, k, j;
};

static struct roughness roughness_of(double sigma) {
    return (struct roughness){saturate(sigma, 0.33), saturate(sigma, 0.09), saturate(sigma, 0.13)};
}

void reflectance_diffuse_factors(const struct reflectance_geometry *g, double sigma, double *l1, double *l2) {
    struct roughness r = roughness_of(sigma);
    *l1 = 1 - 0.5 * r.h.value + r.k.value * g->direct;
    *l2 = r.j.value * g->interreflection;
}

double reflectance_fresnel(double cos_q, double sin2_q, double n, double *slope) {
    double n2_1 = (n - 1) * (n + 1), c = cos_q, s2 = sin2_q;
    double root = sqrt(n2_1 + c * c), sum = root + c, cr = c * root;
    double r = n2_1 / (sum * sum), rs = r * r;
    double t = (cr - s2) / (cr + s2);
    /* 2n/(n^2-1) - 2n/(q(q+c)) = 2nc/(q(n^2-1)): the difference is taken on paper, it cancels for n near 1.
     */
    double rs_slope = 4 * n * c * r / (root * sum * sum);
    double t_slope = 2 * s2 * c * (n / root) / ((cr + s2) * (cr + s2));
    *slope = 0.5 * rs_slope * (1 + t * t) + rs * t * t_slope;
    return 0.5 * rs * (1 + t * t);
}

/* One row of the specular term: its value and, where asked for, d/dgamma, d/dbeta', d/dn. */
static double specular_of(const struct reflectance_geometry *g, const double *value, double *slope) {
    double gamma = value[MATERIAL_GAMMA], amplitude = value[MATERIAL_BETA_PRIME];
    double widths = g->phi_rad / gamma, log_d = -M_LN2 * widths * widths;
    double lobe = exp(log_d) * g->visibility;
    double f_slope, f = reflectance_fresnel(g->cos_q, g->sin2_q, value[MATERIAL_N], &f_slope);
    double unit = lobe * f;
    if (slope) {
        slope[0] =
            unit > 0 ? amplitude * unit * (-2 * log_d / gamma) : 0; /* exp reached 0: so has its slope */
        slope[1] = unit;
        slope[2] = amplitude * lobe * f_slope;
    }
    return amplitude * unit;
}

static bool has_roughness(enum reflectance_model model) {
    return model == REFLECTANCE_OREN_NAYAR || model == REFLECTANCE_COMPOSITE;
}

static bool has_specular(enum reflectance_model model) {
    return model == REFLECTANCE_EQ1 || model == REFLECTANCE_COMPOSITE;
}

static int check_domain(enum reflectance_model model, const double *value, double kappa, double q,
                        struct err *e) {
    static const double lowest[] = {[MATERIAL_N] = 1};
    static const bool may_be_lowest[] = {
        [MATERIAL_S] = true, [MATERIAL_BETA_PRIME] = true, [MATERIAL_N] = false};
    for (int j = 0; j < models[model].k; j++) {
        enum material_parameter p = models[model].parameter[j];
        bool inside =
            value[p] <= HIGHEST && (may_be_lowest[p] ? value[p] >= lowest[p] : value[p] > lowest[p]);
        if (!inside) {
            return err_set(e, ERR_RANGE,
                           "parameter %d of the model %s is %g; it must be %s %g and at most 1e50", (int)p,
                           models[model].name, value[p], may_be_lowest[p] ? ">=" : ">", lowest[p]);
        }
    }
    if (!(kappa >= 0 && q >= 0 && kappa <= HIGHEST && q <= HIGHEST)) {
        return err_set(e, ERR_RANGE, "kappa is %g and q %g; both must be in 0 .. 1e50", kappa, q);
    }
    return 0;
}

struct surface { /* what one evaluation needs of the parameters, once for all points */
    const double *value;
    struct roughness rough;
    double s, kappa_q;
};

static double diffuse_row(const struct surface *x, const struct reflectance_geometry *g, double *row) {
    const struct roughness *r = &x->rough;
    double l1 = 1 - 0.5 * r->h.value + r->k.value * g->direct;
    double l2 = x->kappa_q * r->j.value * g->interreflection;
    if (row) {
        row[0] = l1 + 2 * x->s * l2;
        row[1] = x->s * (-0.5 * r->h.slope + r->k.slope * g->direct) +
                 x->s * x->s * x->kappa_q * r->j.slope * g->interreflection;
    }
    return x->s * l1 + x->s * x->s * l2;
}

int reflectance_eval(enum reflectance_model model, size_t n, const struct reflectance_geometry *g,
                     const double *value, double kappa, double q, double *beta, double *gradient,
                     struct err *e) {
    int status = check_domain(model, value, kappa, q, e);
    if (status) {
        return status;
    }
    bool rough = has_roughness(model), specular = has_specular(model);
    struct surface x = {.value = value, .s = value[MATERIAL_S], .kappa_q = kappa * q};
    if (rough) {
        x.rough = roughness_of(value[MATERIAL_SIGMA]);
    }
    int k = models[model].k;
    for (size_t i = 0; i < n; i++) {
        double *row = gradient ? gradient + i * (size_t)k : NULL;
        if (rough) {
            beta[i] = diffuse_row(&x, &g[i], row);
        } else {
            beta[i] = x.s;
            if (row) {
                row[0] = 1;
            }
        }
        if (specular) {
            beta[i] += specular_of(&g[i], value, row ? row + (rough ? 2 : 1) : NULL);
        }
    }
    return 0;
}

int reflectance_eval_parts(enum reflectance_model model, const struct reflectance_geometry *g,
                           const double *value, double kappa, double q, struct reflectance_parts *parts,
                           struct err *e) {
    int status = check_domain(model, value, kappa, q, e);
    if (status) {
        return status;
    }
    double l1 = 1, l2 = 0, s = value[MATERIAL_S];
    if (has_roughness(model)) {
        reflectance_diffuse_factors(g, value[MATERIAL_SIGMA], &l1, &l2);
    }
    parts->diffuse = s * l1;
    parts->interreflection = kappa * q * s * s * l2;
    parts->specular = has_specular(model) ? specular_of(g, value, NULL) : 0;
    return 0;
}
