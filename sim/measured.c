#include "sim/measured.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SAME_DEG 0.05 /* incidences closer than this are one sweep, printed with rounding */

struct point {
    double theta_i_deg, theta_v_deg;
    double beta[BANDS];
};

struct curve {
    double theta_i_deg;
    size_t first, n;
};

struct measured {
    size_t n, n_curves;
    struct point *point; /* by theta_i, then theta_v */
    struct curve *curve;
};

static int by_incidence(const void *a, const void *b) {
    const struct point *p = a, *q = b;
    return (p->theta_i_deg > q->theta_i_deg) - (p->theta_i_deg < q->theta_i_deg);
}

static int by_view(const void *a, const void *b) {
    const struct point *p = a, *q = b;
    return (p->theta_v_deg > q->theta_v_deg) - (p->theta_v_deg < q->theta_v_deg);
}

static double at_wavelength(const double *lambda_nm, size_t n, const double *value, double nm) {
    size_t k = 0;
    while (k + 1 < n && lambda_nm[k + 1] <= nm)
        k++;
    if (nm <= lambda_nm[0] || k + 1 == n)
        return value[k];
    double f = (nm - lambda_nm[k]) / (lambda_nm[k + 1] - lambda_nm[k]);
    return value[k] + f * (value[k + 1] - value[k]);
}

static void divide_into_curves(struct measured *m) {
    qsort(m->point, m->n, sizeof *m->point, by_incidence);
    for (size_t i = 0; i < m->n; i++) {
        struct curve *last = m->n_curves ? &m->curve[m->n_curves - 1] : NULL;
        if (last && m->point[i].theta_i_deg - last->theta_i_deg < SAME_DEG)
            last->n++;
        else
            m->curve[m->n_curves++] = (struct curve){m->point[i].theta_i_deg, i, 1};
    }
    for (size_t c = 0; c < m->n_curves; c++)
        qsort(m->point + m->curve[c].first, m->curve[c].n, sizeof *m->point, by_view);
}

static void take_plane(struct measured *m, const struct brdf *brdf) {
    for (size_t i = 0; i < brdf->n; i++) {
        if (!brdf->geometry[i].in_plane)
            continue;
        struct point *p = &m->point[m->n++];
        p->theta_i_deg = brdf->geometry[i].theta_i_deg;
        p->theta_v_deg = brdf->geometry[i].theta_v_deg;
        for (int k = 0; k < BANDS; k++)
            p->beta[k] =
                at_wavelength(brdf->lambda_nm, brdf->n_lambda, brdf->beta + i * brdf->n_lambda, band_nm(k));
    }
}

int measured_new(struct measured **out, const struct brdf *brdf, struct err *e) {
    struct measured *m = calloc(1, sizeof *m);
    if (m) {
        m->point = calloc(brdf->n + 1, sizeof *m->point);
        m->curve = calloc(brdf->n + 1, sizeof *m->curve);
    }
    if (!m || !m->point || !m->curve) {
        measured_free(m);
        return err_set(e, ERR_NOMEM, "no memory for a measured surface of %zu geometries", brdf->n);
    }
    take_plane(m, brdf);
    if (m->n == 0) {
        measured_free(m);
        return err_set(e, ERR_INPUT, "the measured surface holds no value in the plane of incidence");
    }
    divide_into_curves(m);
    *out = m;
    return 0;
}

void measured_free(struct measured *m) {
    if (!m)
        return;
    free(m->point);
    free(m->curve);
    free(m);
}

static void add_curve(const struct measured *m, const struct curve *c, double theta_v_deg, double weight,
                      double beta[BANDS]) {
    const struct point *p = m->point + c->first, *last = p + c->n - 1;
    while (p < last && p[1].theta_v_deg <= theta_v_deg)
        p++;
    double f = 0;
    if (p < last && theta_v_deg > p->theta_v_deg)
        f = (theta_v_deg - p->theta_v_deg) / (p[1].theta_v_deg - p->theta_v_deg);
    for (int k = 0; k < BANDS; k++)
        beta[k] += weight * (f > 0 ? p->beta[k] + f * (p[1].beta[k] - p->beta[k]) : p->beta[k]);
}

void measured_at(const struct measured *m, double theta_i_deg, double theta_v_deg, double beta[BANDS]) {
    const struct curve *c = m->curve, *last = c + m->n_curves - 1;
    while (c < last && c[1].theta_i_deg <= theta_i_deg)
        c++;
    double f = 0;
    if (c < last && theta_i_deg > c->theta_i_deg)
        f = (theta_i_deg - c->theta_i_deg) / (c[1].theta_i_deg - c->theta_i_deg);
    memset(beta, 0, BANDS * sizeof *beta);
    add_curve(m, c, theta_v_deg + c->theta_i_deg - theta_i_deg, 1 - f, beta);
    if (f > 0)
        add_curve(m, c + 1, theta_v_deg + c[1].theta_i_deg - theta_i_deg, f, beta);
}
