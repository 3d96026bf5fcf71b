#include "fit/mask.h"

#include <math.h>

#define RAD_PER_DEG (M_PI / 180)
#define PLANE_DEG 0.01 /* as BRDF_PLANE_DEG */
#define ROUND_DEG 0.01 /* files round their radians: 40 deg may come as 40.00002 */

static const struct {
    const char *key, *words;
} rules[MASK_RULES] = {[MASK_NO_VALUE] = {"no_value", "without a visible mean (a band of it is missing)"},
                       [MASK_GRAZING] = {"grazing", "beyond 88 deg, where the model has no meaning"},
                       [MASK_THETA_I] = {"theta_i", "of an incidence beyond --max-theta-i"},
                       [MASK_THETA_V] = {"theta_v", "of a viewing angle beyond --max-theta-v"},
                       [MASK_BLIND] = {"blind", "nearer to the source than --blind"},
                       [MASK_OUT_OF_PLANE] = {"out_of_plane", "out of the plane of incidence (--in-plane)"}};

const char *mask_key(enum mask_rule rule) {
    return rules[rule].key;
}

const char *mask_words(enum mask_rule rule) {
    return rules[rule].words;
}

/* By the haversine, exact for small angles. */
static double angle_between(double theta_i_deg, double theta_r_deg, double delta_phi_deg) {
    double a = theta_i_deg * RAD_PER_DEG, b = theta_r_deg * RAD_PER_DEG;
    double half_difference = sin((a - b) / 2), half_turn = sin(delta_phi_deg * RAD_PER_DEG / 2);
    double h = half_difference * half_difference + sin(a) * sin(b) * half_turn * half_turn;
    return 2 * asin(fmin(1, sqrt(h))) / RAD_PER_DEG;
}

static bool out_of_plane(double theta_i_deg, double theta_r_deg, double delta_phi_deg) {
    return delta_phi_deg > PLANE_DEG && delta_phi_deg < 180 - PLANE_DEG && theta_i_deg > 0 && theta_r_deg > 0;
}

bool mask_admits(struct mask *m, double theta_i_deg, double theta_r_deg, double delta_phi_deg) {
    const double between_deg = angle_between(theta_i_deg, theta_r_deg, delta_phi_deg);
    const bool objects[MASK_RULES] = {
        [MASK_GRAZING] = theta_i_deg > MASK_GRAZING_DEG || theta_r_deg > MASK_GRAZING_DEG,
        [MASK_THETA_I] = m->max_theta_i_deg > 0 && theta_i_deg > m->max_theta_i_deg + ROUND_DEG,
        [MASK_THETA_V] = m->max_theta_v_deg > 0 && theta_r_deg > m->max_theta_v_deg + ROUND_DEG,
        [MASK_BLIND] = m->blind_deg > 0 && between_deg < m->blind_deg - ROUND_DEG,
        [MASK_OUT_OF_PLANE] = m->in_plane && out_of_plane(theta_i_deg, theta_r_deg, delta_phi_deg)};
    for (int rule = 0; rule < MASK_RULES; rule++) {
        if (objects[rule]) {
            m->left_out[rule]++;
            return false;
        }
    }
    return true;
}
