#include "exact_model.h"

#include <math.h>
#include <mpfr.h>
#include <string.h>

#define BITS 400 /* 120 digits */
#define ROUND MPFR_RNDN

enum { /* the quantities of one evaluation */
       COS_I,
       COS_R,
       COS_DPHI,
       PHI,
       COS_Q,
       VISIBILITY,
       RS,
       RP,
       FRESNEL,
       LOG_D,
       LOBE,
       LOG_D_2,
       LOBE_2,
       C1,
       C2,
       C3,
       L1,
       L2,
       TS_I,
       TP_I,
       TS_R,
       TP_R,
       T_0,
       TRANSMISSION,
       DIFFUSE,
       INTERREFLECTION,
       BOTH, /* diffuse and interreflection */
       SPECULAR,
       SPECULAR_2,
       ACROSS, /* the specular parts with R_s in place of F */
       QUANTITIES
};

struct scene {
    enum reflectance_model model;
    mpfr_t theta_i, theta_r, dphi, parameter[MATERIAL_PARAMETERS], kappa_q, polarisation;
    mpfr_t q[QUANTITIES], t[6]; /* t: scratch */
};

static void scene_init(struct scene *s) {
    mpfr_inits2(BITS, s->theta_i, s->theta_r, s->dphi, s->kappa_q, s->polarisation, (mpfr_ptr)0);
    for (int i = 0; i < MATERIAL_PARAMETERS; i++) {
        mpfr_init2(s->parameter[i], BITS);
    }
    for (int i = 0; i < QUANTITIES; i++) {
        mpfr_init2(s->q[i], BITS);
    }
    for (int i = 0; i < 6; i++) {
        mpfr_init2(s->t[i], BITS);
    }
}

static void scene_clear(struct scene *s) {
    mpfr_clears(s->theta_i, s->theta_r, s->dphi, s->kappa_q, s->polarisation, (mpfr_ptr)0);
    for (int i = 0; i < MATERIAL_PARAMETERS; i++) {
        mpfr_clear(s->parameter[i]);
    }
    for (int i = 0; i < QUANTITIES; i++) {
        mpfr_clear(s->q[i]);
    }
    for (int i = 0; i < 6; i++) {
        mpfr_clear(s->t[i]);
    }
}

static void radians(mpfr_t out, double deg) {
    mpfr_const_pi(out, ROUND);
    mpfr_mul_d(out, out, deg, ROUND);
    mpfr_div_ui(out, out, 180, ROUND);
}

/* Towards the source (sin i, 0, cos i), towards the sensor (sin r cos dphi, sin r sin dphi, cos r); N = (0, 0, 1). */
static void facet(struct scene *s) {
    mpfr_t *t = s->t, *q = s->q;
    mpfr_sin_cos(t[0], q[COS_I], s->theta_i, ROUND);
    mpfr_sin_cos(t[1], q[COS_R], s->theta_r, ROUND);
    mpfr_sin_cos(t[2], q[COS_DPHI], s->dphi, ROUND);
    mpfr_mul(t[3], t[1], q[COS_DPHI], ROUND); /* V */
    mpfr_mul(t[4], t[1], t[2], ROUND);
    mpfr_mul(q[COS_Q], t[0], t[3], ROUND); /* L.V */
    mpfr_mul(t[5], q[COS_I], q[COS_R], ROUND);
    mpfr_add(q[COS_Q], q[COS_Q], t[5], ROUND);
    mpfr_add_ui(q[COS_Q], q[COS_Q], 1, ROUND); /* L.Q = (1 + L.V) / |L + V| */
    mpfr_add(t[3], t[3], t[0], ROUND);
    mpfr_add(t[5], q[COS_I], q[COS_R], ROUND);
    mpfr_hypot(t[0], t[3], t[4], ROUND);
    mpfr_hypot(t[0], t[0], t[5], ROUND); /* |L + V| */
    mpfr_div(q[COS_Q], q[COS_Q], t[0], ROUND);
    mpfr_div(t[3], t[5], t[0], ROUND); /* N.Q */
    mpfr_acos(q[PHI], t[3], ROUND);
    /* G = min(1, 2 (N.Q) min(N.V, N.L) / (V.Q)) */
    mpfr_min(t[0], q[COS_I], q[COS_R], ROUND);
    mpfr_mul(t[0], t[0], t[3], ROUND);
    mpfr_mul_ui(t[0], t[0], 2, ROUND);
    mpfr_div(t[0], t[0], q[COS_Q], ROUND);
    if (mpfr_cmp_ui(t[0], 1) > 0) {
        mpfr_set_ui(t[0], 1, ROUND);
    }
    mpfr_mul(t[1], q[COS_I], q[COS_R], ROUND);
    mpfr_div(q[VISIBILITY], t[0], t[1], ROUND);
}

