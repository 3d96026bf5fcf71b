#include "fit/bandfit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Each point that has the band also says how well it is known there. */
static bool all_known(const struct problem *p, int band) {
    const double *beta = p->input->band_beta, *u = p->input->band_u_ind;
    for (size_t i = 0; u && i < p->n; i++) {
        size_t at = i * BANDS + (size_t)band;
        if (isfinite(beta[at]) && !isfinite(u[at])) {
            return false;
        }
    }
    return u != NULL;
}

/* Independent variance of a point's value in a band; where u is not known, the mean's, which has its shape. */
static double variance_of(const struct problem *p, size_t point, int band, bool known) {
    if (!known) {
        return p->u[point] * p->u[point];
    }
    size_t at = point * BANDS + (size_t)band;
    double u = fmax(p->input->band_u_ind[at], problem_floor(p->input->band_beta[at]));
    return u * u + p->angle_u2[point]; /* the lobe is achromatic: the mean's angle part serves */
}

size_t bandfit_weights(struct bandfit *f, const struct problem *p, int band) {
    size_t count = 0;
    f->known = all_known(p, band);
    for (size_t i = 0; i < p->n; i++) {
        double beta = p->input->band_beta[i * BANDS + (size_t)band];
        double variance = variance_of(p, i, band, f->known);
        bool present = isfinite(beta) && isfinite(variance);
        f->weight[i] = !present ? 0 : p->input->unweighted ? 1 : 1 / variance;
        count += present;
    }
    return count;
}

/* Gauss-Newton from the linear solution: the quadratic part is a few per cent, four steps reach the last
 * bits. */
static double solve_band(const struct bandfit *f, const struct problem *p, int band, double *variance) {
    double s = 0, spread = 0, scatter = 0;
    int count = 0;
    for (int step = 0; step < 5; step++) {
        double jj = 0, jr = 0;
        spread = scatter = 0;
        count = 0;
        for (size_t i = 0; i < p->n; i++) {
            if (f->weight[i] == 0) {
                continue;
            }
            const struct bandfit_point *x = &f->point[i];
            double slope = x->l1 + 2 * s * x->l2;
            double rest =
                p->input->band_beta[i * BANDS + (size_t)band] - x->specular - s * x->l1 - s * s * x->l2;
            double ws = f->weight[i] * slope, variance_here = variance_of(p, i, band, f->known);
            jj += ws * slope;
            jr += ws * rest;
            spread += ws * ws * variance_here;
            scatter += rest * rest / variance_here;
            count++;
        }
        if (!(jj > 0)) {
            return NAN;
        }
        s += jr / jj;
        *variance = spread / (jj * jj) * (f->known ? 1 : scatter / (count - 1));
    }
    return s;
}

static int prepare_points(struct bandfit *f, const struct problem *p, const double *value, struct err *e) {
    double unit[MATERIAL_PARAMETERS], beta, direct[COORDINATES_MAX] = {0}, whole[COORDINATES_MAX] = {0};
    memcpy(unit, value, sizeof unit);
    unit[MATERIAL_S] = 1;
    const struct reflectance_optics without = {p->optics.kappa, 0, p->optics.polarisation},
                                    with = {p->optics.kappa, 1, p->optics.polarisation};
    bool rough = p->k > 1 && reflectance_parameter(p->model, 1) == MATERIAL_SIGMA;
    for (size_t i = 0; i < p->n; i++) {
        struct reflectance_parts parts;
        const struct aperture *a = &p->aperture;
        int status = aperture_parts(a, i, p->model, unit, &with, &parts, e);
        if (status || (status = aperture_eval(a, i, 1, p->model, unit, &without, &beta, direct, e)) ||
            (status = aperture_eval(a, i, 1, p->model, unit, &with, &beta, whole, e))) {
            return status;
        }
        f->point[i] = (struct bandfit_point){.l1 = parts.diffuse,
                                             .l2 = parts.interreflection,
                                             .specular = parts.specular,
                                             .l1_slope = rough ? direct[1] : 0,
                                             .l2_slope = rough ? whole[1] - direct[1] : 0};
    }
    return 0;
}

int bandfit_run(struct bandfit *f, const struct problem *p, const double *value, struct err *e) {
    f->point = calloc(p->n + 1, sizeof *f->point);
    f->weight = calloc(p->n + 1, sizeof(double));
    if (!f->point || !f->weight) {
        bandfit_free(f);
        return err_set(e, ERR_NOMEM, "no memory for the spectrum of %zu points", p->n);
    }
    int status = prepare_points(f, p, value, e);
    if (status) {
        bandfit_free(f);
        return status;
    }
    for (int band = 0; band < BANDS; band++) {
        f->s[band] = NAN;
        f->variance[band] = 0;
        if (bandfit_weights(f, p, band) >= BANDFIT_POINTS_MIN) {
            f->s[band] = solve_band(f, p, band, &f->variance[band]);
        }
    }
    return 0;
}

void bandfit_free(struct bandfit *f) {
    free(f->point);
    free(f->weight);
    f->point = NULL;
    f->weight = NULL;
}

double bandfit_q(const struct bandfit *f, int low_nm, int high_nm) {
    double sum = 0, square = 0;
    int n = 0;
    for (int band = 0; band < BANDS; band++) {
        if (isfinite(f->s[band]) && band_nm(band) >= low_nm && band_nm(band) <= high_nm) {
            sum += f->s[band];
            square += f->s[band] * f->s[band] - f->variance[band]; /* noise must not pass for colour */
            n++;
        }
    }
    if (n == 0 || sum <= 0) {
        return 1;
    }
    return fmin(fmax(1, square * n / (sum * sum)), n); /* n: all of it in one band */
}
