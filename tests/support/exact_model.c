#include "exact_model.h"

#include <math.h>
#include <mpfr.h>

#define BITS 400 /* 120 digits */
#define ROUND MPFR_RNDN

enum { /* the quantities of one evaluation */
       COS_I,
       COS_R,
       PHI,
       THETA_Q,
       COS_Q,
       VISIBILITY,
       FRESNEL,
       LOG_D,
       LOBE,
       C1,
       C2,
       L1,
       L2,
       DIFFUSE,
       INTERREFLECTION,
       SPECULAR,
       BETA,
       QUANTITIES
};

struct scene {
    mpfr_t theta_i, theta_v, parameter[EXACT_PARAMETERS], kappa_q;
    mpfr_t q[QUANTITIES], t[4]; /* t: scratch */
};

static void scene_init(struct scene *s) {
    mpfr_inits2(BITS, s->theta_i, s->theta_v, s->kappa_q, (mpfr_ptr)0);
    for (int i = 0; i < EXACT_PARAMETERS; i++) {
        mpfr_init2(s->parameter[i], BITS);
    }
    for (int i = 0; i < QUANTITIES; i++) {
        mpfr_init2(s->q[i], BITS);
    }
    for (int i = 0; i < 4; i++) {
        mpfr_init2(s->t[i], BITS);
    }
}

static void scene_clear(struct scene *s) {
    mpfr_clears(s->theta_i, s->theta_v, s->kappa_q, (mpfr_ptr)0);
    for (int i = 0; i < EXACT_PARAMETERS; i++) {
        mpfr_clear(s->parameter[i]);
    }
    for (int i = 0; i < QUANTITIES; i++) {
        mpfr_clear(s->q[i]);
    }
    for (int i = 0; i < 4; i++) {
        mpfr_clear(s->t[i]);
    }
}

static void radians(mpfr_t out, double deg) {
    mpfr_const_pi(out, ROUND);
    mpfr_mul_d(out, out, deg, ROUND);
    mpfr_div_ui(out, out, 180, ROUND);
}

