#include "fit/fresnel.h"

#include <math.h>

struct interface { /* of one angle and index: both reflectances with their parts */
    double root, sum, cr, r, rs, t;
};

static struct interface interface_at(double c, double s2, double n) {
    double n2_1 = (n - 1) * (n + 1), root = sqrt(n2_1 + c * c), sum = root + c, cr = c * root;
    double r = n2_1 / (sum * sum);
    return (struct interface){root, sum, cr, r, r * r, (cr - s2) / (cr + s2)}; /* R_s = rs, R_p = rs t^2 */
}

double fresnel_reflectance(double cos_q, double sin2_q, double n, double polarisation, double *slope) {
    struct interface x = interface_at(cos_q, sin2_q, n);
    double parallel = 1 - polarisation, both = (1 + polarisation) + parallel * (x.t * x.t);
    /* 2n/(n^2-1) - 2n/(q(q+c)) = 2nc/(q(n^2-1)): the difference is taken on paper, it cancels for n near 1. */
    double rs_slope = 4 * n * cos_q * x.r / (x.root * x.sum * x.sum);
    double t_slope = 2 * sin2_q * cos_q * (n / x.root) / ((x.cr + sin2_q) * (x.cr + sin2_q));
    *slope = 0.5 * rs_slope * both + x.rs * parallel * x.t * t_slope;
    return 0.5 * x.rs * both;
}

double fresnel_polarisation_slope(double cos_q, double sin2_q, double n) {
    struct interface x = interface_at(cos_q, sin2_q, n);
    double sum = x.cr + sin2_q;
    return x.rs * 2 * (sin2_q / sum) * (x.cr / sum); /* (1 - t^2) / 2 by its factors */
}

/* T_s = 4 c q / (q + c)^2 and T_p = 4 n^2 c q / (n^2 c + q)^2: 1 - F would lose its digits at grazing. */
double fresnel_transmittance(double cos_q, double n, double *log_slope) {
    double c = cos_q, s2 = (1 - c) * (1 + c), n2 = n * n;
    double n2_1 = (n - 1) * (n + 1), root = sqrt(n2_1 + c * c), sum = root + c, sum_p = n2 * c + root;
    double ts = 4 * (c / sum) * (root / sum), tp = 4 * (n2 * c / sum_p) * (root / sum_p);
    double ts_log = -(n / root) * (n2_1 / (sum * sum)) / root;
    /* (n^2 c - q) / (n^2 c + q) with its difference taken on paper, times (n^2 - 2 q^2) / (n q^2) */
    double brewster = n2_1 / sum_p * ((n2 * c * c - s2) / sum_p);
    double tp_log = brewster * ((2 * s2 - n2) / (n * root)) / root;
    *log_slope = (ts * ts_log + tp * tp_log) / (ts + tp);
    return 0.5 * (ts + tp);
}

double fresnel_transmittance_normal(double n, double *log_slope) {
    *log_slope = -(n - 1) / (n * (n + 1));
    return 4 * (n / (n + 1)) / (n + 1);
}
