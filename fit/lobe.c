#include "fit/lobe.h"

#include <math.h>

#define WIDTHS_MAX 1e150 /* its square is finite; D is 0, or (tail 2) below 1e-149, from there on */

struct lobe lobe_gaussian(double phi_rad, double gamma) {
    double widths = phi_rad / gamma, log_d = -M_LN2 * widths * widths;
    return (struct lobe){exp(log_d), -2 * log_d / gamma, 0};
}

struct lobe_tail lobe_tail_of(double tail) {
    double w = tail * M_LN2, w2 = w * w, bend;
    if (w < 0.25) { /* Bernoulli's series, to 1e-16 */
        double rest = -1.0 / 720 + w2 * (1.0 / 30240 + w2 * (-1.0 / 1209600 + w2 * (1.0 / 47900160)));
        bend = M_LN2 * (0.5 + w * (1.0 / 12 + w2 * rest));
    } else {
        bend = (w / -expm1(-w) - 1) / tail;
    }
    return (struct lobe_tail){tail, tail > 0 ? expm1(w) / tail : M_LN2, bend};
}

/* (log1p(u) - u / (1 + u)) / tail^2, which is positive, from xs = u / tail; log_u = log1p(u). */
static double rise(double u, double log_u, double tail, double xs) {
    if (u >= 0.5) {
        return (log_u - u / (1 + u)) / tail / tail;
    }
    /* u = 2s / (1 - s): log1p(u) = 2 artanh(s). No term cancels, and tail may be 0. */
    double s = u / (2 + u), s2 = s * s, r = xs / (2 + u), sum = 0;
    for (int odd = 25; odd >= 3; odd -= 2) { /* s <= 0.2: the next term is below 1e-19 */
        sum = sum * s2 + 1.0 / odd;
    }
    return 2 * r * r * (1 / (1 + s) + s * sum);
}

struct lobe lobe_tailed(const struct lobe_tail *t, double phi_rad, double gamma) {
    double widths = fmin(phi_rad / gamma, WIDTHS_MAX), xs = t->strength * widths * widths;
    double u = xs * t->tail, log_u = log1p(u);
    double log_d = u > 1e-16 ? -xs * (log_u / u) : -xs;
    return (struct lobe){exp(log_d), 2 * xs / (1 + u) / gamma,
                         rise(u, log_u, t->tail, xs) - t->bend * xs / (1 + u)};
}
