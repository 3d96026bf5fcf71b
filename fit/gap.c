#include "fit/gap.h"

#include <math.h>
#include <stdio.h>

#include "fit/suggest.h"
#include "fit/words.h"
#include "proto/units.h"

#define TRADE_MIN 0.9 /* correlation beyond which two parameters are told together or not at all */

static const char *name_of(const struct estimate *m, enum material_parameter at) {
    return at == MATERIAL_BETA_PRIME ? "beta'" : material_parameter_name(m->model, at);
}

/* phi of a point: of the middle of what source and sensor see, where they are wide. */
static double phi_of(const struct problem *p, size_t i) {
    const size_t nodes = (size_t)p->aperture.nodes;
    return p->aperture.geometry[i * nodes + nodes / 2].phi_rad;
}

size_t gap_flank_points(const struct problem *p, double gamma) {
    size_t count = 0;
    for (size_t i = 0; i < p->n; i++) {
        double widths = phi_of(p, i) / gamma, d = exp2(-widths * widths);
        count += d > 1e-3 && d < 0.9;
    }
    return count;
}

double gap_nearest_phi(const struct problem *p) {
    double nearest_rad = INFINITY;
    for (size_t i = 0; i < p->n; i++) {
        nearest_rad = fmin(nearest_rad, phi_of(p, i));
    }
    return nearest_rad;
}

/* The other parameter it hangs together with most; -1: with none beyond TRADE_MIN. */
static int partner(const struct estimate *m, enum material_parameter at, double *correlation) {
    int best = -1;
    *correlation = 0;
    for (int other = 0; other < MATERIAL_PARAMETERS; other++) {
        double own = m->statistical[at][at] + m->common[at][at];
        double its = m->statistical[other][other] + m->common[other][other];
        double both = m->statistical[at][other] + m->common[at][other];
        double r = other != (int)at && own > 0 && its > 0 ? both / sqrt(own * its) : 0;
        if (fabs(r) > fmax(TRADE_MIN, fabs(*correlation))) {
            *correlation = r;
            best = other;
        }
    }
    return best;
}

static void say_why(const struct gap *gap, const struct problem *p, const double *value, struct estimate *m) {
    const enum material_parameter at = reflectance_parameter(p->model, gap->column);
    const bool is_width = reflectance_kind(p->model, at) == REFLECTANCE_WIDTH;
    char *why = m->gap[at].why;
    const size_t size = sizeof m->gap[at].why, flank = is_width ? gap_flank_points(p, value[at]) : 0;
    double r;
    int other = partner(m, at, &r);
    if (!gap->is_free && m->at_bound[at] && reflectance_kind(p->model, at) == REFLECTANCE_HEIGHT) {
        snprintf(
            why, size,
            "a lobe narrower than the %.2g deg from the mirror direction to the nearest point is not seen",
            2 * deg_from_rad(gap_nearest_phi(p)));
    } else if (!gap->is_free && m->at_bound[at]) {
        snprintf(why, size, "every value of it within its bounds fits these points");
    } else if (!gap->is_free) {
        snprintf(why, size, "no lobe in these points shows it");
    } else if (is_width && flank < 2) {
        snprintf(why, size, "%zu of the points lie on the flank of its lobe, %.2g deg of viewing angle wide",
                 flank, 2 * deg_from_rad(value[at]));
    } else if (other >= 0) {
        snprintf(why, size,
                 "at incidence %.3g to %.3g deg it trades with %s (correlation %.4f); known to %.0f %%",
                 m->theta_i_low_deg, m->theta_i_high_deg, name_of(m, (enum material_parameter)other), r,
                 100 * fmin(gap->relative_u, 100));
    } else {
        snprintf(why, size,
                 "at incidence %.3g to %.3g deg, viewing %.3g to %.3g deg, it is known to %.0f %% only",
                 m->theta_i_low_deg, m->theta_i_high_deg, m->theta_v_low_deg, m->theta_v_high_deg,
                 100 * fmin(gap->relative_u, 100));
    }
}

int gap_explain(const struct gap *gap, const struct problem *p, const double *value,
                const struct uncertainty *u, struct estimate *m, struct err *e) {
    const enum material_parameter at = reflectance_parameter(p->model, gap->column);
    struct suggestion next = {0};
    int status = suggest_next(p, value, u->fisher, gap->column, &next, e);
    say_why(gap, p, value, m);
    m->gap[at].has_next = status == 0;
    m->gap[at].next_theta_i_deg = next.theta_i_deg;
    m->gap[at].next_theta_v_deg = next.theta_v_deg;
    words_warn(
        m, "%s is not identifiable from these angles: %s; measure next at incidence %g deg, viewing %g deg",
        name_of(m, at), m->gap[at].why, next.theta_i_deg, next.theta_v_deg);
    return status;
}
