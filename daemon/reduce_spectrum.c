#include "daemon/reduce_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FULL_SCALE 65535.0 /* scaled counts at saturation: spectrometer-ocean.md 2.3 */

static double lambda_step(const struct calibration *c, int pixel) {
    return calibration_lambda_nm(c, pixel + 1) - calibration_lambda_nm(c, pixel);
}

static int check_wavelengths(const struct calibration *c, struct err *e) {
    bool ranges = c->pixels > 0 && c->dark_first >= 0 && c->dark_first <= c->dark_last &&
                  c->active_first >= 0 && c->active_first < c->active_last && c->active_last < c->pixels &&
                  c->dark_last < c->pixels;
    if (!ranges || c->saturation < 1)
        return err_set(e, ERR_INPUT,
                       "the calibration of %s %s has no usable pixel ranges or saturation level", c->model,
                       c->serial);
    for (int p = c->active_first; p < c->active_last; p++)
        if (!(lambda_step(c, p) > 0))
            return err_set(
                e, ERR_INPUT,
                "the wavelengths of %s %s do not rise from pixel %d to %d; its wavelength coefficients "
                "need a new calibration",
                c->model, c->serial, p, p + 1);
    return 0;
}

static double triangle(double lambda_nm, int band) {
    double away = fabs(lambda_nm - band_nm(band));
    return away < BAND_STEP_NM ? 1 - away / BAND_STEP_NM : 0;
}

/* Fills first, last and weight of one band from the memory at `at`; returns how much it took. */
static int weigh_band(struct resampler *s, const struct calibration *c, int band, double *at) {
    int first = c->active_first, last = c->active_last;
    s->covered[band] = calibration_lambda_nm(c, first) <= band_nm(band) - BAND_STEP_NM &&
                       calibration_lambda_nm(c, last) >= band_nm(band) + BAND_STEP_NM;
    if (!s->covered[band])
        return 0;
    while (triangle(calibration_lambda_nm(c, first), band) <= 0 && first < last)
        first++;
    while (triangle(calibration_lambda_nm(c, last), band) <= 0 && last > first)
        last--;
    double sum = 0;
    for (int p = first; p <= last; p++)
        sum += at[p - first] = triangle(calibration_lambda_nm(c, p), band);
    s->covered[band] = sum > 0;
    for (int p = first; sum > 0 && p <= last; p++)
        at[p - first] /= sum;
    s->first[band] = first;
    s->last[band] = last;
    s->weight[band] = at;
    return last - first + 1;
}

int resampler_init(struct resampler *s, const struct calibration *c, struct err *e) {
    memset(s, 0, sizeof *s);
    int rc = check_wavelengths(c, e);
    if (rc < 0)
        return rc;
    /* A pixel lies in two bands at most; a band coarser than the pixels still takes two. */
    s->memory = calloc(2 * (size_t)c->pixels + 2 * BANDS, sizeof *s->memory);
    if (!s->memory)
        return err_set(e, ERR_NOMEM, "out of memory for the reduction");
    int used = 0;
    for (int band = 0; band < BANDS; band++)
        used += weigh_band(s, c, band, s->memory + used);
    return 0;
}

void resampler_free(struct resampler *s) {
    free(s->memory);
    s->memory = NULL;
}

struct pixel_stats { /* of one pixel over the scans */
    double sum;      /* linear counts */
    double raw;      /* sum of raw counts above the electric dark */
    double slope;    /* sum of d linear / d scaled */
};

/* P and dP/dS of the non-linearity polynomial; outside the range in which it was judged, P at the nearer end. */
static double linearity(const struct calibration *c, double s, double *derivative) {
    double p = 0, d = 0, inside = s < 0 ? 0 : s > FULL_SCALE ? FULL_SCALE : s;
    for (int k = c->nonlinearity_order; k >= 0; k--) {
        d = d * inside + p;
        p = p * inside + c->nonlinearity[k];
    }
    *derivative = inside == s ? d : 0;
    return p;
}

static double electric_dark(const struct calibration *c, const uint16_t *counts) {
    double sum = 0;
    for (int p = c->dark_first; p <= c->dark_last; p++)
        sum += counts[p];
    return sum / (c->dark_last - c->dark_first + 1);
}

/* Returns the mean linear count of the scan, for the test of the scatter. */
static double take_scan(struct pixel_stats *stats, const struct calibration *c, const uint16_t *counts,
                        double *linear) {
    double dark = electric_dark(c, counts), scale = FULL_SCALE / c->saturation, total = 0;
    int n = c->active_last - c->active_first + 1;
    for (int i = 0; i < n; i++) {
        double s = (counts[c->active_first + i] - dark) * scale, p = 1, d = 0;
        if (c->nonlinearity_used)
            p = linearity(c, s, &d);
        linear[i] = s / p;
        stats[i].sum += linear[i];
        stats[i].slope += (p - s * d) / (p * p);
        total += linear[i];
    }
    return total / n;
}

/* Variance of one pixel in one scan by the count-noise model, linear counts (spectrometer-ocean.md 7, whose figures
 * are of counts on the scale of 65535): reading noise arises before linearisation, shot noise in the light itself. */
static double model_variance(const struct calibration *c, const struct pixel_stats *s, int n_scans) {
    double read = s->slope / n_scans * c->read_noise_counts, linear = s->sum / n_scans;
    return read * read + (linear > 0 ? linear / c->electrons_per_count : 0);
}

/* 99.9 % point of chi2 / degrees of freedom, Wilson and Hilferty 1931; 3.0902 is the normal quantile. */
static double f_limit(double freedom) {
    double v = 2 / (9 * freedom), root = 1 - v + 3.0902 * sqrt(v);
    return root * root * root;
}

