#include "tests/support/truth_check.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "proto/units.h"

#define SLOPE_DEG 0.005 /* far below the width of any lobe or the distance of nodes */

/* ---- from the session ---- */

static int take_bracket(void *arg, const struct bracket *b) {
    struct truth_check *c = arg;
    assert_in_range(c->n_brackets, 0, TRUTH_BRACKETS - 1);
    c->bracket[c->n_brackets++] = *b;
    return 0;
}

static int take_point(void *arg, const struct point *p) {
    struct truth_check *c = arg;
    assert_false(p->provisional);
    assert_in_range(c->n_points, 0, TRUTH_POINTS - 1);
    c->point[c->n_points++] = *p;
    return 0;
}

void truth_check_load(struct truth_check *c, struct session *s) {
    struct err e = {0};
    c->n_brackets = c->n_points = 0;
    if (session_each_bracket(s, take_bracket, c, &e) < 0 ||
        session_each_point(s, false, take_point, c, &e) < 0)
        fail_msg("%s", e.text);
}

/* ---- the truth and its slopes ---- */

static double true_value(const struct sim_surface *s, double i_deg, double v_deg, int band) {
    double sum = 0;
    if (i_deg < 0) {
        i_deg = -i_deg;
        v_deg = -v_deg;
    }
    if (band != TRUTH_MEAN)
        return sim_surface_beta(s, i_deg, v_deg, band);
    for (int k = TRUTH_FIRST; k <= TRUTH_LAST; k++)
        sum += sim_surface_beta(s, i_deg, v_deg, k);
    return sum / (TRUTH_LAST - TRUTH_FIRST + 1);
}

/* As it would be reduced at the readbacks if the angles were off by these. */
static double seen(const struct truth_check *c, const struct point *p, double di_deg, double dv_deg,
                   int band) {
    double i = deg_from_udeg(p->theta_i_udeg), v = deg_from_udeg(p->theta_v_udeg), factor = 1;
    double at = c->beam_in_view ? v : i, off = c->beam_in_view ? dv_deg : di_deg;
    if (!c->own_reference)
        factor = cos((at + off) * M_PI / 180) / cos(at * M_PI / 180);
    return factor * true_value(c->truth, i + di_deg, v + dv_deg, band);
}

static double angular_variance(const struct truth_check *c, const struct point *p, int band) {
    static const double way[2][2] = {{1, 0}, {-1, 1}}; /* d theta_i, d theta_v of the source, of the sample */
    const double u[2] = {c->u_source_deg, c->u_sample_deg};
    double sum = 0, here = seen(c, p, 0, 0, band);
    for (int axis = 0; axis < 2; axis++) {
        double steepest = 0;
        for (int side = -1; side <= 1; side += 2) {
            double h = side * SLOPE_DEG, there = seen(c, p, h * way[axis][0], h * way[axis][1], band);
            steepest = fmax(steepest, fabs(there - here) / SLOPE_DEG);
        }
        sum += steepest * u[axis] * steepest * u[axis];
    }
    return sum;
}

/* ---- drift ---- */

static double bridge(double a, double b, double length) {
    double early = fmin(a, b), late = fmax(a, b);
    return early * (length - late) / length;
}

static double drift_variance(const struct truth_check *c, const struct point *p, int band) {
    for (int k = 0; k < c->n_brackets; k++) {
        const struct bracket *b = &c->bracket[k];
        if (b->number != p->bracket)
            continue;
        double length = (b->close_us - b->open_us) * 1e-6, s = p->tau_us * 1e-6, r = p->tau_r_us * 1e-6;
        double rate = band == TRUTH_MEAN ? b->mean_rate : b->rate[band];
        return rate * fmax(0, bridge(s, s, length) + bridge(r, r, length) - 2 * bridge(s, r, length));
    }
    fail_msg("the bracket %d of a point is not in its session", p->bracket);
    return NAN;
}

/* ---- together ---- */

double truth_check_true(const struct truth_check *c, const struct point *p, int band) {
    return seen(c, p, 0, 0, band);
}

double truth_check_variance(const struct truth_check *c, const struct point *p, int band) {
    double value = band == TRUTH_MEAN ? p->mean : p->beta[band];
    double u_ind = band == TRUTH_MEAN ? p->mean_u_ind : p->u_ind[band];
    double sum = u_ind * u_ind + value * value * drift_variance(c, p, band) + angular_variance(c, p, band);
    for (int k = 0; k < p->n_common; k++) {
        const struct point_common *x = &p->common[k];
        double by = band == TRUTH_MEAN ? x->mean : x->sensitivity[band];
        if (!c->nominal || strcmp(x->name, "certificate") != 0)
            sum += by * by;
    }
    return sum;
}

double truth_check_pull(const struct truth_check *c, const struct point *p, int band) {
    double value = band == TRUTH_MEAN ? p->mean : p->beta[band];
    return (value - truth_check_true(c, p, band)) / sqrt(truth_check_variance(c, p, band));
}
