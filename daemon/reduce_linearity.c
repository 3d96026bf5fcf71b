/* Two readings of the diffuser, one long and one short, and nothing else changed: their rates must agree in every band.
 * The noise of the electric dark moves all bands alike and is the largest; what bends grows with the level. So the
 * error is fitted by generalised least squares, y_b = error g_b with the covariance diag(v) + e e^T of the bands. */
#include <math.h>
#include <string.h>

#include "daemon/reduce_internal.h"

#define FULL_SCALE 65535.0
#define BEYOND 3.0 /* standard uncertainties: chance alone says so once in 370 campaigns */

struct overlap {
    const struct reading *slow, *fast;
    const bool *covered;
    double y[BANDS], g[BANDS]; /* difference of the rates, and what it is for an error of 1 at full scale */
    double v[BANDS], e[BANDS]; /* variance of y, apart from what its bands share; what they share */
    double weight[BANDS];      /* error = sum of weight y */
};

static void add_noise(struct overlap *o, const struct reading *x) {
    double t2 = (double)x->exposure_us * x->exposure_us;
    const struct band_noise *noise[] = {&x->light.noise, x->dark ? &x->dark->spectrum.noise : NULL};
    for (int k = 0; k < 2 && noise[k]; k++)
        for (int band = 0; band < BANDS; band++) {
            o->v[band] += noise[k]->var[band] / t2;
            o->e[band] =
                sqrt(o->e[band] * o->e[band] + noise[k]->electric[band] * noise[k]->electric[band] / t2);
        }
}

static void fill(struct overlap *o) {
    for (int band = 0; band < BANDS; band++) {
        if (!o->covered[band])
            continue;
        double slow = o->slow->net[band] / o->slow->exposure_us,
               fast = o->fast->net[band] / o->fast->exposure_us;
        o->y[band] = slow - fast;
        o->g[band] = fast * (o->slow->light.value[band] - o->fast->light.value[band]) / FULL_SCALE;
    }
    add_noise(o, o->slow);
    add_noise(o, o->fast);
}

/* By Sherman and Morrison: V^-1 g = g/v - e/v (e.g/v) / (1 + e.e/v). False: no band says anything. */
static bool weigh(struct overlap *o) {
    double eg = 0, ee = 0, norm = 0;
    for (int band = 0; band < BANDS; band++)
        if (o->covered[band] && o->v[band] > 0) {
            eg += o->e[band] * o->g[band] / o->v[band];
            ee += o->e[band] * o->e[band] / o->v[band];
        }
    for (int band = 0; band < BANDS; band++)
        if (o->covered[band] && o->v[band] > 0) {
            o->weight[band] = (o->g[band] - o->e[band] * eg / (1 + ee)) / o->v[band];
            norm += o->weight[band] * o->g[band];
        }
    for (int band = 0; band < BANDS; band++)
        o->weight[band] /= norm;
    return norm > 0 && isfinite(norm);
}

static double noise_of(const struct overlap *o, const struct reading *x) {
    double gradient[BANDS];
    for (int band = 0; band < BANDS; band++)
        gradient[band] = o->weight[band] / x->exposure_us;
    double variance = noise_of_sum(&x->light.noise, gradient, 0, BANDS - 1);
    return x->dark ? variance + noise_of_sum(&x->dark->spectrum.noise, gradient, 0, BANDS - 1) : variance;
}

/* Share of full scale, averaged over the light. */
static double level(const struct overlap *o, const struct reading *x) {
    double sum = 0, weighted = 0;
    for (int band = 0; band < BANDS; band++)
        if (o->covered[band]) {
            sum += x->net[band];
            weighted += x->net[band] * x->light.value[band] / FULL_SCALE;
        }
    return weighted / sum;
}

static double larger(double a, double b) {
    return a > b ? a : b;
}

static void judge(struct linearity *l, double prior_rel) {
    double u2 = l->u_error_rel * l->u_error_rel, seen = l->error_rel * l->error_rel - u2;
    l->prior_rel = prior_rel;
    l->pull = l->error_rel / sqrt(u2 + prior_rel * prior_rel);
    l->beyond = fabs(l->pull) > BEYOND;
    l->used_rel = larger(prior_rel, sqrt(larger(seen, 0)));
    double apart = l->level_long - l->level_short;
    l->ratio = 1 + l->error_rel * apart;
    l->u_ratio = l->u_error_rel * apart;
}

bool linearity_make(struct linearity *l, const struct reading *slow, const struct reading *fast,
                    const bool *covered, double prior_rel, double drift_rate) {
    struct overlap o = {.slow = slow, .fast = fast, .covered = covered};
    fill(&o);
    if (!weigh(&o))
        return false;
    *l = (struct linearity){.step = slow->step,
                            .long_id = slow->exposure_id,
                            .short_id = fast->exposure_id,
                            .long_us = slow->exposure_us,
                            .short_us = fast->exposure_us,
                            .level_long = level(&o, slow),
                            .level_short = level(&o, fast)};
    double lamp = 0;
    for (int band = 0; band < BANDS; band++) {
        l->error_rel += o.weight[band] * o.y[band];
        lamp += o.weight[band] * fast->net[band] /
                fast->exposure_us; /* error seen for a lamp that changed by 1 */
    }
    double drift = drift_rate * fabs(fast->at_us - slow->at_us) / 1e6;
    l->u_error_rel = sqrt(noise_of(&o, slow) + noise_of(&o, fast) + lamp * lamp * drift);
    judge(l, prior_rel);
    return true;
}
