#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/joint_fit.h"
#include "fit/joint_solve.h"
#include "tests/support/full_joint.h"
#include "tests/support/goniometry.h"

#define RELATIVE 0.01 /* noise of a band */

static struct goniometry m; /* large */
static double cov_next[GONIOMETRY_MAX * BANDS], clean[GONIOMETRY_MAX * BANDS];

static void measure(int set, struct dice *d) {
    goniometry_make(&m, goniometry_set[set], 60, 5);
    goniometry_colour(&m, 0.05, 0.4);
    goniometry_band_noise(&m, d, RELATIVE);
}

static void fit(const struct estimate_input *in, bool per_band, struct estimate *means, struct joint *joint) {
    struct err e = {0};
    if (estimate_fit(in, means, &e) || joint_fit(in, means, per_band, joint, &e)) {
        fail_msg("%s", e.text);
    }
    assert_true(means->converged);
    if (!joint->converged) {
        fail_msg("no joint fit: %s", joint->refusal);
    }
}

/* Leaves the bands of the list alone. */
static void keep_bands(const int *band, int n) {
    for (int b = 0; b < BANDS; b++) {
        bool kept = false;
        for (int i = 0; i < n; i++) {
            kept = kept || band[i] == b;
        }
        for (size_t i = 0; !kept && i < m.input.n; i++) {
            m.band_beta[i * BANDS + (size_t)b] = NAN;
        }
    }
}

struct both { /* the joint fit, and one problem over all parameters */
    struct problem p;
    struct joint_data data;
    struct joint_solution found;
    double x[COORDINATES_MAX], s[BANDS], t[BANDS], chi2;
};

static void begin_both(struct both *w, bool per_band) {
    double value[MATERIAL_PARAMETERS];
    assert_int_equal(problem_init(&w->p, &m.input, NULL), 0);
    assert_int_equal(problem_evaluate(&w->p, m.value, NULL), 0);
    assert_int_equal(joint_data_init(&w->data, &w->p, NULL), 0);
    for (int i = 0; i < MATERIAL_PARAMETERS; i++) {
        value[i] = m.value[i] * 1.1;
    }
    coordinates_from_value(w->p.model, value, w->x);
    assert_int_equal(joint_solve(&w->data, w->x, per_band, &w->found, NULL, NULL), 0);
    assert_true(w->found.converged);
}

static void solve_whole(struct both *w, bool per_band, const bool *held) {
    for (int b = 0; b < w->data.n_bands; b++) {
        w->s[b] = 0.2;
        w->t[b] = 1;
    }
    w->chi2 = full_joint(&w->data, per_band, held, w->x, w->s, w->t);
    assert_true(w->chi2 > 0);
}

static void assert_agreement(const struct both *w, bool per_band) {
    assert_true(fabs(w->found.chi2 - w->chi2) < 1e-9 * w->chi2);
    for (int c = 1; c < w->p.k; c++) {
        bool held = per_band && reflectance_parameter(w->p.model, c) == MATERIAL_BETA_PRIME;
        assert_true(held || fabs(w->found.x[c] - w->x[c]) < 1e-7);
    }
    for (int b = 0; b < w->data.n_bands; b++) {
        assert_true(fabs(w->found.s[b] / w->s[b] - 1) < 1e-7);
        assert_true(fabs(w->found.t[b] / w->t[b] - 1) < 1e-7);
    }
}

static void end_both(struct both *w) {
    joint_data_free(&w->data);
    problem_free(&w->p);
}

static const int five[] = {4, 20, 30, 44, 70};

static void reaches_the_full_problems_answer(void **state) {
    (void)state;
    struct dice d = {11};
    struct both w;
    for (int set = 0; set < GONIOMETRY_SETS; set++) {
        for (int per_band = 0; per_band < 2; per_band++) {
            measure(set, &d);
            keep_bands(five, 5);
            begin_both(&w, per_band);
            solve_whole(&w, per_band, NULL);
            assert_agreement(&w, per_band);
            end_both(&w);
        }
    }
}