/* Source at -theta_i, sensor at +theta_v from the normal N = (0, 1). */
static void facet(struct scene *s) {
    mpfr_t *t = s->t, *q = s->q;
    mpfr_sin_cos(t[0], q[COS_I], s->theta_i, ROUND);
    mpfr_sin_cos(t[1], q[COS_R], s->theta_v, ROUND);
    mpfr_sub(t[2], t[1], t[0], ROUND); /* L + V */
    mpfr_add(t[3], q[COS_I], q[COS_R], ROUND);
    mpfr_hypot(q[PHI], t[2], t[3], ROUND);
    mpfr_div(t[3], t[3], q[PHI], ROUND); /* N.Q */
    mpfr_div(t[2], t[2], q[PHI], ROUND);
    mpfr_acos(q[PHI], t[3], ROUND);
    mpfr_mul(t[1], t[1], t[2], ROUND); /* V.Q */
    mpfr_mul(q[COS_Q], q[COS_R], t[3], ROUND);
    mpfr_add(q[COS_Q], q[COS_Q], t[1], ROUND);
    mpfr_acos(q[THETA_Q], q[COS_Q], ROUND);
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

static void fresnel(struct scene *s) {
    mpfr_t *t = s->t, *q = s->q;
    mpfr_sqr(t[0], s->parameter[EXACT_N], ROUND);
    mpfr_sqr(t[1], q[COS_Q], ROUND);
    mpfr_add(t[0], t[0], t[1], ROUND);
    mpfr_sub_ui(t[0], t[0], 1, ROUND);
    mpfr_sqrt(t[0], t[0], ROUND); /* g */
    mpfr_add(t[1], t[0], q[COS_Q], ROUND);
    mpfr_sub(t[2], t[0], q[COS_Q], ROUND);
    mpfr_div(t[3], t[2], t[1], ROUND); /* (g - c) / (g + c) */
    mpfr_mul(t[1], t[1], q[COS_Q], ROUND);
    mpfr_sub_ui(t[1], t[1], 1, ROUND);
    mpfr_mul(t[2], t[2], q[COS_Q], ROUND);
    mpfr_add_ui(t[2], t[2], 1, ROUND);
    mpfr_div(t[1], t[1], t[2], ROUND);
    mpfr_sqr(t[1], t[1], ROUND);
    mpfr_add_ui(t[1], t[1], 1, ROUND);
    mpfr_sqr(t[3], t[3], ROUND);
    mpfr_mul(q[FRESNEL], t[3], t[1], ROUND);
    mpfr_div_ui(q[FRESNEL], q[FRESNEL], 2, ROUND);
}

static void specular(struct scene *s) {
    mpfr_t *t = s->t, *q = s->q;
    mpfr_div(q[LOG_D], q[PHI], s->parameter[EXACT_GAMMA], ROUND);
    mpfr_sqr(q[LOG_D], q[LOG_D], ROUND);
    mpfr_const_log2(t[0], ROUND);
    mpfr_mul(q[LOG_D], q[LOG_D], t[0], ROUND);
    mpfr_neg(q[LOG_D], q[LOG_D], ROUND);
    mpfr_exp(q[LOBE], q[LOG_D], ROUND);
    mpfr_mul(q[SPECULAR], q[LOBE], q[FRESNEL], ROUND);
    mpfr_mul(q[SPECULAR], q[SPECULAR], q[VISIBILITY], ROUND);
    mpfr_mul(q[SPECULAR], q[SPECULAR], s->parameter[EXACT_BETA_PRIME], ROUND);
}

/* sigma^2 / (sigma^2 + hundredths / 100) */
static void saturation(struct scene *s, mpfr_t out, unsigned hundredths) {
    mpfr_sqr(out, s->parameter[EXACT_SIGMA], ROUND);
    mpfr_mul_ui(out, out, 100, ROUND);
    mpfr_add_ui(s->t[3], out, hundredths, ROUND);
    mpfr_div(out, out, s->t[3], ROUND);
}

static void percent(mpfr_t x, unsigned hundredths) {
    mpfr_mul_ui(x, x, hundredths, ROUND);
    mpfr_div_ui(x, x, 100, ROUND);
}

static void diffuse(struct scene *s) {
    mpfr_t *t = s->t, *q = s->q;
    int side = mpfr_sgn(s->theta_v) > 0 ? -1 : 1; /* cos(phi_r - phi_i) */
    mpfr_abs(t[0], s->theta_v, ROUND);
    mpfr_max(t[1], t[0], s->theta_i, ROUND); /* alpha */
    mpfr_min(t[0], t[0], s->theta_i, ROUND); /* beta_ */
    mpfr_const_pi(t[2], ROUND);
    mpfr_div(t[2], t[0], t[2], ROUND);
    mpfr_mul_ui(t[2], t[2], 2, ROUND); /* u = 2 beta_ / pi */
    mpfr_sin(q[C2], t[1], ROUND);
    if (side < 0) {
        mpfr_pow_ui(t[1], t[2], 3, ROUND);
        mpfr_sub(q[C2], q[C2], t[1], ROUND);
    }
    mpfr_tan(t[0], t[0], ROUND);
    mpfr_mul(q[C2], q[C2], t[0], ROUND);
    percent(q[C2], 45);
    saturation(s, t[0], 9);
    mpfr_mul(q[C2], q[C2], t[0], ROUND);
    mpfr_mul_si(q[C2], q[C2], side, ROUND);
    saturation(s, t[0], 33);
    mpfr_div_ui(t[0], t[0], 2, ROUND);
    mpfr_ui_sub(q[C1], 1, t[0], ROUND);
    mpfr_add(q[L1], q[C1], q[C2], ROUND);
    saturation(s, q[L2], 13);
    mpfr_sqr(t[2], t[2], ROUND);
    mpfr_mul_si(t[2], t[2], -side, ROUND);
    mpfr_add_ui(t[2], t[2], 1, ROUND);
    mpfr_mul(q[L2], q[L2], t[2], ROUND);
    percent(q[L2], 17);
}

static void evaluate(struct scene *s, double theta_i_deg, double theta_v_deg) {
    mpfr_t *q = s->q, *p = s->parameter;
    radians(s->theta_i, theta_i_deg);
    radians(s->theta_v, theta_v_deg);
    facet(s);
    fresnel(s);
    specular(s);
    diffuse(s);
    mpfr_mul(q[DIFFUSE], q[L1], p[EXACT_S], ROUND);
    mpfr_sqr(q[INTERREFLECTION], p[EXACT_S], ROUND);
    mpfr_mul(q[INTERREFLECTION], q[INTERREFLECTION], q[L2], ROUND);
    mpfr_mul(q[INTERREFLECTION], q[INTERREFLECTION], s->kappa_q, ROUND);
    mpfr_add(q[BETA], q[DIFFUSE], q[INTERREFLECTION], ROUND);
    mpfr_add(q[BETA], q[BETA], q[SPECULAR], ROUND);
}

static void set_parameters(struct scene *s, const double *value, double kappa_q) {
    for (int i = 0; i < EXACT_PARAMETERS; i++) {
        mpfr_set_d(s->parameter[i], value[i], ROUND);
    }
    mpfr_set_d(s->kappa_q, kappa_q, ROUND);
}

static double get(const mpfr_t x) {
    return mpfr_get_d(x, ROUND);
}

void exact_evaluate(double theta_i_deg, double theta_v_deg, const double *value, double kappa_q,
                    struct exact_values *out) {
    struct scene s;
    scene_init(&s);
    set_parameters(&s, value, kappa_q);
    evaluate(&s, theta_i_deg, theta_v_deg);
    *out = (struct exact_values){.phi_rad = get(s.q[PHI]),
                                 .visibility = get(s.q[VISIBILITY]),
                                 .fresnel = get(s.q[FRESNEL]),
                                 .log_d = get(s.q[LOG_D]),
                                 .lobe = get(s.q[LOBE]),
                                 .l1 = get(s.q[L1]),
                                 .l1_terms = 1 + (1 - get(s.q[C1])) + fabs(get(s.q[C2])),
                                 .l2 = get(s.q[L2]),
                                 .specular = get(s.q[SPECULAR])};
    scene_clear(&s);
}

/* The slope of one part, by its two neighbours. */
static double slope(struct scene *s, int part, int parameter, double theta_i_deg, double theta_v_deg) {
    mpfr_t step, middle, high;
    mpfr_inits2(BITS, step, middle, high, (mpfr_ptr)0);
    mpfr_set(middle, s->parameter[parameter], ROUND);
    mpfr_set_str(step, "1e-40", 10, ROUND);
    mpfr_mul(step, step, middle, ROUND);
    mpfr_add(s->parameter[parameter], middle, step, ROUND);
    evaluate(s, theta_i_deg, theta_v_deg);
    mpfr_set(high, s->q[part], ROUND);
    mpfr_sub(s->parameter[parameter], middle, step, ROUND);
    evaluate(s, theta_i_deg, theta_v_deg);
    mpfr_sub(high, high, s->q[part], ROUND);
    mpfr_div(high, high, step, ROUND);
    mpfr_div_ui(high, high, 2, ROUND);
    mpfr_set(s->parameter[parameter], middle, ROUND);
    double result = get(high);
    mpfr_clears(step, middle, high, (mpfr_ptr)0);
    return result;
}

void exact_differentiate(double theta_i_deg, double theta_v_deg, const double *value, double kappa_q,
                         struct exact_slopes *out) {
    struct scene s;
    scene_init(&s);
    set_parameters(&s, value, kappa_q);
    struct exact_values at;
    exact_evaluate(theta_i_deg, theta_v_deg, value, kappa_q, &at);
    for (int i = 0; i < EXACT_PARAMETERS; i++) {
        /* beside the diffuse part a far lobe would drown even in 120 digits */
        int part = i >= EXACT_GAMMA ? SPECULAR : BETA;
        out->beta[i] = slope(&s, part, i, theta_i_deg, theta_v_deg);
        out->terms[i] = fabs(out->beta[i]);
    }
    out->terms[EXACT_S] = at.l1_terms + 2 * value[EXACT_S] * kappa_q * at.l2;
    out->terms[EXACT_SIGMA] = value[EXACT_S] * (fabs(slope(&s, C1, EXACT_SIGMA, theta_i_deg, theta_v_deg)) +
                                                fabs(slope(&s, C2, EXACT_SIGMA, theta_i_deg, theta_v_deg))) +
                              fabs(slope(&s, INTERREFLECTION, EXACT_SIGMA, theta_i_deg, theta_v_deg));
    scene_clear(&s);
}

void exact_free_caches(void) {
    mpfr_free_cache();
}
