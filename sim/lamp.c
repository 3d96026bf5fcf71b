#include "sim/lamp.h"

#include <math.h>

#include "sim/draw.h"

#define COLD_DEFICIT 0.03     /* a tungsten lamp starts a few per cent under its final level */
#define TAUS_TO_WARM 6        /* exp(-6): 7e-5 of it is left when the stated warm-up is over */
#define C2_NM_K 1.438776877e7 /* second radiation constant */
#define COLOUR_TEMPERATURE_K 3000
#define UNITY_NM 620

void lamp_init(struct lamp *l, uint64_t key, double rate, double warm_up_min) {
    *l = (struct lamp){
        .key = key, .rate = rate, .tau_us = warm_up_min * 60e6 / TAUS_TO_WARM, .first_us = INT64_MAX};
}

void lamp_switch(struct lamp *l, int64_t now_us, bool on) {
    if (lamp_is_on(l, now_us) == on)
        return;
    if (on && l->first_us == INT64_MAX)
        l->first_us = now_us;
    l->change[l->n % LAMP_SWITCHES].at_us = now_us;
    l->change[l->n++ % LAMP_SWITCHES].on = on;
}

bool lamp_is_on(const struct lamp *l, int64_t at_us) {
    int oldest = l->n > LAMP_SWITCHES ? l->n - LAMP_SWITCHES : 0;
    for (int i = l->n - 1; i >= oldest; i--)
        if (l->change[i % LAMP_SWITCHES].at_us <= at_us)
            return l->change[i % LAMP_SWITCHES].on;
    return false;
}

bool lamp_steady(const struct lamp *l, int64_t from_us, int64_t to_us) {
    int oldest = l->n > LAMP_SWITCHES ? l->n - LAMP_SWITCHES : 0;
    for (int i = l->n - 1; i >= oldest && l->change[i % LAMP_SWITCHES].at_us > from_us; i--)
        if (l->change[i % LAMP_SWITCHES].at_us < to_us)
            return false;
    return true;
}

double lamp_level(const struct lamp *l, int64_t at_us) {
    double level = 1;
    if (l->tau_us > 0 && at_us >= l->first_us)
        level -= COLD_DEFICIT * exp(-(double)(at_us - l->first_us) / l->tau_us);
    if (l->rate > 0)
        level *= exp(sqrt(l->rate) * draw_brownian(l->key, (double)at_us * 1e-6));
    return level;
}

static double photons(double lambda_nm) {
    return pow(lambda_nm, -4) / expm1(C2_NM_K / (lambda_nm * COLOUR_TEMPERATURE_K));
}

double lamp_spectrum(double lambda_nm) {
    return photons(lambda_nm) / photons(UNITY_NM);
}