/* An index just above its bound, in noise, is drawn to it in some of the draws: it stays there, and the rest is the best fit
 * with it held. Without bounds the index would go beyond, and the cost fall. */
static void a_bound_is_held(void **state) {
    (void)state;
    struct dice d = {12};
    const double value[MATERIAL_PARAMETERS] = {0.2, 0.3, 0.07, 7.6, 1.3005};
    int met = 0;
    for (int draw = 0; draw < 8; draw++) {
        struct both w;
        goniometry_make(&m, value, 60, 10);
        goniometry_colour(&m, 0.05, 0.4);
        goniometry_band_noise(&m, &d, 5 * RELATIVE);
        keep_bands(five, 5);
        begin_both(&w, false);
        const int n = reflectance_column(w.p.model, MATERIAL_N);
        bool held[COORDINATES_MAX] = {false};
        held[n] = w.found.x[n] == w.p.low[n];
        met += held[n];
        w.x[n] = held[n] ? w.p.low[n] : w.x[n];
        solve_whole(&w, false, held);
        assert_agreement(&w, false);
        if (held[n]) {
            solve_whole(&w, false, NULL);
            assert_true(w.x[n] < w.p.low[n] && w.chi2 < w.found.chi2);
        }
        end_both(&w);
    }
    print_message("# %d of 8 at the bound\n", met);
    assert_true(met > 0 && met < 8);
}

static void one_band_is_the_ordinary_fit(void **state) {
    (void)state;
    static const int one[] = {34};
    struct dice d = {5};
    struct estimate means;
    struct joint joint;
    measure(2, &d);
    keep_bands(one, 1);
    for (size_t i = 0; i < m.input.n; i++) {
        m.beta[i] = m.band_beta[i * BANDS + 34];
        m.u[i] = m.band_u[i * BANDS + 34];
    }
    m.input.mean_low_nm = m.input.mean_high_nm = band_nm(34);
    fit(&m.input, false, &means, &joint);
    for (int p = 0; p <= MATERIAL_N; p++) {
        double value = p == MATERIAL_S ? joint.s_lambda[34] : joint.value[p];
        double u = joint_u(&joint, p, p == MATERIAL_S ? 34 : -1), stated = sqrt(means.statistical[p][p]);
        assert_true(fabs(value - means.value[p]) < 1e-4 * stated);
        assert_true(fabs(u / stated - 1) < 1e-3);
    }
    assert_int_equal(joint.n, 5);
    assert_true(isnan(joint.s_lambda[33]) && fabs(joint.chi2 - means.chi2) < 1e-3 * means.chi2);
    joint_free(&joint);
}

static void missing_bands_and_values_stay_out(void **state) {
    (void)state;
    struct dice d = {6};
    struct estimate means;
    struct joint joint;
    measure(1, &d);
    for (size_t i = 0; i < m.input.n; i++) {
        m.band_beta[i * BANDS] = m.band_beta[i * BANDS + 80] = NAN; /* two bands whole */
        if (i % 3) {
            m.band_beta[i * BANDS + 40] = NAN; /* most of one */
        }
        if (i > 1) {
            m.band_beta[i * BANDS + 41] = NAN; /* too few values to count */
        }
    }
    fit(&m.input, false, &means, &joint);
    assert_int_equal(joint.n_bands, BANDS - 3);
    assert_int_equal(joint.n, 4 + BANDS - 3);
    assert_true(isnan(joint.s_lambda[0]) && isnan(joint.s_lambda[41]) &&
                isnan(joint_u(&joint, MATERIAL_S, 80)));
    double full = joint_u(&joint, MATERIAL_S, 39), third = joint_u(&joint, MATERIAL_S, 40);
    assert_true(third > 1.2 * full && third < 1.8 * full);
    assert_true(fabs(joint.s_lambda[40] - m.s_lambda[40]) < 5 * third);
    joint_free(&joint);
}

