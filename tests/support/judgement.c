#include "tests/support/judgement.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "proto/units.h"

#define U_ZERO_DEG 0.01    /* sim_config_default */
#define U_REPEAT_DEG 0.002 /* likewise */
#define DRIFT_RATE 1e-9    /* relative variance per second of the lamp, likewise */
#define BRACKET_S 900

static double true_mean(const struct sim_surface *surface, double theta_i_deg, double theta_v_deg) {
    double sum = 0;
    int n = 0;
    for (int k = 0; k < BANDS; k++)
        if (band_nm(k) >= 400 && band_nm(k) <= 700) {
            sum += sim_surface_beta(surface, theta_i_deg, theta_v_deg, k);
            n++;
        }
    return sum / n;
}

/* Angle parts are no part of a point's u (measurement.md 6): slope of the truth times what the stage states. */
static double angle_variance(const struct sim_surface *s, double i, double v) {
    const double u2 = U_ZERO_DEG * U_ZERO_DEG + U_REPEAT_DEG * U_REPEAT_DEG, h = 0.05;
    double by_i = (true_mean(s, i + h, v) - true_mean(s, i - h, v)) / (2 * h);
    double by_v = (true_mean(s, i, v + h) - true_mean(s, i, v - h)) / (2 * h);
    return u2 * (by_i * by_i + (by_v - by_i) * (by_v - by_i));
}

static int judge(void *arg, const struct point *p) {
    struct judgement *j = arg;
    if (p->provisional) { /* of a bracket that was broken off: its geometry has been measured again */
        j->provisional++;
        return 0;
    }
    double i = deg_from_udeg(p->theta_i_udeg), v = deg_from_udeg(p->theta_v_udeg);
    double truth = true_mean(&j->surface, i, v);
    double variance = p->mean_u_ind * p->mean_u_ind + angle_variance(&j->surface, i, v);
    for (int k = 0; k < p->n_common; k++)
        variance += p->common[k].mean * p->common[k].mean;
    variance += DRIFT_RATE * BRACKET_S / 2 * truth * truth;
    double pull = (p->mean - truth) / sqrt(variance);
    if (j->n < JUDGED_MAX) {
        j->mean[j->n] = p->mean;
        j->at[j->n][0] = p->theta_i_udeg;
        j->at[j->n][1] = p->theta_v_udeg;
    }
    j->n++;
    j->sum += pull;
    j->sum2 += pull * pull;
    j->worst = fmax(j->worst, fabs(pull));
    return 0;
}

void judge_session(struct session *s, struct judgement *j) {
    struct sim_surface surface = j->surface;
    struct err e = {0};
    memset(j, 0, sizeof *j);
    j->surface = surface;
    if (session_each_point(s, false, judge, j, &e) < 0)
        fail_msg("%s", e.text);
}

void judge_green(struct session *s, const char *support, int water_percent, struct judgement *j) {
    assert_int_equal(sim_paint_find("Hooker's Green", support, water_percent, &j->surface, NULL), 0);
    judge_session(s, j);
}
