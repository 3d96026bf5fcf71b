#include "fit/quality.h"

#include <math.h>
#include <stdlib.h>

#include "fit/lobe.h"

#define BETA_FLOOR 0.005 /* measurement.md 10: below it an error is judged as absolute */

double quality_chi2_limit(double mean, double variance) {
    double scale = variance / (2 * mean), degrees = 2 * mean * mean / variance;
    double shrink = 2 / (9 * degrees);
    double root = 1 - shrink + QUALITY_Z_999 * sqrt(shrink);
    return scale * degrees * root * root * root;
}

double quality_bic(double chi2, double n, double n_effective, int n_parameters, bool u_stated) {
    double misfit = u_stated ? chi2 * n_effective / n : n_effective * log(fmax(chi2 / n, 1e-300));
    return misfit + n_parameters * log(n_effective);
}

double quality_r2(const struct problem *p) {
    double mean = 0, left = 0, all = 0;
    for (size_t i = 0; i < p->n; i++) {
        mean += p->input->beta[i] / (double)p->n;
    }
    for (size_t i = 0; i < p->n; i++) {
        double r = p->input->beta[i] - p->model_beta[i], d = p->input->beta[i] - mean;
        left += r * r;
        all += d * d;
    }
    return all > 0 ? 1 - left / all : 0;
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int quality_median_error(const struct problem *p, double *error, struct err *e) {
    double *size = malloc((p->n + 1) * sizeof *size);
    if (!size) {
        return err_set(e, ERR_NOMEM, "no memory for the residuals of %zu points", p->n);
    }
    for (size_t i = 0; i < p->n; i++) {
        size[i] = fabs(p->input->beta[i] - p->model_beta[i]) / fmax(p->input->beta[i], BETA_FLOOR);
    }
    qsort(size, p->n, sizeof *size, ascending);
    *error = p->n % 2 ? size[p->n / 2] : (size[p->n / 2 - 1] + size[p->n / 2]) / 2;
    free(size);
    return 0;
}

/* Integral of D sin(2 phi) dphi, by Simpson in t of phi = gamma sinh(t): it meets the peak and a far tail with equal
 * ease. Error below 1e-8 for any width of the bounds. */
static double lobe_integral(const struct lobe_tail *tail, double gamma) {
    const int intervals = 512;
    double h = asinh(M_PI_2 / gamma) / intervals, sum = 0;
    for (int i = 0; i <= intervals; i++) {
        double phi = fmin(gamma * sinh(i * h), M_PI_2);
        double weight = i == 0 || i == intervals ? 1 : i % 2 ? 4 : 2;
        sum += weight * lobe_tailed(tail, phi, gamma).value * sin(2 * phi) * gamma * cosh(i * h);
    }
    return sum * h / 3;
}

double quality_specular_energy(enum reflectance_model model, const double *value) {
    if (reflectance_column(model, MATERIAL_GAMMA) < 0) {
        return 0;
    }
    enum reflectance_kind extra = reflectance_kind(model, MATERIAL_EXTRA_1);
    struct lobe_tail tail = lobe_tail_of(extra == REFLECTANCE_TAIL ? value[MATERIAL_EXTRA_1] : 0);
    double sum = value[MATERIAL_BETA_PRIME] * lobe_integral(&tail, value[MATERIAL_GAMMA]);
    if (extra == REFLECTANCE_WIDTH) {
        sum += value[MATERIAL_EXTRA_2] * lobe_integral(&tail, value[MATERIAL_EXTRA_1]);
    }
    return 4 * sum;
}

double quality_negative_from_deg(double sigma) {
    for (int deg = 1; deg < 90; deg++) {
        struct reflectance_geometry g;
        double l1, l2;
        if (reflectance_geometry(&g, deg, deg, NULL) == 0) {
            reflectance_diffuse_factors(&g, sigma, &l1, &l2);
            if (l1 < 0) {
                return deg;
            }
        }
    }
    return NAN;
}
