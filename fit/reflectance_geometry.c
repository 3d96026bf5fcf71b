#include "fit/reflectance.h"

#include <math.h>

#include "proto/units.h"

/* Sine and cosine of x in [0, 90] deg from whichever of x and its complement keeps the digits: near 90 deg
 * the radian of x has lost them. */
static double sin_deg(double x_deg, double complement_deg) {
    return x_deg <= 45 ? sin(rad_from_deg(x_deg)) : cos(rad_from_deg(complement_deg));
}

static double cos_deg(double x_deg, double complement_deg) {
    return sin_deg(complement_deg, x_deg);
}

struct angles { /* alpha and beta_ of Oren and Nayar: the larger and the smaller of both */
    double high_deg, low_deg;
    double cos_high, cos_low;
};

static struct angles angles_of(double theta_i_deg, double theta_r_deg) {
    double high_deg = fmax(theta_i_deg, theta_r_deg), low_deg = fmin(theta_i_deg, theta_r_deg);
    return (struct angles){high_deg, low_deg, cos_deg(high_deg, 90 - high_deg),
                           cos_deg(low_deg, 90 - low_deg)};
}

static double tangent_of_low(const struct angles *a) {
    return a->low_deg > 45 ? 1 / tan(rad_from_deg(90 - a->low_deg)) : tan(rad_from_deg(a->low_deg));
}

/* C2 tan(beta_) / k, of either sign of cos(dphi) (reflection-model.md 2.2). */
static double direct_term(const struct angles *a, bool forward) {
    double rest_deg = 90 - a->low_deg, tangent = tangent_of_low(a);
    double sine = sin_deg(a->high_deg, 90 - a->high_deg);
    if (!forward) {
        return 0.45 * sine * tangent;
    }
    double u = a->low_deg / 90, v = rest_deg / 90;
    if (a->low_deg <= 45) {
        return 0.45 * (sine - u * u * u) * tangent;
    }
    /* Both angles towards 90 deg: 0 times infinity in the plain form, 6 / pi in this one. */
    double half = sin(rad_from_deg(90 - a->high_deg) / 2);
    return 0.45 * (v * (3 - 3 * v + v * v) - 2 * half * half) * tangent;
}

/* G / (cos cos) in one piece: taken apart it is 0 / 0 at grazing. */
static double visibility(const struct angles *a, double cos2_q) {
    double shadowed = (1 + a->cos_high / a->cos_low) / cos2_q;
    return fmin(1 / (a->cos_low * a->cos_high), shadowed);
}

static void in_plane(struct reflectance_geometry *g, const struct angles *a, bool forward) {
    /* The half angles are exact sums: which of the two is phi depends on the side. */
    double sum_deg = (a->high_deg + a->low_deg) / 2, difference_deg = (a->high_deg - a->low_deg) / 2;
    double sum_rest_deg = ((90 - a->high_deg) + (90 - a->low_deg)) / 2;
    double q_deg = forward ? sum_deg : difference_deg;
    double q_rest_deg = forward ? sum_rest_deg : 90 - difference_deg;
    double sin_q = sin_deg(q_deg, q_rest_deg), direct = direct_term(a, forward);
    double u = a->low_deg / 90;
    g->phi_rad = rad_from_deg(forward ? difference_deg : sum_deg);
    g->cos_q = cos_deg(q_deg, q_rest_deg);
    g->sin2_q = sin_q * sin_q;
    g->visibility = visibility(a, g->cos_q * g->cos_q);
    g->direct = forward ? -direct : direct;
    g->interreflection = 0.17 * (forward ? 1 + u * u : (90 - a->low_deg) / 90 * (1 + u));
    g->cos_high = a->cos_high;
    g->cos_low = a->cos_low;
}

struct azimuth { /* between the directions to source and sensor: 0 is the source's side */
    double cos_half, sin_half;
    double cosine;
    double rest; /* 1 - |cosine| */
};

