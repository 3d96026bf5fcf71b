#include "sim/detector.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "sim/draw.h"

#define FULL_SCALE 65535.0
#define CURVE_SPAN 90000.0 /* above full scale every pixel is clipped */
#define OFFSET_DRIFT 8.0   /* counts lost while warming up, spectrometer-ocean.md 7: "a few" */
#define OFFSET_TAU_US 1200e6
#define GAIN_SPREAD 0.01 /* of one pixel against its neighbours */
#define PATTERN_COUNTS 6.0
#define DARK_COUNTS_PER_S 4.0
#define JUNK_0 17 /* pixels 0 and 1 of published readings, spectrometer-ocean.md 2.4 */
#define JUNK_1 28000
#define PEAK_NM 500.0 /* grating and CCD together */
#define WIDTH_NM 200.0

static const struct detector_model MODELS[] = {
    {.name = "usb2000plus",
     .pid = 0x101E,
     .pixels = 2048,
     .active_first = 20,
     .active_last = 2047,
     .wavelength = {340.3217, 0.3801456, -1.240312e-05, -2.401155e-09},
     .nonlinearity = {0.9412, 2.2e-06, -2.1e-11, 6e-17, -2e-23, 1e-28, 1e-34, 1e-40},
     .saturation = 59957,
     .electrons_per_count = 0.99,
     .read_noise_counts = 50,
     .offset_counts = 1420,
     .min_us = 1000,
     .max_us = 65535000,
     .readout_us = 870},
    {.name = "usb4000",
     .pid = 0x1022,
     .pixels = 3840,
     .active_first = 21,
     .active_last = 3668,
     .wavelength = {345.2104, 0.2141877, -5.610243e-06, -4.106552e-10},
     .nonlinearity = {0.9537, 1.7e-06, -1.5e-11, 4e-17, -1e-23, 1e-28, 1e-34, 1e-40},
     .saturation = 62200,
     .electrons_per_count = 1.45,
     .read_noise_counts = 50,
     .offset_counts = 1080,
     .min_us = 10,
     .max_us = 65535000,
     .readout_us = 3800},
};

const struct detector_model *detector_model(const char *name) {
    for (size_t i = 0; i < sizeof MODELS / sizeof *MODELS; i++)
        if (strcmp(MODELS[i].name, name) == 0)
            return &MODELS[i];
    return NULL;
}

static double polynomial(const double *c, int n, double x) {
    double y = 0;
    while (n-- > 0)
        y = y * x + c[n];
    return y;
}

void detector_bend(struct detector *d, double rel) {
    for (int i = 0; i <= DETECTOR_CURVE; i++) {
        double linear = CURVE_SPAN * i / DETECTOR_CURVE, s = linear;
        linear *= 1 + rel * linear / FULL_SCALE;
        for (int pass = 0; pass < 200; pass++) /* a contraction: its slope is L P'(S) < 0.3 */
            s = linear * polynomial(d->model->nonlinearity, 8, fmin(s, FULL_SCALE));
        d->curve[i] = s;
    }
}

void detector_init(struct detector *d, const struct detector_model *model, uint64_t key, bool quiet) {
    memset(d, 0, sizeof *d);
    d->model = model;
    d->quiet = quiet;
    double gain[DETECTOR_PIXELS_MAX], pattern[DETECTOR_PIXELS_MAX], dark[DETECTOR_PIXELS_MAX];
    draw_normals(draw_fold(key, draw_word("gain")), gain, model->pixels);
    draw_normals(draw_fold(key, draw_word("pattern")), pattern, model->pixels);
    draw_normals(draw_fold(key, draw_word("dark")), dark, model->pixels);
    double spread = quiet ? 0 : 1;
    for (int p = 0; p < model->pixels; p++) {
        double x = (d->lambda_nm[p] = polynomial(model->wavelength, 4, p)) - PEAK_NM;
        if (p < model->active_first || p > model->active_last)
            continue;
        d->response[p] = exp(-x * x / (WIDTH_NM * WIDTH_NM)) * (1 + spread * GAIN_SPREAD * gain[p]);
        d->pattern[p] = spread * PATTERN_COUNTS * pattern[p];
        d->dark_rate[p] = DARK_COUNTS_PER_S * 1e-6 * (1 + 0.2 * spread * fmax(-4, dark[p]));
    }
    detector_bend(d, 0);
}

/* S' and its slope at a linear signal. */
static double bend(const struct detector *d, double linear, double *slope) {
    double x = linear * (DETECTOR_CURVE / CURVE_SPAN);
    int i = x < DETECTOR_CURVE - 1 ? (int)x : DETECTOR_CURVE - 1;
    double step = d->curve[i + 1] - d->curve[i];
    *slope = step * (DETECTOR_CURVE / CURVE_SPAN);
    return d->curve[i] + step * (x - i);
}

static uint16_t digitise(double scaled, int saturation, double threshold) {
    double raw = scaled * saturation / FULL_SCALE;
    return raw >= saturation ? (uint16_t)saturation : raw <= 0 ? 0 : (uint16_t)(raw + threshold);
}

/* Read noise of 50 counts lets rounding average out. A quiet bench has none: there the place of rounding goes
 * evenly over the pixels, by the golden ratio, or a dark of 1299.14 counts would be 1299 on every pixel. */
static double threshold(const struct detector *d, int pixel) {
    double x = pixel * 0.61803398874989485;
    return d->quiet ? x - floor(x) : 0.5;
}

void detector_expose(const struct detector *d, const double *rate, uint32_t exposure_us, int64_t at_us,
                     uint64_t key, uint16_t *counts) {
    const struct detector_model *m = d->model;
    double z[DETECTOR_PIXELS_MAX] = {0};
    double offset = m->offset_counts + (d->quiet ? 0 : OFFSET_DRIFT * exp(-(double)at_us / OFFSET_TAU_US));
    double read = m->read_noise_counts * m->read_noise_counts, per_electron = 1 / m->electrons_per_count;
    if (!d->quiet)
        draw_normals(key, z, m->pixels);
    for (int p = 0; p < m->pixels; p++) {
        double slope, linear = (rate[p] + d->dark_rate[p]) * exposure_us;
        double signal = bend(d, linear, &slope);
        double noise = sqrt(read + slope * slope * linear * per_electron) * z[p];
        counts[p] = digitise(offset + d->pattern[p] + signal + noise, m->saturation, threshold(d, p));
    }
    counts[0] = JUNK_0;
    counts[1] = (uint16_t)(JUNK_1 + (int)(300 * z[1]));
}
