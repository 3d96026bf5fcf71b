#include <math.h>
#include <string.h>

#include "daemon/plan_parts.h"
#include "proto/units.h"

/* In the plane of incidence a spot widens with 1/cos of its angle; across it keeps its diameter. */
static double widened_mm(double diameter_mm, int32_t angle_udeg) {
    return diameter_mm / cos(rad_from_deg(deg_from_udeg(angle_udeg)));
}

bool plan_spots_nest(const struct config *config, int32_t theta_i_udeg, int32_t theta_v_udeg,
                     char why[PLAN_WHY]) {
    bool view_inside = config->optics.filling == FILLING_VIEW_IN_BEAM;
    double beam = widened_mm(config->optics.beam_mm, theta_i_udeg);
    double view = widened_mm(config->optics.view_mm, theta_v_udeg);
    double inner = view_inside ? view : beam, outer = view_inside ? beam : view;
    if (inner <= outer)
        return true;
    snprintf(why, PLAN_WHY, "between the two filling cases: the %s is %.1f mm wide, the %s only %.1f mm",
             view_inside ? "view" : "beam", inner, view_inside ? "beam" : "view", outer);
    return false;
}

bool plan_spot_on(const struct config *config, int32_t theta_i_udeg, int32_t theta_v_udeg,
                  const double size_mm[2], const char *surface, char why[PLAN_WHY]) {
    bool view_inside = config->optics.filling == FILLING_VIEW_IN_BEAM;
    double across = view_inside ? config->optics.view_mm : config->optics.beam_mm;
    double along = widened_mm(across, view_inside ? theta_v_udeg : theta_i_udeg);
    if (along <= size_mm[0] && across <= size_mm[1])
        return true;
    snprintf(why, PLAN_WHY, "the %s, %.1f x %.1f mm, is larger than %.48s, %g x %g mm",
             view_inside ? "view" : "beam", along, across, surface, size_mm[0], size_mm[1]);
    return false;
}

bool plan_certified(const struct planner *p, int32_t theta_i_udeg, int32_t theta_v_udeg, char why[PLAN_WHY]) {
    double beta[BANDS], u[BANDS], used;
    bool covered[BANDS];
    struct err e = {0};
    const struct job *job = p->job;
    if (certificate_at(&job->certificate, deg_from_udeg(theta_i_udeg), deg_from_udeg(theta_v_udeg),
                       job->reference.angular_u_rel, beta, u, covered, &used, &e) < 0) {
        snprintf(why, PLAN_WHY, "%.*s", PLAN_WHY - 1, e.text);
        return false;
    }
    for (int band = 0; band < BANDS; band++)
        if (!covered[band] && band_nm(band) >= job->mean_nm[0] && band_nm(band) <= job->mean_nm[1]) {
            snprintf(why, PLAN_WHY,
                     "the certificate says nothing at %d nm, which the mean of %d .. %d nm needs",
                     band_nm(band), job->mean_nm[0], job->mean_nm[1]);
            return false;
        }
    return true;
}

static bool in_limits(const struct config_axis *axis, const char *name, int32_t udeg, char why[PLAN_WHY]) {
    if (udeg >= udeg_from_deg(axis->limits_deg[0]) && udeg <= udeg_from_deg(axis->limits_deg[1]))
        return true;
    snprintf(why, PLAN_WHY, "needs the %s axis at %g deg, outside its limits %g .. %g deg", name,
             deg_from_udeg(udeg), axis->limits_deg[0], axis->limits_deg[1]);
    return false;
}

static bool sample_axis_reaches(const struct planner *p, int32_t udeg, char why[PLAN_WHY]) {
    const struct config_axis *axis = &p->config->sample;
    if (axis->kind == CONFIG_AXIS_MOTOR)
        return in_limits(axis, "sample", udeg, why);
    if (axis->kind == CONFIG_AXIS_MANUAL || udeg == udeg_from_deg(axis->fixed_deg))
        return true;
    snprintf(why, PLAN_WHY, "needs the sample axis at %g deg, but it is fixed at %g deg", deg_from_udeg(udeg),
             axis->fixed_deg);
    return false;
}

bool plan_reach(const struct planner *p, int32_t theta_i_udeg, int32_t theta_v_udeg, bool mirrored,
                struct plan_point *point, char why[PLAN_WHY]) {
    int sign = mirrored ? -1 : 1;
    *point = (struct plan_point){.theta_i_udeg = theta_i_udeg,
                                 .theta_v_udeg = theta_v_udeg,
                                 .source_udeg = sign * (theta_i_udeg + theta_v_udeg),
                                 .sample_udeg = sign * theta_v_udeg,
                                 .mirrored = mirrored,
                                 .reference_step = -1};
    int32_t blind = udeg_from_deg(p->config->source.blind_deg);
    if (point->source_udeg > -blind && point->source_udeg < blind) {
        snprintf(why, PLAN_WHY,
                 "blind zone: the source would stand %g deg from the sensor, nearer than %g deg",
                 fabs(deg_from_udeg(point->source_udeg)), p->config->source.blind_deg);
        return false;
    }
    if (!sample_axis_reaches(p, point->sample_udeg, why) ||
        !in_limits(&p->config->source, "source", point->source_udeg, why))
        return false;
    if (!plan_in_zone(p, point->source_udeg, point->sample_udeg))
        return true;
    snprintf(why, PLAN_WHY, "keep-out zone: source at %g and sample at %g deg is forbidden",
             deg_from_udeg(point->source_udeg), deg_from_udeg(point->sample_udeg));
    return false;
}
