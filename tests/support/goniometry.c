#include "goniometry.h"

#include <math.h>
#include <string.h>

#include "fit/reflectance.h"

const char *const goniometry_name[GONIOMETRY_SETS] = {"acrylic", "0 %", "60 %", "90 %"};
const double goniometry_set[GONIOMETRY_SETS][MATERIAL_PARAMETERS] = {{0.10, 0.35, 0.05, 126, 1.40},
                                                                     {0.12, 0.2, 0.2, 15.7, 1.70},
                                                                     {0.20, 0.3, 0.07, 7.6, 1.70},
                                                                     {0.30, 0.5, 0.08, 1.6, 2.42}};

static double noise_sd(double beta) {
    return sqrt(0.005 * beta * 0.005 * beta + 0.001 * 0.001);
}

static double exact(const double *value, double q, double theta_i_deg, double theta_v_deg) {
    const struct reflectance_optics optics = {.kappa = 1, .q = q};
    struct reflectance_geometry g;
    double beta = NAN;
    if (reflectance_geometry(&g, theta_i_deg, theta_v_deg, NULL) == 0) {
        reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, &optics, &beta, NULL, NULL);
    }
    return beta;
}

void goniometry_make(struct goniometry *m, const double *value, double theta_i_high_deg,
                     double theta_v_step_deg) {
    memset(m, 0, sizeof *m);
    memcpy(m->value, value, sizeof m->value);
    m->q = 1;
    size_t n = 0;
    for (double i_deg = 10; i_deg <= theta_i_high_deg; i_deg += 10) {
        for (double v_deg = -80; v_deg <= 80 && n < GONIOMETRY_MAX; v_deg += theta_v_step_deg) {
            m->theta_i_deg[n] = i_deg;
            m->theta_v_deg[n] = v_deg;
            m->truth[n] = m->beta[n] = exact(value, 1, i_deg, v_deg);
            m->u[n] = noise_sd(m->truth[n]);
            n++;
        }
    }
    m->input = (struct estimate_input){.n = n,
                                       .theta_i_deg = m->theta_i_deg,
                                       .theta_v_deg = m->theta_v_deg,
                                       .beta = m->beta,
                                       .u_ind = m->u,
                                       .kappa = 1,
                                       .mean_low_nm = 400,
                                       .mean_high_nm = 700,
                                       .model = "composite"};
}

static bool in_mean(int band) {
    return band_nm(band) >= 400 && band_nm(band) <= 700;
}

/* Means of the bands 400..700 nm, as a reduction would form them. */
static void take_means(struct goniometry *m, const double *bands, double *means) {
    for (size_t i = 0; i < m->input.n; i++) {
        double sum = 0;
        int count = 0;
        for (int b = 0; b < BANDS; b++) {
            sum += in_mean(b) ? bands[i * BANDS + (size_t)b] : 0;
            count += in_mean(b);
        }
        means[i] = sum / count;
    }
}

void goniometry_colour(struct goniometry *m, double low, double high) {
    double sum = 0, square = 0;
    int count = 0;
    for (int b = 0; b < BANDS; b++) { /* a green: one broad band on a dark ground */
        double x = (band_nm(b) - 530) / 30.0;
        m->s_lambda[b] = low + (high - low) * exp(-x * x / 2);
        if (in_mean(b)) {
            sum += m->s_lambda[b];
            square += m->s_lambda[b] * m->s_lambda[b];
            count++;
        }
    }
    m->value[MATERIAL_S] = sum / count;
    m->q = square * count / (sum * sum);
    for (size_t i = 0; i < m->input.n; i++) {
        for (int b = 0; b < BANDS; b++) {
            double value[MATERIAL_PARAMETERS];
            memcpy(value, m->value, sizeof value);
            value[MATERIAL_S] = m->s_lambda[b];
            size_t at = i * BANDS + (size_t)b;
            m->band_truth[at] = m->band_beta[at] = exact(value, 1, m->theta_i_deg[i], m->theta_v_deg[i]);
            m->band_u[at] = noise_sd(m->band_truth[at]);
        }
    }
    take_means(m, m->band_truth, m->truth);
    memcpy(m->beta, m->truth, sizeof m->beta);
    for (size_t i = 0; i < m->input.n; i++) {
        m->u[i] = noise_sd(m->truth[i]);
    }
    m->input.band_beta = m->band_beta;
    m->input.band_u_ind = m->band_u;
}

void goniometry_noise(struct goniometry *m, struct dice *d) {
    for (size_t i = 0; i < m->input.n; i++) {
        m->beta[i] = m->truth[i] + noise_sd(m->truth[i]) * dice_normal(d);
        m->u[i] = noise_sd(m->beta[i]);
    }
}

void goniometry_band_noise(struct goniometry *m, struct dice *d, double relative) {
    int count = 0;
    for (int b = 0; b < BANDS; b++) {
        count += in_mean(b);
    }
    for (size_t i = 0; i < m->input.n; i++) {
        double square = 0;
        for (int b = 0; b < BANDS; b++) {
            size_t at = i * BANDS + (size_t)b;
            m->band_u[at] = relative * m->band_truth[at] + 1e-4;
            m->band_beta[at] = m->band_truth[at] + m->band_u[at] * dice_normal(d);
            square += in_mean(b) ? m->band_u[at] * m->band_u[at] : 0;
        }
        m->u[i] = sqrt(square) / count;
    }
    take_means(m, m->band_beta, m->beta);
}