/* The bands as they are where the sample axis stands 0.03 deg beside what it says. */
static void shift_sample_axis(double shift_deg, struct dice *d) {
    const struct reflectance_optics optics = {.kappa = 1, .q = 1};
    double value[MATERIAL_PARAMETERS];
    memcpy(value, m.value, sizeof value);
    for (size_t i = 0; i < m.input.n; i++) {
        struct reflectance_geometry g;
        assert_int_equal(
            reflectance_geometry(&g, m.theta_i_deg[i] - shift_deg, m.theta_v_deg[i] + shift_deg, NULL), 0);
        double sum = 0, square = 0;
        for (int b = 0; b < BANDS; b++) {
            const size_t at = i * BANDS + (size_t)b;
            value[MATERIAL_S] = m.s_lambda[b];
            assert_int_equal(
                reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, &optics, &m.band_beta[at], NULL, NULL),
                0);
            m.band_u[at] = 0.002 * m.band_beta[at] + 1e-4;
            m.band_beta[at] += m.band_u[at] * dice_normal(d);
            const bool in_mean = b >= 4 && b <= 64;
            sum += in_mean ? m.band_beta[at] : 0;
            square += in_mean ? m.band_u[at] * m.band_u[at] : 0;
        }
        m.beta[i] = sum / 61;
        m.u[i] = sqrt(square) / 61;
    }
}

static void a_zero_of_the_axes_is_found(void **state) {
    (void)state;
    struct dice d = {21};
    for (int set = 0; set < GONIOMETRY_SETS; set++) {
        struct estimate means;
        struct joint joint, held;
        goniometry_make(&m, goniometry_set[set], 60, 5);
        goniometry_colour(&m, 0.05, 0.4);
        shift_sample_axis(0.03, &d);
        m.input.u_zero_sample_deg = 0.03;
        fit(&m.input, false, &means, &joint);
        assert_false(joint.misfit);
        for (int p = MATERIAL_SIGMA; p <= MATERIAL_N; p++) {
            double pull = (joint.value[p] - m.value[p]) / joint_u(&joint, p, -1);
            assert_true(fabs(pull) < 4);
        }
        for (int b = 0; b < BANDS; b++) {
            assert_true(fabs(joint.s_lambda[b] - m.s_lambda[b]) < 4.5 * joint_u(&joint, MATERIAL_S, b));
        }
        m.input.hold_offset = true; /* then its prior alone says what it does, and u is larger */
        fit(&m.input, false, &means, &held);
        assert_true(joint_u(&held, MATERIAL_N, -1) > 2 * joint_u(&joint, MATERIAL_N, -1));
        joint_free(&held);
        joint_free(&joint);
    }
}

/* Correlated noise of bands, a scale all share, a zero, and a lamp that drifts, each drawn as stated. */
struct draw {
    double scale[GONIOMETRY_MAX], *mean_scale;
    double tau_us[GONIOMETRY_MAX];
    struct estimate_common certificate;
    struct estimate_bracket bracket;
};

