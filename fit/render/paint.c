#include "fit/render/paint.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit/fresnel.h"
#include "fit/lobe.h"
#include "fit/reflectance.h"
#include "fit/render/sha256.h"
#include "proto/session.h"

#define HIGHEST 1e50      /* as in the fit: keeps every product below overflow */
#define GAMMA_LOWEST 1e-9 /* rad; a lobe narrower than the sun's disc by six orders */

static bool has(const struct paint *p, enum material_parameter parameter) {
    return material_parameter_name(p->estimate.model, parameter) != NULL;
}

static double value_of(const struct paint *p, enum material_parameter parameter, double without) {
    return has(p, parameter) ? p->estimate.value[parameter] : without;
}

static int check_value(const struct paint *p, enum material_parameter parameter, double low, struct err *e) {
    double value = p->estimate.value[parameter];
    if (!has(p, parameter) || (value >= low && value <= HIGHEST)) {
        return 0;
    }
    return err_set(e, ERR_RANGE, "material %s: %s is %g; it must be at least %g and at most 1e50", p->name,
                   material_parameter_name(p->estimate.model, parameter), value, low);
}

/* x^2 / (x^2 + a), also for x^2 that underflows or overflows. */
static double saturated(double sigma, double a) {
    return 1 / (1 + a / (sigma * sigma));
}

static int check_relatives(const struct paint *p, enum reflectance_model model, struct err *e) {
    switch (model) {
    case REFLECTANCE_HEAVY_TAIL:
        return p->estimate.value[MATERIAL_EXTRA_1] <= 2
                   ? check_value(p, MATERIAL_EXTRA_1, 0, e)
                   : err_set(e, ERR_RANGE, "material %s: tail is %g; it must be 0 to 2", p->name,
                             p->estimate.value[MATERIAL_EXTRA_1]);
    case REFLECTANCE_TRANSMITTED:
        return check_value(p, MATERIAL_EXTRA_1, 1, e);
    case REFLECTANCE_TWO_LOBE: {
        int status = check_value(p, MATERIAL_EXTRA_1, GAMMA_LOWEST, e);
        return status ? status : check_value(p, MATERIAL_EXTRA_2, 0, e);
    }
    default:
        return 0;
    }
}

static void add_relatives(struct paint *p, enum reflectance_model model) {
    const double *value = p->estimate.value;
    double gamma = value_of(p, MATERIAL_GAMMA, 1), extra = value[MATERIAL_EXTRA_1], log_slope;
    p->shade.n_d = p->shade.inverse_t0 = 1;
    if (model == REFLECTANCE_HEAVY_TAIL) {
        struct lobe_tail t = lobe_tail_of(extra);
        p->shade.tail = t.tail;
        p->shade.tail_strength = t.strength / (gamma * gamma);
    } else if (model == REFLECTANCE_TRANSMITTED) {
        p->shade.n_d = extra;
        p->shade.inverse_t0 = 1 / fresnel_transmittance_normal(extra, &log_slope);
    } else if (model == REFLECTANCE_TWO_LOBE) {
        p->shade.beta_prime_2 = value[MATERIAL_EXTRA_2];
        p->shade.exponent_2 = M_LN2 / (extra * extra);
    }
}

static int prepare_shade(struct paint *p, struct err *e) {
    enum reflectance_model model;
    int status = reflectance_find(p->estimate.model, &model, e);
    status = status ? status : check_value(p, MATERIAL_SIGMA, 0, e);
    status = status ? status : check_value(p, MATERIAL_BETA_PRIME, 0, e);
    status = status ? status : check_value(p, MATERIAL_GAMMA, GAMMA_LOWEST, e);
    status = status ? status : check_value(p, MATERIAL_N, 1, e);
    status = status ? status : check_relatives(p, model, e);
    double sigma = value_of(p, MATERIAL_SIGMA, 0), gamma = value_of(p, MATERIAL_GAMMA, 1);
    double n = value_of(p, MATERIAL_N, 1);
    p->shade = (struct shade_paint){
        .c1 = 1 - 0.5 * saturated(sigma, 0.33),
        .direct = 0.45 * saturated(sigma, 0.09),
        .side = 0.125 * saturated(sigma, 0.09),
        .inter = 0.17 * p->estimate.kappa * saturated(sigma, 0.13),
        .beta_prime = value_of(p, MATERIAL_BETA_PRIME, 0),
        .exponent = M_LN2 / (gamma * gamma),
        .n2_1 = (n - 1) * (n + 1),
    };
    if (!status) {
        add_relatives(p, model);
    }
    return status;
}

static int nearest_measured(const struct estimate *m, int band, int step) {
    while (band >= 0 && band < BANDS && !isfinite(m->s_lambda[band])) {
        band += step;
    }
    return band >= 0 && band < BANDS ? band : -1;
}

static int prepare_spectrum(struct paint *p, struct err *e) {
    const struct estimate *m = &p->estimate;
    for (int k = 0; k < BANDS; k++) {
        int left = nearest_measured(m, k, -1), right = nearest_measured(m, k, 1);
        if (left < 0 && right < 0) {
            return err_set(e, ERR_STATE, "material %s has no S(lambda) in any band", p->name);
        }
        left = left < 0 ? right : left;
        right = right < 0 ? left : right;
        double part = right > left ? (k - left) / (double)(right - left) : 0;
        p->s[k] = m->s_lambda[left] + part * (m->s_lambda[right] - m->s_lambda[left]);
        p->held[k] = left != k;
        if (!(p->s[k] <= HIGHEST)) {
            return err_set(e, ERR_RANGE, "material %s: S at %d nm is %g", p->name, band_nm(k), p->s[k]);
        }
        /* A dark band may come out of a fit a little under 0; there is no such albedo. */
        p->s[k] = fmax(p->s[k], 0);
    }
    return 0;
}

int paint_prepare(struct paint *paint, struct err *e) {
    int status = prepare_shade(paint, e);
    paint->drawn = paint->shade;
    return status ? status : prepare_spectrum(paint, e);
}

int paint_from_session(struct paint *paint, const char *path, struct err *e) {
    struct session *session;
    int status = session_open(&session, path, true, e);
    if (status) {
        return status;
    }
    status = session_last_estimate(session, &paint->estimate, e);
    int closed = session_close(session, e);
    status = status ? status : closed;
    if (!status && !paint->estimate.converged) {
        status = err_set(e, ERR_STATE, "%s holds no estimate: %s", path, paint->estimate.refusal);
    } else if (!status && !paint->estimate.has_spectrum) {
        status = err_set(e, ERR_STATE, "the estimate of %s has no S(lambda); measure it by wavelength", path);
    }
    snprintf(paint->source, sizeof paint->source, "%s", path);
    status = status ? status : sha256_of_file(path, paint->sha256, e);
    return status ? status : paint_prepare(paint, e);
}

double paint_held_share(const struct paint *paint, const double power[BANDS], const double cmf[BANDS][3]) {
    double worst = 0;
    for (int i = 0; i < 3; i++) {
        double whole = 0, held = 0;
        for (int k = 0; k < BANDS; k++) {
            double part = paint->s[k] * power[k] * cmf[k][i];
            whole += part;
            held += paint->held[k] ? part : 0;
        }
        worst = whole > 0 ? fmax(worst, held / whole) : worst;
    }
    return worst;
}