/* Both reflectances at an angle of this cosine: R_s by (g - c) / (g + c), R_p by that times (c(g+c)-1) / (c(g-c)+1). */
static void reflectances(struct scene *s, mpfr_t rs, mpfr_t rp, const mpfr_t cosine, const mpfr_t n) {
    mpfr_t *t = s->t;
    mpfr_sqr(t[0], n, ROUND);
    mpfr_sqr(t[1], cosine, ROUND);
    mpfr_add(t[0], t[0], t[1], ROUND);
    mpfr_sub_ui(t[0], t[0], 1, ROUND);
    mpfr_sqrt(t[0], t[0], ROUND); /* g */
    mpfr_add(t[1], t[0], cosine, ROUND);
    mpfr_sub(t[2], t[0], cosine, ROUND);
    mpfr_div(t[3], t[2], t[1], ROUND);
    mpfr_mul(t[1], t[1], cosine, ROUND);
    mpfr_sub_ui(t[1], t[1], 1, ROUND);
    mpfr_mul(t[2], t[2], cosine, ROUND);
    mpfr_add_ui(t[2], t[2], 1, ROUND);
    mpfr_div(t[1], t[1], t[2], ROUND);
    mpfr_sqr(t[1], t[1], ROUND);
    mpfr_sqr(rs, t[3], ROUND);
    mpfr_mul(rp, rs, t[1], ROUND);
}

/* ((1 + P) R_s + (1 - P) R_p) / 2 */
static void fresnel(struct scene *s) {
    mpfr_t *t = s->t, *q = s->q;
    reflectances(s, q[RS], q[RP], q[COS_Q], s->parameter[MATERIAL_N]);
    mpfr_add_ui(t[0], s->polarisation, 1, ROUND);
    mpfr_mul(t[0], t[0], q[RS], ROUND);
    mpfr_ui_sub(t[1], 1, s->polarisation, ROUND);
    mpfr_mul(t[1], t[1], q[RP], ROUND);
    mpfr_add(q[FRESNEL], t[0], t[1], ROUND);
    mpfr_div_ui(q[FRESNEL], q[FRESNEL], 2, ROUND);
}

/* ln D = -ln2 x, or -ln(1 + (2^tail - 1) x) / tail, x = phi^2 / gamma^2. */
static void lobe(struct scene *s, mpfr_t log_d, mpfr_t d, const mpfr_t gamma) {
    mpfr_t *t = s->t;
    const mpfr_t *tail = &s->parameter[MATERIAL_EXTRA_1];
    mpfr_div(t[0], s->q[PHI], gamma, ROUND);
    mpfr_sqr(t[0], t[0], ROUND);
    if (s->model == REFLECTANCE_HEAVY_TAIL && !mpfr_zero_p(*tail)) {
        mpfr_exp2(t[1], *tail, ROUND);
        mpfr_sub_ui(t[1], t[1], 1, ROUND);
        mpfr_mul(t[0], t[0], t[1], ROUND);
        mpfr_log1p(t[0], t[0], ROUND);
        mpfr_div(t[0], t[0], *tail, ROUND);
    } else {
        mpfr_const_log2(t[1], ROUND);
        mpfr_mul(t[0], t[0], t[1], ROUND);
    }
    mpfr_neg(log_d, t[0], ROUND);
    mpfr_exp(d, log_d, ROUND);
}

