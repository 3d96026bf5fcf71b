#include "sim/optics.h"

#include <math.h>
#include <stdbool.h>

#include "proto/units.h"

#define PI 3.14159265358979323846

/* Semi-axes a in the plane of incidence, b across it. */
struct ellipse {
    double a, b;
};

static double quadrant_sector(const struct ellipse *e, double slope) {
    return e->a * e->b / 2 * atan(slope * e->a / e->b);
}

static double overlap(const struct ellipse *p, const struct ellipse *q) {
    const struct ellipse *narrow = p->a <= q->a ? p : q, *wide = narrow == p ? q : p;
    if (narrow->b <= wide->b)
        return PI * narrow->a * narrow->b;
    double x = 1 / (narrow->a * narrow->a) - 1 / (wide->a * wide->a);
    double y = 1 / (wide->b * wide->b) - 1 / (narrow->b * narrow->b);
    double slope = sqrt(x / y); /* of the ray through a point where they cross */
    return 4 * (quadrant_sector(narrow, slope) + PI / 4 * wide->a * wide->b - quadrant_sector(wide, slope));
}

double optics_overlap_mm2(const struct optics *o, double theta_i_deg, double theta_v_deg) {
    struct ellipse beam = {o->beam_mm / 2 / cos(rad_from_deg(theta_i_deg)), o->beam_mm / 2};
    struct ellipse view = {o->view_mm / 2 / cos(rad_from_deg(theta_v_deg)), o->view_mm / 2};
    return overlap(&beam, &view);
}

static double light(const struct optics *o, double theta_i_deg, double theta_v_deg) {
    double irradiance = cos(rad_from_deg(theta_i_deg)) / (PI * o->beam_mm * o->beam_mm / 4);
    double radiance = irradiance / PI;
    return radiance * optics_overlap_mm2(o, theta_i_deg, theta_v_deg) * cos(rad_from_deg(theta_v_deg));
}

double optics_throughput(const struct optics *o, double theta_i_deg, double theta_v_deg) {
    bool lit = fabs(theta_i_deg) < 90 && fabs(theta_v_deg) < 90;
    return lit ? light(o, theta_i_deg, theta_v_deg) / light(o, 0, 0) : 0;
}
