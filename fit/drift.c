#include "fit/drift.h"

#include <math.h>

#include "proto/units.h"

static double walk(const struct estimate_bracket *bracket, double t1_us, double t2_us) {
    double first_us = fmax(fmin(t1_us, t2_us), 0), last_us = fmax(fmax(t1_us, t2_us), 0);
    double share = 1;
    if (bracket->length_us > 0) { /* a reading after the close is past the bridge */
        share = fmax(bracket->length_us - last_us, 0) / bracket->length_us;
    }
    return bracket->rate * first_us / US_PER_S * share;
}

double drift_covariance(const struct estimate_bracket *bracket, size_t a, size_t b) {
    double ta = bracket->tau_us[a], tb = bracket->tau_us[b];
    double c = walk(bracket, ta, tb);
    if (bracket->tau_r_us) {
        double ra = bracket->tau_r_us[a], rb = bracket->tau_r_us[b];
        c += walk(bracket, ra, rb) - walk(bracket, ta, rb) - walk(bracket, ra, tb);
    }
    return c;
}