/* Scatter between scans over the model. What all pixels of a scan share (its electric dark) is taken out. */
static void test_scatter(struct spectrum *out, const struct calibration *c, const struct pixel_stats *stats,
                         const double *linear, const double *scan_mean, int n_scans) {
    int n = c->active_last - c->active_first + 1;
    double sum = 0, all = 0;
    out->scan_f = NAN;
    out->noisy = false;
    for (int k = 0; k < n_scans; k++)
        all += scan_mean[k] / n_scans;
    for (int i = 0; i < n; i++) {
        double expected = model_variance(c, &stats[i], n_scans), mean = stats[i].sum / n_scans;
        for (int k = 0; k < n_scans && expected > 0; k++) {
            double away = linear[(size_t)k * (size_t)n + (size_t)i] - mean - (scan_mean[k] - all);
            sum += away * away / expected;
        }
    }
    if (n_scans < 2 || n < 2)
        return;
    double freedom = (double)(n_scans - 1) * (n - 1);
    out->scan_f = sum / freedom;
    out->noisy = out->scan_f > f_limit(freedom);
}

static void fill_band(struct spectrum *out, const struct calibration *c, const struct resampler *bands,
                      int band, const struct pixel_stats *stats, const double *variance, int n_scans) {
    double electric = c->read_noise_counts / sqrt((double)(c->dark_last - c->dark_first + 1) * n_scans);
    const double *w = bands->weight[band];
    double value = 0, moment = 0, var = 0, slope = 0, cov = 0;
    for (int p = bands->first[band]; p <= bands->last[band]; p++) {
        int i = p - c->active_first;
        double weight = w[p - bands->first[band]];
        value += weight * (stats[i].sum / n_scans);
        moment += weight * (stats[i].sum / n_scans) * (calibration_lambda_nm(c, p) - band_nm(band));
        slope += weight * (stats[i].slope / n_scans);
        var += weight * weight * variance[i];
        if (band + 1 < BANDS && bands->covered[band + 1] && p >= bands->first[band + 1] &&
            p <= bands->last[band + 1])
            cov += weight * bands->weight[band + 1][p - bands->first[band + 1]] * variance[i];
    }
    out->value[band] = value;
    out->moment[band] = moment;
    out->noise.var[band] = var;
    out->noise.cov_next[band] = cov;
    out->noise.electric[band] = electric * slope;
}

static void fill_spectrum(struct spectrum *out, const struct calibration *c, const struct resampler *bands,
                          const struct pixel_stats *stats, double *variance, int n_scans) {
    int n = c->active_last - c->active_first + 1;
    double inflate = out->noisy ? out->scan_f : 1;
    out->mean = 0;
    for (int i = 0; i < n; i++) {
        variance[i] = inflate * model_variance(c, &stats[i], n_scans) / n_scans;
        out->mean += stats[i].sum / n_scans / n;
    }
    for (int band = 0; band < BANDS; band++)
        if (bands->covered[band])
            fill_band(out, c, bands, band, stats, variance, n_scans);
}

static int check_set(const struct calibration *c, const struct exposure *x, struct err *e) {
    if (x->pixels != c->pixels)
        return err_set(e, ERR_INPUT, "exposure %lld has %d pixels, the calibration of %s has %d",
                       (long long)x->id, x->pixels, c->model, c->pixels);
    if (x->n_scans < 1 || x->exposure_us < 1)
        return err_set(e, ERR_INPUT, "exposure %lld has %d scans of %d us; at least one of 1 us was expected",
                       (long long)x->id, x->n_scans, x->exposure_us);
    return 0;
}

int spectrum_make(struct spectrum *s, const struct calibration *c, const struct resampler *bands,
                  const struct exposure *x, struct err *e) {
    memset(s, 0, sizeof *s);
    int rc = check_set(c, x, e);
    if (rc < 0)
        return rc;
    size_t n = (size_t)(c->active_last - c->active_first + 1), scans = (size_t)x->n_scans;
    struct pixel_stats *stats = calloc(n, sizeof *stats);
    double *memory = calloc(n * scans + scans + n, sizeof *memory);
    if (stats && memory) {
        double *linear = memory, *scan_mean = memory + n * scans, *variance = scan_mean + scans;
        for (size_t k = 0; k < scans; k++)
            scan_mean[k] = take_scan(stats, c, x->counts + k * (size_t)c->pixels, linear + k * n);
        test_scatter(s, c, stats, linear, scan_mean, x->n_scans);
        fill_spectrum(s, c, bands, stats, variance, x->n_scans);
    } else {
        rc = err_set(e, ERR_NOMEM, "out of memory for the reduction");
    }
    free(stats);
    free(memory);
    return rc;
}

double noise_of_sum(const struct band_noise *noise, const double *gradient, int first, int last) {
    double sum = 0, electric = 0;
    for (int b = first; b <= last; b++) {
        sum += gradient[b] * gradient[b] * noise->var[b];
        if (b < last)
            sum += 2 * gradient[b] * gradient[b + 1] * noise->cov_next[b];
        electric += gradient[b] * noise->electric[b];
    }
    return sum + electric * electric;
}

double noise_of_band(const struct band_noise *noise, int band) {
    return sqrt(noise->var[band] + noise->electric[band] * noise->electric[band]);
}

double reduce_peak(const struct calibration *c, const uint16_t *counts) {
    double dark = electric_dark(c, counts), peak = 0;
    for (int p = c->active_first; p <= c->active_last; p++)
        if (counts[p] > peak)
            peak = counts[p];
    return c->saturation > dark ? (peak - dark) / (c->saturation - dark) : 1;
}