/* One lobe with F, and added to ACROSS with R_s. */
static void lobe_part(struct scene *s, mpfr_t out, const mpfr_t d, const mpfr_t height) {
    mpfr_mul(out, d, s->q[VISIBILITY], ROUND);
    mpfr_mul(out, out, height, ROUND);
    mpfr_mul(s->t[0], out, s->q[RS], ROUND);
    mpfr_add(s->q[ACROSS], s->q[ACROSS], s->t[0], ROUND);
    mpfr_mul(out, out, s->q[FRESNEL], ROUND);
}

static void specular(struct scene *s) {
    mpfr_t *q = s->q, *p = s->parameter;
    mpfr_set_zero(q[ACROSS], 1);
    mpfr_set_zero(q[SPECULAR_2], 1);
    mpfr_set_zero(q[LOG_D_2], 1);
    lobe(s, q[LOG_D], q[LOBE], p[MATERIAL_GAMMA]);
    lobe_part(s, q[SPECULAR], q[LOBE], p[MATERIAL_BETA_PRIME]);
    if (s->model == REFLECTANCE_TWO_LOBE) {
        lobe(s, q[LOG_D_2], q[LOBE_2], p[MATERIAL_EXTRA_1]);
        lobe_part(s, q[SPECULAR_2], q[LOBE_2], p[MATERIAL_EXTRA_2]);
    }
}

/* sigma^2 / (sigma^2 + hundredths / 100) */
static void saturation(struct scene *s, mpfr_t out, unsigned hundredths) {
    mpfr_sqr(out, s->parameter[MATERIAL_SIGMA], ROUND);
    mpfr_mul_ui(out, out, 100, ROUND);
    mpfr_add_ui(s->t[3], out, hundredths, ROUND);
    mpfr_div(out, out, s->t[3], ROUND);
}

static void thousandths(mpfr_t x, unsigned count) {
    mpfr_mul_ui(x, x, count, ROUND);
    mpfr_div_ui(x, x, 1000, ROUND);
}

/* C3 (1 - |cos dphi|) tan((alpha + beta_) / 2); t[1] = alpha, t[0] = beta_. */
static void third_term(struct scene *s) {
    mpfr_t *t = s->t, *q = s->q;
    mpfr_mul(q[C3], t[0], t[1], ROUND);
    mpfr_mul_ui(q[C3], q[C3], 4, ROUND);
    mpfr_const_pi(t[4], ROUND);
    mpfr_div(q[C3], q[C3], t[4], ROUND);
    mpfr_div(q[C3], q[C3], t[4], ROUND);
    mpfr_sqr(q[C3], q[C3], ROUND);
    mpfr_add(t[4], t[0], t[1], ROUND);
    mpfr_div_ui(t[4], t[4], 2, ROUND);
    mpfr_tan(t[4], t[4], ROUND);
    mpfr_mul(q[C3], q[C3], t[4], ROUND);
    mpfr_abs(t[4], q[COS_DPHI], ROUND);
    mpfr_ui_sub(t[4], 1, t[4], ROUND);
    mpfr_mul(q[C3], q[C3], t[4], ROUND);
    thousandths(q[C3], 125);
    saturation(s, t[4], 9);
    mpfr_mul(q[C3], q[C3], t[4], ROUND);
}

