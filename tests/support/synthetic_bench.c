#include "tests/support/synthetic_bench.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PIXELS 2048
#define PI 3.14159265358979323846

static uint64_t next_random(struct synthetic *s) {
    uint64_t z = (s->seed += 0x9E3779B97F4A7C15u); /* splitmix64 */
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
}

static double uniform(struct synthetic *s) {
    return ((double)(next_random(s) >> 11) + 0.5) / 9007199254740992.0;
}

static double gauss(struct synthetic *s) {
    if (s->has_gauss) {
        s->has_gauss = false;
        return s->gauss_left;
    }
    double r = sqrt(-2 * log(uniform(s))), phi = 2 * PI * uniform(s);
    s->gauss_left = r * sin(phi);
    s->has_gauss = true;
    return r * cos(phi);
}

void synthetic_init(struct synthetic *s, uint64_t seed) {
    memset(s, 0, sizeof *s);
    s->seed = seed;
    s->noise = true;
    s->extra_noise = 1;
    s->lamp = 1;
    s->full = 450;
    s->sample_level = 0.3;
    s->reference_tilt = 0.1;
    s->n_scans = 4;
    s->now_us = 1000000;
    s->next_id = 1;
    s->calibration = (struct calibration){.model = "usb2000plus",
                                          .serial = "TEST",
                                          .pixels = PIXELS,
                                          .dark_first = 6,
                                          .dark_last = 17,
                                          .active_first = 20,
                                          .active_last = PIXELS - 1,
                                          .wavelength = {340.3, 0.377, -1.2e-5, -4e-10},
                                          .nonlinearity = {0.93, 2e-6, -1.5e-11},
                                          .nonlinearity_order = 2,
                                          .nonlinearity_used = true,
                                          .saturation = 61000,
                                          .read_noise_counts = 50,
                                          .electrons_per_count = 0.99};
    s->counts = calloc((size_t)PIXELS * 64, sizeof *s->counts);
}

void synthetic_free(struct synthetic *s) {
    free(s->counts);
}

double synthetic_sample_beta(const struct synthetic *s, double theta_i_deg, double theta_v_deg,
                             double lambda_nm) {
    double share = (lambda_nm - 380) / 400;
    return s->sample_level * (0.5 + 0.5 * share) * (1 + 0.3 * sin(theta_v_deg * PI / 180)) *
           (1 - 0.1 * sin(theta_i_deg * PI / 180));
}

static double reference_beta(const struct synthetic *s, double theta_i_deg, double theta_v_deg,
                             double lambda_nm) {
    double i = theta_i_deg / 60, v = theta_v_deg / 60;
    return 0.98 + 0.02 * (lambda_nm - 580) / 200 + s->reference_tilt * i * v;
}

char *synthetic_certificate(const struct synthetic *s, double u_rel) {
    char *text;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    fprintf(
        out,
        "# geometry: in-plane table\n# k: 1\n# serial: SYN-1\nlambda_nm,beta,u,theta_i_deg,theta_v_deg\n");
    for (int i = 0; i <= 60; i += 15)
        for (int v = -75; v <= 75; v += 15)
            for (int l = 360; l <= 800; l += 440) {
                double beta = reference_beta(s, i, v, l);
                fprintf(out, "%d,%.12f,%.12f,%d,%d\n", l, beta, u_rel * beta, i, v);
            }
    fclose(out);
    return text;
}

/* Flux that the sensor collects, relative to a perfect diffuser at 45:0 with the view inside the beam. */
static double flux(const struct synthetic *s, double beta, double theta_i_deg, double theta_v_deg) {
    double ci = cos(theta_i_deg * PI / 180), cv = cos(theta_v_deg * PI / 180);
    double power = s->lamp, beam_mm2 = 300, view_mm2 = 7; /* cross sections of the two cones */
    if (s->beam_in_view) {
        view_mm2 = 300;
        beam_mm2 = 7;
    }
    double lit_mm2 = beam_mm2 / ci, seen_mm2 = view_mm2 / cv; /* on the surface */
    double irradiance = power / lit_mm2, radiance = beta * irradiance / PI;
    double inner_mm2 = s->beam_in_view ? lit_mm2 : seen_mm2;
    double collected = radiance * inner_mm2 * cv;
    double norm = cos(PI / 4) * 7 / (300 * PI); /* the same for both cases: the inner spot has 7 mm2 */
    return collected / (s->beam_in_view ? 7 / (7 * PI) : norm);
}