static void draw_all(struct draw *w, int set, struct dice *d) {
    goniometry_make(&m, goniometry_set[set], 60, 5);
    goniometry_colour(&m, 0.05, 0.4);
    memcpy(clean, m.band_truth, sizeof clean);
    const double certificate = dice_normal(d), rate = 1e-9;
    double walk = 0;
    for (size_t i = 0; i < m.input.n; i++) {
        double last = dice_normal(d), together = dice_normal(d), sum = 0, square = 0;
        walk += sqrt(rate * 20) * dice_normal(d); /* not closed: a plain random walk */
        w->tau_us[i] = 20e6 * (double)(i + 1);
        for (int b = 0; b < BANDS; b++) {
            const size_t at = i * BANDS + (size_t)b;
            const double next = dice_normal(d), u = RELATIVE * clean[at] + 1e-4;
            /* sqrt(a) own + sqrt(b) next: a + b = 1, sqrt(a b) = 1/4; a tenth of u is common to the bands */
            const double own = sqrt(0.9330127) * last + sqrt(0.0669873) * next;
            m.band_u[at] = u * sqrt(1 + 0.01);
            cov_next[at] = b + 1 < BANDS ? u * (RELATIVE * clean[at + 1] + 1e-4) * (0.25 + 0.01) : NAN;
            m.band_beta[at] = clean[at] * (1 + 0.003 * certificate + walk) + u * (own + 0.1 * together);
            last = next;
        }
        for (int b = 4; b <= 64; b++) {
            const size_t at = i * BANDS + (size_t)b;
            const double v = m.band_u[at] * m.band_u[at] / 1.01;
            sum += m.band_beta[at] / 61;
            square += v * 1.01 + (b < 64 ? 2 * cov_next[at] : 0);
            for (int c = 4; c <= 64; c++) { /* beyond the neighbours, what is common */
                const double other = m.band_u[i * BANDS + (size_t)c] / sqrt(1.01);
                square += abs(c - b) > 1 ? 0.01 * sqrt(v) * other : 0;
            }
        }
        m.beta[i] = sum;
        m.u[i] = sqrt(square) / 61;
        w->scale[i] = 0.003 * sum;
    }
    w->certificate = (struct estimate_common){.n = m.input.n, .mean = w->scale};
    w->bracket = (struct estimate_bracket){.n = m.input.n, .tau_us = w->tau_us, .rate = rate};
    m.input.n_common = m.input.n_bracket = 1;
    m.input.common = &w->certificate;
    m.input.bracket = &w->bracket;
    m.input.band_cov_next = cov_next;
}

/* Chi-square of n degrees at z standard deviations, by Wilson and Hilferty. */
static double chi2_point(double n, double z) {
    return n * pow(1 - 2 / (9 * n) + z * sqrt(2 / (9 * n)), 3);
}

#define DRAWS 32
static void pulls_are_as_stated(void **state) {
    (void)state;
    static const int bands[] = {2, 30, 60};
    static struct draw w;
    enum { N = 7 };
    int misfits = 0;
    for (int set = 0; set < GONIOMETRY_SETS; set += 2) {
        for (int per_band = 0; per_band < 2; per_band++) {
            double sum[N] = {0}, square[N] = {0};
            for (int seed = 1; seed <= DRAWS / (1 + per_band); seed++) {
                struct dice d = {(uint64_t)(1000 * set + seed)};
                struct estimate means;
                struct joint joint;
                draw_all(&w, set, &d);
                fit(&m.input, per_band, &means, &joint);
                misfits += joint.misfit;
                for (int i = 0; i < N; i++) {
                    bool shared = i < 4;
                    int p = shared ? MATERIAL_SIGMA + i : MATERIAL_S, band = shared ? -1 : bands[i - 4];
                    double truth = shared ? m.value[p] : m.s_lambda[band];
                    double value = shared ? joint.value[p] : joint.s_lambda[band];
                    if (p == MATERIAL_BETA_PRIME && per_band) {
                        band = 50;
                        value = joint.beta_prime[band];
                    }
                    double pull = (value - truth) / joint_u(&joint, p, band);
                    sum[i] += pull;
                    square[i] += pull * pull;
                }
                joint_free(&joint);
            }
            const double n = DRAWS / (1 + per_band);
            for (int i = 0; i < N; i++) {
                print_message("# set %d, %s, %d: mean pull %.2f, mean square %.2f of %g\n", set,
                              per_band ? "beta' per band" : "one beta'", i, sum[i] / n, square[i] / n, n);
                assert_true(fabs(sum[i] / n) < 4 / sqrt(n));
                assert_true(square[i] / n > chi2_point(n, -4) / n && square[i] / n < chi2_point(n, 4) / n);
            }
        }
    }
    assert_true(misfits <= 2); /* one in a thousand */
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(reaches_the_full_problems_answer),
        cmocka_unit_test(a_bound_is_held),
        cmocka_unit_test(one_band_is_the_ordinary_fit),
        cmocka_unit_test(missing_bands_and_values_stay_out),
        cmocka_unit_test(a_zero_of_the_axes_is_found),
        cmocka_unit_test(pulls_are_as_stated),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