static void diffuse(struct scene *s) {
    mpfr_t *t = s->t, *q = s->q;
    mpfr_max(t[1], s->theta_r, s->theta_i, ROUND); /* alpha */
    mpfr_min(t[0], s->theta_r, s->theta_i, ROUND); /* beta_ */
    third_term(s);
    mpfr_const_pi(t[2], ROUND);
    mpfr_div(t[2], t[0], t[2], ROUND);
    mpfr_mul_ui(t[2], t[2], 2, ROUND); /* u = 2 beta_ / pi */
    mpfr_sin(q[C2], t[1], ROUND);
    if (mpfr_sgn(q[COS_DPHI]) < 0) {
        mpfr_pow_ui(t[1], t[2], 3, ROUND);
        mpfr_sub(q[C2], q[C2], t[1], ROUND);
    }
    mpfr_tan(t[0], t[0], ROUND);
    mpfr_mul(q[C2], q[C2], t[0], ROUND);
    thousandths(q[C2], 450);
    saturation(s, t[0], 9);
    mpfr_mul(q[C2], q[C2], t[0], ROUND);
    mpfr_mul(q[C2], q[C2], q[COS_DPHI], ROUND);
    saturation(s, t[0], 33);
    mpfr_div_ui(t[0], t[0], 2, ROUND);
    mpfr_ui_sub(q[C1], 1, t[0], ROUND);
    mpfr_add(q[L1], q[C1], q[C2], ROUND);
    mpfr_add(q[L1], q[L1], q[C3], ROUND);
    saturation(s, q[L2], 13);
    mpfr_sqr(t[2], t[2], ROUND);
    mpfr_mul(t[2], t[2], q[COS_DPHI], ROUND);
    mpfr_ui_sub(t[2], 1, t[2], ROUND);
    mpfr_mul(q[L2], q[L2], t[2], ROUND);
    thousandths(q[L2], 170);
}

/* T T / T(0)^2, T = 1 - (R_s + R_p) / 2. */
static void transmission(struct scene *s) {
    mpfr_t *t = s->t, *q = s->q, *n = &s->parameter[MATERIAL_EXTRA_1];
    mpfr_set_ui(q[TRANSMISSION], 1, ROUND);
    if (s->model != REFLECTANCE_TRANSMITTED) {
        return;
    }
    for (int side = 0; side < 2; side++) {
        mpfr_t *ts = &q[side ? TS_R : TS_I], *tp = &q[side ? TP_R : TP_I];
        reflectances(s, *ts, *tp, q[side ? COS_R : COS_I], *n);
        mpfr_ui_sub(*ts, 1, *ts, ROUND);
        mpfr_ui_sub(*tp, 1, *tp, ROUND);
        mpfr_add(t[0], *ts, *tp, ROUND);
        mpfr_div_ui(t[0], t[0], 2, ROUND);
        mpfr_mul(q[TRANSMISSION], q[TRANSMISSION], t[0], ROUND);
    }
    mpfr_add_ui(t[0], *n, 1, ROUND);
    mpfr_sub_ui(t[1], *n, 1, ROUND);
    mpfr_div(t[0], t[1], t[0], ROUND);
    mpfr_sqr(t[0], t[0], ROUND);
    mpfr_ui_sub(q[T_0], 1, t[0], ROUND);
    mpfr_div(q[TRANSMISSION], q[TRANSMISSION], q[T_0], ROUND);
    mpfr_div(q[TRANSMISSION], q[TRANSMISSION], q[T_0], ROUND);
}

static void evaluate(struct scene *s) {
    mpfr_t *q = s->q, *p = s->parameter;
    facet(s);
    fresnel(s);
    specular(s);
    diffuse(s);
    transmission(s);
    mpfr_mul(q[DIFFUSE], q[L1], p[MATERIAL_S], ROUND);
    mpfr_mul(q[DIFFUSE], q[DIFFUSE], q[TRANSMISSION], ROUND);
    mpfr_sqr(q[INTERREFLECTION], p[MATERIAL_S], ROUND);
    mpfr_mul(q[INTERREFLECTION], q[INTERREFLECTION], q[L2], ROUND);
    mpfr_mul(q[INTERREFLECTION], q[INTERREFLECTION], s->kappa_q, ROUND);
    mpfr_mul(q[INTERREFLECTION], q[INTERREFLECTION], q[TRANSMISSION], ROUND);
    mpfr_add(q[BOTH], q[DIFFUSE], q[INTERREFLECTION], ROUND);
}

