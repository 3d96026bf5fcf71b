/*
 * detector.h — the spectrometer's optics and CCD: light per pixel in, raw counts out, with all that is wrong.
 *
 * In scaled counts (65535 = saturation): linear signal L = (light + dark current) t with shot noise variance L/g;
 * S' with S' / P(S') = L, so that the EEPROM polynomial P linearises it; read noise RN, an offset that warms up,
 * fixed pattern. Then raw = scaled * saturation / 65535, rounded, clipped to 0..saturation. Pixels 0 and 1 are
 * junk; pixels outside the active range see offset and read noise only.
 *
 * Promises   detector_expose is a pure function of its arguments; 2048 pixels take about 50 us.
 * Source     spectrometer-ocean.md 2.3, 2.4, 5, 7 (RN = 50, g = 0.99 and 1.45 e-/count).
 * Checked    tests/unit/test_sim_light.c, tests/unit/test_sim_noise.c
 */
#ifndef SIM_DETECTOR_H
#define SIM_DETECTOR_H

#include <stdbool.h>
#include <stdint.h>

#define DETECTOR_PIXELS_MAX 3840
#define DETECTOR_CURVE 1024

struct detector_model {
    const char *name;
    uint16_t pid;
    int pixels, active_first, active_last; /* 0-based index in the stream */
    double wavelength[4];
    double nonlinearity[8];
    int saturation; /* raw, slot 17 */
    double electrons_per_count, read_noise_counts, offset_counts;
    uint32_t min_us, max_us;
    int readout_us;
};

struct detector {
    const struct detector_model *model;
    bool quiet;
    double lambda_nm[DETECTOR_PIXELS_MAX];
    double response[DETECTOR_PIXELS_MAX];  /* with the pixel's own gain; 0 outside the active range */
    double pattern[DETECTOR_PIXELS_MAX];   /* counts */
    double dark_rate[DETECTOR_PIXELS_MAX]; /* counts per us */
    double curve[DETECTOR_CURVE + 1];      /* S' over L */
};

const struct detector_model *detector_model(const char *name); /* NULL if unknown */
void detector_init(struct detector *d, const struct detector_model *model, uint64_t key, bool quiet);
/* The counts read (1 + rel L / 65535) too much, and the polynomial of the EEPROM does not know. */
void detector_bend(struct detector *d, double rel);
/* rate: light in counts per us, [pixels]. at_us: age of the instrument, for the offset. */
void detector_expose(const struct detector *d, const double *rate, uint32_t exposure_us, int64_t at_us,
                     uint64_t key, uint16_t *counts);

#endif