/* Counts on the scale of 65535 that the linear counts show as: solves linear = s / P(s) for s. */
static double bend(const struct calibration *c, double linear) {
    double s = linear;
    for (int k = 0; k < 40; k++)
        s = linear * (c->nonlinearity[0] + s * (c->nonlinearity[1] + s * c->nonlinearity[2]));
    return s;
}

static uint16_t digitise(const struct synthetic *s, double scaled) {
    double x = floor(scaled * s->calibration.saturation / 65535 + 0.5);
    return (uint16_t)(x < 0 ? 0 : x > s->calibration.saturation ? s->calibration.saturation : x);
}

struct level { /* of one pixel: counts above the offset and their standard deviation in one scan */
    double scaled, u;
};

static void take_scan(struct synthetic *s, const struct level *level, uint16_t *counts) {
    for (int p = 0; p < PIXELS; p++) {
        double noise = s->noise ? level[p].u * s->extra_noise * gauss(s) : 0;
        counts[p] = digitise(s, 1200 + level[p].scaled + noise);
    }
}

static double beta_in_beam(const struct synthetic *s, enum exposure_kind kind, double i_deg, double v_deg,
                           double lambda_nm) {
    if (kind == EXPOSURE_SAMPLE)
        return synthetic_sample_beta(s, i_deg, v_deg, lambda_nm);
    bool diffuser = kind == EXPOSURE_REFERENCE || kind == EXPOSURE_OVERLAP;
    return diffuser ? reference_beta(s, i_deg, v_deg, lambda_nm) : 0;
}

/* Light and thermal dark with its pattern, bent together; shot noise is the light's, reading noise comes after. */
static void find_levels(const struct synthetic *s, enum exposure_kind kind, double i_deg, double v_deg,
                        int exposure_us, struct level *level) {
    const struct calibration *c = &s->calibration;
    for (int p = 0; p < PIXELS; p++) {
        double l = calibration_lambda_nm(c, p), away = (l - 600) / 220, ms = exposure_us * 1e-3;
        double light =
            flux(s, beta_in_beam(s, kind, i_deg, v_deg, l), i_deg, v_deg) * s->full * exp(-away * away);
        double linear = p < c->active_first ? 0 : (light + 0.3 + 0.1 * (p % 7)) * ms;
        double shot = sqrt(linear / c->electrons_per_count);
        level[p].scaled = bend(c, linear);
        double bent = bend(c, linear + shot) - level[p].scaled;
        level[p].u = sqrt(c->read_noise_counts * c->read_noise_counts + bent * bent);
    }
}

void synthetic_wait(struct synthetic *s, double seconds) {
    s->now_us += (int64_t)(seconds * 1e6);
    s->lamp += s->slope_per_s * seconds + sqrt(s->lamp_rate * seconds) * gauss(s);
}

void synthetic_expose(struct synthetic *s, enum exposure_kind kind, double theta_i_deg, double theta_v_deg,
                      int exposure_us, struct exposure *x) {
    struct level level[PIXELS];
    int32_t i_udeg = (int32_t)lround(theta_i_deg * 1e6), v_udeg = (int32_t)lround(theta_v_deg * 1e6);
    find_levels(s, kind, theta_i_deg, theta_v_deg, exposure_us, level);
    *x = (struct exposure){.id = s->next_id++,
                           .kind = kind,
                           .theta_i_udeg = i_udeg,
                           .theta_v_udeg = v_udeg,
                           .source_udeg = i_udeg + v_udeg,
                           .sample_udeg = v_udeg,
                           .settled_us = s->now_us,
                           .start_us = s->now_us + 10,
                           .end_us = s->now_us + 10 + (int64_t)exposure_us * s->n_scans,
                           .utc_us = 1767225600000000LL + s->now_us,
                           .exposure_us = exposure_us,
                           .n_scans = s->n_scans,
                           .pixels = PIXELS,
                           .lamp = kind != EXPOSURE_DARK,
                           .temperature_c = NAN,
                           .counts = s->counts};
    x->step = (int)x->id;
    s->now_us = x->end_us;
    for (int k = 0; k < s->n_scans; k++) {
        take_scan(s, level, s->counts + k * PIXELS);
        int saturated = 0;
        for (int p = s->calibration.active_first; p < PIXELS; p++)
            saturated += s->counts[k * PIXELS + p] >= s->calibration.saturation;
        if (saturated > x->saturated_pixels)
            x->saturated_pixels = saturated;
    }
}