static void set_case(struct scene *s, const struct exact_case *at) {
    s->model = at->model;
    radians(s->theta_i, at->theta_i_deg);
    radians(s->theta_r, at->theta_r_deg);
    radians(s->dphi, at->dphi_deg);
    for (int i = 0; i < MATERIAL_PARAMETERS; i++) {
        mpfr_set_d(s->parameter[i], at->value[i], ROUND);
    }
    mpfr_set_d(s->kappa_q, at->kappa_q, ROUND);
    mpfr_set_d(s->polarisation, at->polarisation, ROUND);
}

static double get(const mpfr_t x) {
    return mpfr_get_d(x, ROUND);
}

struct exact_case exact_in_plane(enum reflectance_model model, double theta_i_deg, double theta_v_deg,
                                 const double *value, const struct reflectance_optics *optics) {
    struct exact_case at = {.model = model,
                            .theta_i_deg = theta_i_deg,
                            .theta_r_deg = fabs(theta_v_deg),
                            .dphi_deg = theta_v_deg > 0 ? 180 : 0,
                            .kappa_q = optics->kappa * optics->q,
                            .polarisation = optics->polarisation};
    memcpy(at.value, value, sizeof at.value);
    return at;
}

static void read_values(const struct scene *s, struct exact_values *out) {
    const mpfr_t *q = s->q;
    double rs = get(q[RS]), across = get(q[ACROSS]);
    mpfr_t part;
    mpfr_init2(part, BITS);
    mpfr_add(part, q[RS], q[RP], ROUND);
    double sum = get(part), f = get(q[FRESNEL]);
    mpfr_sub(part, q[RS], q[RP], ROUND);
    *out = (struct exact_values){.phi_rad = get(q[PHI]),
                                 .visibility = get(q[VISIBILITY]),
                                 .fresnel = get(q[FRESNEL]),
                                 .transmission = get(q[TRANSMISSION]),
                                 .log_d = {get(q[LOG_D]), get(q[LOG_D_2])},
                                 .lobe = {get(q[LOBE]), get(q[LOBE_2])},
                                 .l1 = get(q[L1]),
                                 .l1_terms = 1 + (1 - get(q[C1])) + fabs(get(q[C2])) + get(q[C3]),
                                 .l2 = get(q[L2]),
                                 .specular = {get(q[SPECULAR]), get(q[SPECULAR_2])}};
    out->unpolarised = f > 0 ? fmax(1, sum / 2 / f) : 1;
    out->by_polarisation = rs > 0 ? across / rs * get(part) / 2 : 0;
    mpfr_clear(part);
}

void exact_evaluate(const struct exact_case *at, struct exact_values *out) {
    struct scene s;
    scene_init(&s);
    set_case(&s, at);
    evaluate(&s);
    read_values(&s, out);
    scene_clear(&s);
}

/* The slope of one part, by its two neighbours. */
static double slope(struct scene *s, int part, int parameter) {
    mpfr_t step, middle, high;
    mpfr_inits2(BITS, step, middle, high, (mpfr_ptr)0);
    mpfr_set(middle, s->parameter[parameter], ROUND);
    mpfr_set_str(step, "1e-40", 10, ROUND);
    if (!mpfr_zero_p(middle)) {
        mpfr_mul(step, step, middle, ROUND);
    }
    mpfr_add(s->parameter[parameter], middle, step, ROUND);
    evaluate(s);
    mpfr_set(high, s->q[part], ROUND);
    mpfr_sub(s->parameter[parameter], middle, step, ROUND);
    evaluate(s);
    mpfr_sub(high, high, s->q[part], ROUND);
    mpfr_div(high, high, step, ROUND);
    mpfr_div_ui(high, high, 2, ROUND);
    mpfr_set(s->parameter[parameter], middle, ROUND);
    double result = get(high);
    mpfr_clears(step, middle, high, (mpfr_ptr)0);
    return result;
}