static struct azimuth azimuth_of(double dphi_deg) {
    double half_deg = dphi_deg / 2, complement_deg = (180 - dphi_deg) / 2;
    double cos_half = cos_deg(half_deg, complement_deg), sin_half = sin_deg(half_deg, complement_deg);
    bool forward = dphi_deg > 90;
    double cosine = forward ? -sin_deg(dphi_deg - 90, complement_deg * 2) : cos_deg(dphi_deg, 90 - dphi_deg);
    double smaller = forward ? cos_half : sin_half;
    return (struct azimuth){cos_half, sin_half, cosine, 2 * smaller * smaller};
}

/* Out of the plane: all of theta_Q and phi as sums of positive terms (reflection-model.md 2.2). */
static void across(struct reflectance_geometry *g, const struct angles *a, double dphi_deg) {
    struct azimuth z = azimuth_of(dphi_deg);
    double rest_deg = ((90 - a->high_deg) + (90 - a->low_deg)) / 2;
    double sum_deg = (a->high_deg + a->low_deg) / 2,
           difference_rad = rad_from_deg(a->high_deg - a->low_deg) / 2;
    double c = cos_deg(sum_deg, rest_deg), sin_d = sin(difference_rad), cos_d = cos(difference_rad);
    double sines = sin_deg(a->high_deg, 90 - a->high_deg) * sin_deg(a->low_deg, 90 - a->low_deg);
    double u_high = a->high_deg / 90, u = a->low_deg / 90, u2 = u_high * u;
    double turned = sines * (z.cos_half * z.cos_half);
    double cos2_q = c * c + turned;
    g->phi_rad = atan2(sqrt(c * c * (sin_d * sin_d) + turned), c * cos_d);
    g->cos_q = sqrt(cos2_q);
    g->sin2_q = sin_d * sin_d + sines * (z.sin_half * z.sin_half);
    g->visibility = visibility(a, cos2_q);
    g->direct = z.cosine * direct_term(a, z.cosine < 0) +
                z.rest * 0.125 * (u2 * u2) * (sin_deg(sum_deg, rest_deg) / c);
    g->interreflection =
        0.17 * (z.cosine < 0 ? 1 - z.cosine * u * u : z.rest + z.cosine * ((90 - a->low_deg) / 90) * (1 + u));
    g->cos_high = a->cos_high;
    g->cos_low = a->cos_low;
}

int reflectance_geometry(struct reflectance_geometry *g, double theta_i_deg, double theta_v_deg,
                         struct err *e) {
    if (!(theta_i_deg >= 0 && theta_i_deg < 90 && fabs(theta_v_deg) < 90)) {
        return err_set(
            e, ERR_RANGE,
            "incidence %g deg, viewing %g deg is outside the model, which needs 0 <= theta_i < 90 and "
            "-90 < theta_v < 90",
            theta_i_deg, theta_v_deg);
    }
    struct angles a = angles_of(theta_i_deg, fabs(theta_v_deg));
    /* Along the normal there are no sides; one formula then serves both, and exchange keeps its bits. */
    in_plane(g, &a, theta_v_deg > 0 && theta_i_deg > 0);
    return 0;
}

int reflectance_geometry_general(struct reflectance_geometry *g, double theta_i_deg, double theta_r_deg,
                                 double dphi_deg, struct err *e) {
    if (!(theta_i_deg >= 0 && theta_i_deg < 90 && theta_r_deg >= 0 && theta_r_deg < 90 &&
          fabs(dphi_deg) <= 360)) {
        return err_set(
            e, ERR_RANGE,
            "directions %g and %g deg from the normal, azimuths %g deg apart: the model needs both "
            "in 0 <= theta < 90 and the azimuth in -360 .. 360",
            theta_i_deg, theta_r_deg, dphi_deg);
    }
    struct angles a = angles_of(theta_i_deg, theta_r_deg);
    double turn_deg = fabs(dphi_deg) > 180 ? 360 - fabs(dphi_deg) : fabs(dphi_deg);
    if (a.low_deg == 0 || turn_deg == 0 || turn_deg == 180) {
        in_plane(g, &a, a.low_deg > 0 && turn_deg == 180);
    } else {
        across(g, &a, turn_deg);
    }
    return 0;
}
