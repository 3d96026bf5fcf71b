#include "fit/render/energy.h"

#include "fit/render/albedo.h"
#include "proto/units.h"

#define GRAZING_DEG 89.9 /* stands for 90 deg, where an albedo is none */
/* Neither part is starved, however little of the light is its: its directions would come with huge weights. */
#define SHARE_LOW 0.05
#define SHARE_HIGH 0.95
#define DARKEST 1e-3 /* S below it counts as that in s_typical */

static double share_of(const struct paint *paint, const struct albedo *x, double s_mean) {
    double diffuse = s_mean * x->diffuse + s_mean * s_mean * x->inter;
    if (!(paint->shade.beta_prime > 0 || paint->shade.beta_prime_2 > 0)) {
        return 0;
    }
    double share = x->specular / (x->specular + diffuse);
    return share > SHARE_LOW ? fmin(share, SHARE_HIGH) : SHARE_LOW;
}

void energy_make(struct energy *energy, const struct paint *paint, enum energy_policy policy) {
    double mean = 0, logarithm = 0, s = 0;
    for (int k = 0; k < BANDS; k++) {
        s = fmax(s, paint->s[k]);
        mean += paint->s[k] / BANDS;
        logarithm += log(fmax(paint->s[k], DARKEST)) / BANDS;
    }
    energy->s_max = s;
    energy->s_typical = exp(logarithm);
    for (int i = 0; i < ENERGY_ANGLES; i++) {
        double theta_deg = deg_from_rad(acos(i / (ENERGY_ANGLES - 1.0)));
        struct albedo x = albedo_at(paint, fmin(theta_deg, GRAZING_DEG));
        double whole = s * x.diffuse + s * s * x.inter + x.specular;
        energy->excess[i] = policy == ENERGY_SCALE ? fmax(1, whole) : 1;
        energy->share[i] = share_of(paint, &x, mean);
    }
}

static double between(const double *table, double cosine) {
    double at = fmin(fmax(cosine, 0), 1) * (ENERGY_ANGLES - 1);
    int i = at < ENERGY_ANGLES - 2 ? (int)at : ENERGY_ANGLES - 2;
    return table[i] + (at - i) * (table[i + 1] - table[i]);
}

double energy_scale(const struct energy *energy, double cos_i, double cos_r) {
    return 1 / fmax(between(energy->excess, cos_i), between(energy->excess, cos_r));
}

double energy_share(const struct energy *energy, double cos_r) {
    return between(energy->share, cos_r);
}
