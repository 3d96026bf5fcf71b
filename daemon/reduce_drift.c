#include "daemon/reduce_internal.h"

/* Brackets the prior is worth, and how many must have closed before the data are heard. */
#define PRIOR_WEIGHT 2
/* To either side: one bracket gives one degree of freedom a band, the lamp is smooth. */
#define SMOOTH_BANDS 4
#define FLOOR_SHARE 0.01 /* of the prior: a few lucky brackets must not make the lamp perfect */

int mean_first_band(const struct reduce_setup *setup) {
    return (setup->mean_nm[0] - BAND_FIRST_NM + BAND_STEP_NM - 1) / BAND_STEP_NM;
}

int mean_last_band(const struct reduce_setup *setup) {
    return (setup->mean_nm[1] - BAND_FIRST_NM) / BAND_STEP_NM;
}

static double rate_of(const struct reading *x, int band) {
    return x->net[band] / x->exposure_us;
}

/* Relative change from the opening to the closing reading, and its gradients by their counts. */
struct change {
    double d[BANDS], by_open[BANDS], by_close[BANDS];
    bool usable[BANDS];
};

static void find_change(struct change *c, const struct bridge *b) {
    for (int band = 0; band < BANDS; band++) {
        double open = rate_of(b->open, band), close = rate_of(b->close, band), mean = (open + close) / 2;
        c->usable[band] = open > 0 && close > 0;
        c->d[band] = c->usable[band] ? (close - open) / mean : 0;
        c->by_open[band] = c->usable[band] ? -1 / mean / b->open->exposure_us : 0;
        c->by_close[band] = c->usable[band] ? 1 / mean / b->close->exposure_us : 0;
    }
}

static double variance_of(const struct change *c, const struct bridge *b, int first, int last) {
    return noise_of_sum(&b->open->light.noise, c->by_open, first, last) +
           noise_of_sum(&b->close->light.noise, c->by_close, first, last);
}

static void add_mean(struct drift *d, const struct change *c, const struct bridge *b, double seconds,
                     int first, int last) {
    double sum = 0;
    int n = last - first + 1;
    for (int band = first; band <= last; band++) {
        if (!c->usable[band])
            return;
        sum += c->d[band];
    }
    double mean = sum / n, noise = variance_of(c, b, first, last) / ((double)n * n);
    d->sum_mean += (mean * mean - noise) / seconds;
    d->n_mean++;
}

void drift_add(struct drift *d, const struct bridge *b, const struct reduce_setup *setup) {
    double seconds = (b->close->at_us - b->open->at_us) * 1e-6;
    struct change c;
    if (!(seconds > 0))
        return;
    find_change(&c, b);
    for (int band = 0; band < BANDS; band++) {
        if (!c.usable[band])
            continue;
        d->sum[band] += (c.d[band] * c.d[band] - variance_of(&c, b, band, band)) / seconds;
        d->n[band]++;
    }
    add_mean(d, &c, b, seconds, mean_first_band(setup), mean_last_band(setup));
}

/* The prior counts as PRIOR_WEIGHT brackets more. */
static double shrink(double sum, int n, double prior) {
    if (n < PRIOR_WEIGHT)
        return prior;
    double rate = (PRIOR_WEIGHT * prior + sum) / (PRIOR_WEIGHT + n), floor = FLOOR_SHARE * prior;
    return rate > floor ? rate : floor;
}

void drift_rates(const struct drift *d, double prior, double rate[BANDS], double *mean_rate) {
    for (int band = 0; band < BANDS; band++) {
        double sum = 0;
        int bands = 0;
        for (int b = band - SMOOTH_BANDS; b <= band + SMOOTH_BANDS; b++)
            if (b >= 0 && b < BANDS && d->n[b] > 0 && d->n[b] == d->n[band]) {
                sum += d->sum[b];
                bands++;
            }
        rate[band] = shrink(bands ? sum / bands : 0, d->n[band], prior);
    }
    *mean_rate = shrink(d->sum_mean, d->n_mean, prior);
}
