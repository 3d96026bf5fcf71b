/*
 * lamp.h — the lamp: its colour, how it warms up and drifts, and when the lamp line let its light through.
 *
 * level(t) = (1 - 0.03 exp(-(t - t_first) / tau)) * exp(sqrt(rate) W(t)), tau = warm-up time / 6, t_first = the
 * first time the line was raised: the lamp then burns on and the line only works its shutter, so that a dark
 * does not cool it. W is Brownian motion by (seed, time) (draw.h), the same for every wavelength.
 *
 * Spectrum   Planck at 3000 K in photons, 1 at 620 nm.
 * Times      microseconds of the clock.
 * Source     measurement.md 3.
 * Checked    tests/unit/test_sim_light.c
 */
#ifndef SIM_LAMP_H
#define SIM_LAMP_H

#include <stdbool.h>
#include <stdint.h>

#define LAMP_SWITCHES 32

struct lamp {
    uint64_t key;
    double rate; /* relative variance per second */
    double tau_us;
    int64_t first_us; /* INT64_MAX before */
    struct {
        int64_t at_us;
        bool on;
    } change[LAMP_SWITCHES];
    int n; /* changes ever; the newest is change[(n - 1) % LAMP_SWITCHES] */
};

void lamp_init(struct lamp *l, uint64_t key, double rate, double warm_up_min);
void lamp_switch(struct lamp *l, int64_t now_us, bool on);
bool lamp_is_on(const struct lamp *l, int64_t at_us);
bool lamp_steady(const struct lamp *l, int64_t from_us, int64_t to_us); /* not switched in between */
double lamp_level(const struct lamp *l, int64_t at_us);
double lamp_spectrum(double lambda_nm);

#endif
