#include "fit/joint_data.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/bandfit.h"
#include "fit/noise_law.h"

static double value_at(const struct problem *p, size_t point, int band) {
    return p->input->band_beta[point * BANDS + (size_t)band];
}

static double u_at(const struct problem *p, size_t point, int band) {
    return p->input->band_u_ind ? p->input->band_u_ind[point * BANDS + (size_t)band] : NAN;
}

static void find_bands(struct joint_data *d) {
    d->known = true;
    for (int band = 0; band < BANDS; band++) {
        size_t count = 0;
        for (size_t i = 0; i < d->n; i++) {
            count += isfinite(value_at(d->p, i, band));
        }
        if (count < BANDFIT_POINTS_MIN) {
            continue;
        }
        for (size_t i = 0; i < d->n; i++) {
            d->known = d->known && (!isfinite(value_at(d->p, i, band)) || isfinite(u_at(d->p, i, band)));
        }
        d->band[d->n_bands++] = band;
        d->n_values += count;
    }
}

/* Where the bands state no u, the mean's, which has its shape; the axes come on top in the weights. */
static double u_of_mean(const struct problem *p, size_t i) {
    return sqrt(fmax(p->u[i] * p->u[i] - p->angle_u2[i], 1e-4 * p->u[i] * p->u[i]));
}

static void copy_values(struct joint_data *d) {
    for (int b = 0; b < d->n_bands; b++) {
        for (size_t i = 0; i < d->n; i++) {
            const size_t at = (size_t)b * d->n + i;
            const double beta = value_at(d->p, i, d->band[b]);
            const bool present = isfinite(beta);
            d->beta[at] = present ? beta : 0;
            d->u[at] = !present   ? 0
                       : d->known ? fmax(u_at(d->p, i, d->band[b]), problem_floor(beta))
                                  : u_of_mean(d->p, i);
            d->bands_of[i] += present;
        }
    }
}

/* Correlation of a value with that of the next band; both must be there and 5 nm apart. */
static void copy_correlation(struct joint_data *d) {
    const double *cov = d->p->input->band_cov_next;
    for (int b = 0; b < d->n_bands; b++) {
        const bool next = cov && b + 1 < d->n_bands && d->band[b + 1] == d->band[b] + 1;
        for (size_t i = 0; i < d->n; i++) {
            const size_t at = (size_t)b * d->n + i;
            const double uu = next ? d->u[at] * d->u[at + d->n] : 0;
            const double c = uu > 0 ? cov[i * BANDS + (size_t)d->band[b]] / uu : NAN;
            d->rho_next[at] =
                isfinite(c) ? fmax(fmin(c, 0.5), -0.5) : NAN; /* tridiagonal: beyond is no covariance */
        }
    }
}

/* The part of u^2 that is common to all bands of point i: what the u of its mean holds beyond its bands and their
 * neighbours. */
static double share_of(const struct joint_data *d, size_t i) {
    const struct estimate_input *in = d->p->input;
    double own = 0, near = 0, sum = 0, beside = 0;
    int count = 0;
    for (int b = 0; b < d->n_bands; b++) {
        const size_t at = (size_t)b * d->n + i;
        if (band_nm(d->band[b]) < in->mean_low_nm || band_nm(d->band[b]) > in->mean_high_nm ||
            d->u[at] == 0) {
            continue;
        }
        const bool last = b + 1 == d->n_bands || band_nm(d->band[b + 1]) > in->mean_high_nm;
        const double uu = last ? 0 : d->u[at] * d->u[at + d->n];
        own += d->u[at] * d->u[at];
        near += isfinite(d->rho_next[at]) ? 2 * d->rho_next[at] * uu : 0;
        beside += isfinite(d->rho_next[at]) ? 2 * uu : 0;
        sum += d->u[at];
        count++;
    }
    const double seen = in->u_ind ? in->u_ind[i] * in->u_ind[i] * count * count - own - near : 0;
    const double room = sum * sum - own - beside;
    return count > 1 && room > 0 ? fmax(0, fmin(1, seen / room)) : 0;
}

static void set_weights(struct joint_data *d) {
    const bool unweighted = d->p->input->unweighted || !d->p->input->u_ind;
    for (int b = 0; b < d->n_bands; b++) {
        for (size_t i = 0; i < d->n; i++) {
            const size_t at = (size_t)b * d->n + i;
            const double u2 = d->u[at] * d->u[at], m = d->bands_of[i];
            const double variance = u2 * (1 - d->share[i] + m * d->share[i]) + m * d->p->angle_u2[i];
            d->weight[at] = u2 == 0 ? 0 : unweighted ? 1 : 1 / variance;
        }
    }
}

static int allocate(struct joint_data *d, struct err *e) {
    const size_t n = (size_t)d->n_bands * d->n + 1;
    d->beta = calloc(n, sizeof(double));
    d->weight = calloc(n, sizeof(double));
    d->u = calloc(n, sizeof(double));
    d->rho_next = calloc(n, sizeof(double));
    d->share = calloc(d->n + 1, sizeof(double));
    d->mean_beta = calloc(d->n + 1, sizeof(double));
    d->bands_of = calloc(d->n + 1, sizeof(int));
    if (d->beta && d->weight && d->u && d->rho_next && d->share && d->mean_beta && d->bands_of) {
        return 0;
    }
    joint_data_free(d);
    return err_set(e, ERR_NOMEM, "no memory for a joint fit of %zu points", d->n);
}

int joint_data_init(struct joint_data *d, struct problem *p, struct err *e) {
    *d = (struct joint_data){.p = p, .n = p->n};
    find_bands(d);
    int status = allocate(d, e);
    if (status) {
        return status;
    }
    copy_values(d);
    copy_correlation(d);
    for (size_t i = 0; i < d->n; i++) {
        d->share[i] = d->known ? share_of(d, i) : 0;
    }
    memcpy(d->mean_beta, p->model_beta, d->n * sizeof(double));
    set_weights(d);
    return 0;
}

void joint_data_free(struct joint_data *d) {
    free(d->beta);
    free(d->weight);
    free(d->u);
    free(d->rho_next);
    free(d->share);
    free(d->mean_beta);
    free(d->bands_of);
    *d = (struct joint_data){0};
}

void joint_data_reweigh(struct joint_data *d, const double *model) {
    for (int b = 0; d->known && b < d->n_bands; b++) {
        struct noise_law law = {0};
        double *u = d->u + (size_t)b * d->n;
        const double *seen = d->beta + (size_t)b * d->n, *fitted = model + (size_t)b * d->n;
        for (size_t i = 0; i < d->n; i++) {
            if (u[i] > 0) {
                noise_law_add(&law, u[i], fitted[i]);
            }
        }
        noise_law_solve(&law);
        for (size_t i = 0; i < d->n; i++) {
            u[i] *= u[i] > 0 ? sqrt(noise_law_carry(&law, u[i], seen[i], fitted[i])) : 0;
        }
    }
    set_weights(d);
}