/* Both lobes beside the diffuse part would drown even in 120 digits where they are far: one by one. */
static void differentiate_lobes(struct scene *s, const struct exact_values *at, struct exact_slopes *out) {
    static const int parameters[] = {MATERIAL_GAMMA, MATERIAL_BETA_PRIME, MATERIAL_N, MATERIAL_EXTRA_1,
                                     MATERIAL_EXTRA_2};
    for (int i = 0; i < 5; i++) {
        int p = parameters[i];
        bool of_lobe = reflectance_column(s->model, (enum material_parameter)p) >= 0 &&
                       reflectance_kind(s->model, (enum material_parameter)p) != REFLECTANCE_TRANSMISSION;
        for (int part = 0; of_lobe && part < (s->model == REFLECTANCE_TWO_LOBE ? 2 : 1); part++) {
            double one = slope(s, part ? SPECULAR_2 : SPECULAR, p);
            out->beta[p] += one;
            out->terms[p] += fabs(one) * at->unpolarised * (1 + 2 * fabs(at->log_d[part]));
        }
    }
    out->terms[MATERIAL_N] += slope(s, ACROSS, MATERIAL_N) * (1 + 2 * fabs(at->log_d[0]));
}

/* Both terms of d ln D / d tail cancel where D = 1/2 for every tail. */
static double tail_terms(double tail, double widths) {
    double x = widths * widths, strength = tail > 0 ? (exp2(tail) - 1) / tail : log(2),
           u = strength * x * tail;
    double rise = u > 0.5 ? (log1p(u) - u / (1 + u)) / (tail * tail) : strength * x * strength * x / 2;
    return rise + 0.35 * strength * x / (1 + u);
}

static double transmission_terms(struct scene *s) {
    static const int parts[] = {TS_I, TP_I, TS_R, TP_R};
    double sum = 0, t0_slope = slope(s, T_0, MATERIAL_EXTRA_1);
    evaluate(s);
    double size[4] = {get(s->q[TS_I]) + get(s->q[TP_I]), 0, get(s->q[TS_R]) + get(s->q[TP_R]), 0};
    sum += 2 * fabs(t0_slope) / get(s->q[T_0]);
    for (int i = 0; i < 4; i++) {
        sum += fabs(slope(s, parts[i], MATERIAL_EXTRA_1)) / size[i & 2];
    }
    return sum;
}

void exact_differentiate(const struct exact_case *at, struct exact_slopes *out) {
    struct scene s;
    struct exact_values v;
    scene_init(&s);
    set_case(&s, at);
    evaluate(&s);
    read_values(&s, &v);
    *out = (struct exact_slopes){0};
    double albedo = at->value[MATERIAL_S], factor = v.transmission;
    out->beta[MATERIAL_S] = slope(&s, BOTH, MATERIAL_S);
    out->terms[MATERIAL_S] = factor * (v.l1_terms + 2 * albedo * at->kappa_q * v.l2);
    out->beta[MATERIAL_SIGMA] = slope(&s, BOTH, MATERIAL_SIGMA);
    for (int part = C1; part <= C3; part++) {
        out->terms[MATERIAL_SIGMA] += factor * albedo * fabs(slope(&s, part, MATERIAL_SIGMA));
    }
    out->terms[MATERIAL_SIGMA] += fabs(slope(&s, INTERREFLECTION, MATERIAL_SIGMA));
    differentiate_lobes(&s, &v, out);
    if (at->model == REFLECTANCE_HEAVY_TAIL) {
        out->terms[MATERIAL_EXTRA_1] =
            v.specular[0] * v.unpolarised * (1 + 2 * fabs(v.log_d[0])) *
            tail_terms(at->value[MATERIAL_EXTRA_1], v.phi_rad / at->value[MATERIAL_GAMMA]);
    } else if (at->model == REFLECTANCE_TRANSMITTED) {
        out->beta[MATERIAL_EXTRA_1] = slope(&s, BOTH, MATERIAL_EXTRA_1);
        out->terms[MATERIAL_EXTRA_1] =
            factor * (albedo * v.l1_terms + albedo * albedo * at->kappa_q * v.l2) * transmission_terms(&s);
    }
    scene_clear(&s);
}

void exact_free_caches(void) {
    mpfr_free_cache();
}
