#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/estimate.h"
#include "fit/reflectance.h"
#include "tests/support/goniometry.h"

/* measurement.md 8 anew, sharing nothing with the code under test but the fit itself: H by refitting with one point
 * moved at a time, V written out as an n by n matrix, and H V H^T beside what the estimate states. */
#define K 5
#define N 102 /* 6 incidences, theta_v by 10 */
#define SWEEP 17
#define REPEAT_SOURCE_DEG 0.01
#define REPEAT_SAMPLE_DEG 0.006
#define ZERO_SOURCE_DEG 0.02
#define ZERO_SAMPLE_DEG 0.03
#define RATE 2e-9 /* 1/s */
#define TOLERANCE 1e-3
/* What a found mirror offset leaves of the zeros is a small difference of large terms of the refits. */
#define TOLERANCE_COMMON 5e-3

static struct goniometry m;
static const struct reflectance_optics plain = {.kappa = 1, .q = 1};
static double h[K][N], independent[N][N], common[N][N];

static double model(const double *value, double i_deg, double v_deg) {
    struct reflectance_geometry g;
    double beta;
    assert_int_equal(reflectance_geometry(&g, i_deg, v_deg, NULL), 0);
    assert_int_equal(reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, &plain, &beta, NULL, NULL), 0);
    return beta;
}

/* The causes as the fit is told of them. */
static double scale[N], reading[SWEEP], tau_us[N], tau_r_us[N];
static int sweep_index[6][SWEEP];
static struct estimate_common causes[2];
static struct estimate_bracket brackets[6];

static void tell(void) {
    for (int i = 0; i < N; i++) {
        scale[i] = 0.01 * m.truth[i];
        tau_us[i] = 30e6 * (i % SWEEP + 1);
        tau_r_us[i] = 30e6 * (i % SWEEP) + 5e6;
        sweep_index[i / SWEEP][i % SWEEP] = i;
    }
    for (int k = 0; k < SWEEP; k++) {
        reading[k] = 0.004 * m.truth[3 * SWEEP + k];
    }
    causes[0] = (struct estimate_common){.mean = scale};
    causes[1] = (struct estimate_common){.n = SWEEP, .point = sweep_index[3], .mean = reading};
    for (int b = 0; b < 6; b++) { /* the last is still open, the fourth has readings of its own */
        brackets[b] = (struct estimate_bracket){.n = SWEEP,
                                                .point = sweep_index[b],
                                                .tau_us = &tau_us[b * SWEEP],
                                                .tau_r_us = b == 3 ? &tau_r_us[b * SWEEP] : NULL,
                                                .length_us = b == 5 ? 0 : 600e6,
                                                .rate = RATE};
    }
    m.input.common = causes;
    m.input.n_common = 2;
    m.input.bracket = brackets;
    m.input.n_bracket = 6;
    m.input.u_repeat_source_deg = REPEAT_SOURCE_DEG;
    m.input.u_repeat_sample_deg = REPEAT_SAMPLE_DEG;
    m.input.u_zero_source_deg = ZERO_SOURCE_DEG;
    m.input.u_zero_sample_deg = ZERO_SAMPLE_DEG;
}

/* Lamp at two times, in s: of a bridge of 600 s, or of a walk. */
static double lamp(int bracket, double a_s, double b_s) {
    double first_s = fmin(a_s, b_s), last_s = fmax(a_s, b_s);
    return RATE * first_s * (bracket == 5 ? 1 : (600 - last_s) / 600);
}

static double drift(int i, int j) {
    int b = i / SWEEP;
    if (b != j / SWEEP) {
        return 0;
    }
    double ti_s = 30.0 * (i % SWEEP + 1), tj_s = 30.0 * (j % SWEEP + 1);
    double c = lamp(b, ti_s, tj_s);
    if (b == 3) {
        double ri_s = ti_s - 25, rj_s = tj_s - 25;
        c += lamp(b, ri_s, rj_s) - lamp(b, ti_s, rj_s) - lamp(b, ri_s, tj_s);
    }
    return c * m.truth[i] * m.truth[j];
}

static void write_out_v(void) {
    double source[N], sample[N], step_deg = 1e-3;
    for (int i = 0; i < N; i++) {
        double a = m.theta_i_deg[i], b = m.theta_v_deg[i];
        source[i] = (model(m.value, a + step_deg, b) - model(m.value, a - step_deg, b)) / (2 * step_deg);
        sample[i] =
            (model(m.value, a - step_deg, b + step_deg) - model(m.value, a + step_deg, b - step_deg)) /
            (2 * step_deg);
    }
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            independent[i][j] = drift(i, j);
            common[i][j] = scale[i] * scale[j] + source[i] * source[j] * pow(ZERO_SOURCE_DEG, 2) +
                           sample[i] * sample[j] * pow(ZERO_SAMPLE_DEG, 2);
            if (i / SWEEP == 3 && j / SWEEP == 3) {
                common[i][j] += reading[i % SWEEP] * reading[j % SWEEP];
            }
        }
        independent[i][i] +=
            m.u[i] * m.u[i] + pow(source[i] * REPEAT_SOURCE_DEG, 2) + pow(sample[i] * REPEAT_SAMPLE_DEG, 2);
    }
}

static void refit(struct estimate *estimate) {
    struct err e = {0};
    if (estimate_fit(&m.input, estimate, &e)) {
        fail_msg("%s", e.text);
    }
    assert_true(estimate->converged);
}

static void find_h(void) {
    for (int i = 0; i < N; i++) {
        struct estimate up, down;
        double step = 0.2 * m.u[i];
        m.beta[i] = m.truth[i] + step;
        refit(&up);
        m.beta[i] = m.truth[i] - step;
        refit(&down);
        m.beta[i] = m.truth[i];
        for (int k = 0; k < K; k++) {
            h[k][i] = (up.value[k] - down.value[k]) / (2 * step);
        }
    }
}

static double sandwich(double v[N][N], int a, int b) {
    double sum = 0;
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) {
            sum += h[a][i] * v[i][j] * h[b][j];
        }
    }
    return sum;
}

static void check(bool unweighted) {
    struct estimate estimate;
    goniometry_make(&m, goniometry_set[2], 60, 10);
    assert_int_equal(m.input.n, N);
    m.input.unweighted = unweighted;
    tell();
    write_out_v();
    refit(&estimate);
    find_h();
    for (int a = 0; a < K; a++) {
        for (int b = 0; b <= a; b++) {
            double by_noise = sandwich(independent, a, b), by_causes = sandwich(common, a, b);
            double noise_size = sqrt(estimate.statistical[a][a] * estimate.statistical[b][b]);
            double cause_size = sqrt(estimate.common[a][a] * estimate.common[b][b]);
            assert_float_equal((estimate.statistical[a][b] - by_noise) / noise_size, 0, TOLERANCE);
            assert_float_equal((estimate.common[a][b] - by_causes) / cause_size, 0, TOLERANCE_COMMON);
        }
    }
}

static void weighted_covariance_is_h_v_ht(void **state) {
    (void)state;
    check(false);
}

static void unweighted_covariance_is_h_v_ht(void **state) {
    (void)state;
    check(true);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(weighted_covariance_is_h_v_ht),
        cmocka_unit_test(unweighted_covariance_is_h_v_ht),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
