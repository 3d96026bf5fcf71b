#include "daemon/simulate_surface.h"

#include <math.h>
#include <string.h>

#include "fit/reflectance.h"

#define SMOOTH_SIGMA 1e-6 /* the limit sigma -> 0 is Lambert's law; the model's domain is sigma > 0 */

/* Of S(lambda) over mean_nm: the mean, and mean(S^2) / mean(S)^2. */
static void mean_of(const struct simulate_surface *s, const int mean_nm[2], double *mean, double *q) {
    double sum = 0, squares = 0;
    int n = 0;
    for (int k = 0; k < BANDS; k++)
        if (band_nm(k) >= mean_nm[0] && band_nm(k) <= mean_nm[1]) {
            sum += s->s_lambda[k];
            squares += s->s_lambda[k] * s->s_lambda[k];
            n++;
        }
    *mean = n ? sum / n : NAN;
    *q = n ? squares / n / (*mean * *mean) : NAN;
}

json_t *simulate_surface_to_json(const struct simulate_surface *s, const int mean_nm[2]) {
    double mean, q;
    json_t *spectrum = json_array();
    mean_of(s, mean_nm, &mean, &q);
    for (int k = 0; k < BANDS; k++)
        json_array_append_new(spectrum, json_real(s->s_lambda[k]));
    return json_pack("{s:f, s:f, s:f, s:f, s:f, s:f, s:f, s:[i,i], s:o}", "S", mean, "sigma", s->sigma,
                     "gamma", s->gamma, "beta_prime", s->beta_prime, "n", s->n, "kappa", 1.0, "q", q,
                     "mean_nm", mean_nm[0], mean_nm[1], "s_lambda", spectrum);
}

static int number(const json_t *json, const char *key, double *value, struct err *e) {
    const json_t *member = json_object_get(json, key);
    if (!json_is_number(member))
        return err_set(e, ERR_INPUT, "a surface needs a number \"%s\"", key);
    *value = json_number_value(member);
    return 0;
}

int simulate_surface_from_json(const json_t *json, struct simulate_surface *s, struct err *e) {
    const json_t *spectrum = json_object_get(json, "s_lambda");
    int rc = number(json, "sigma", &s->sigma, e);
    if (rc == 0)
        rc = number(json, "gamma", &s->gamma, e);
    if (rc == 0)
        rc = number(json, "beta_prime", &s->beta_prime, e);
    if (rc == 0)
        rc = number(json, "n", &s->n, e);
    if (rc == 0 && json_array_size(spectrum) != BANDS)
        rc = err_set(e, ERR_INPUT, "a surface needs \"s_lambda\" with %d numbers", BANDS);
    for (int k = 0; k < BANDS && rc == 0; k++)
        s->s_lambda[k] = json_number_value(json_array_get(spectrum, k));
    return rc;
}

/* S(lambda) where it was measured, its nearest measured value elsewhere; the mean S where there is no spectrum. */
static void spectrum_of(const struct estimate *m, struct simulate_surface *s) {
    int first = -1, last = -1;
    for (int k = 0; k < BANDS; k++) {
        s->s_lambda[k] = m->has_spectrum ? m->s_lambda[k] : m->value[MATERIAL_S];
        if (!isfinite(s->s_lambda[k]))
            s->s_lambda[k] = last >= 0 ? s->s_lambda[last] : NAN;
        else {
            last = k;
            first = first < 0 ? k : first;
        }
    }
    for (int k = 0; k < first; k++)
        s->s_lambda[k] = s->s_lambda[first];
}

int simulate_surface_from_estimate(const struct estimate *m, struct simulate_surface *s, struct err *e) {
    enum reflectance_model model;
    if (*m->refusal || !isfinite(m->value[MATERIAL_S]))
        return err_set(e, ERR_INPUT, "the session has no fitted estimate: %s",
                       *m->refusal ? m->refusal : "it is not a number");
    if (reflectance_find(m->model, &model, NULL) < 0 || reflectance_column(model, MATERIAL_EXTRA_1) >= 0)
        return err_set(e, ERR_INPUT, "the simulated bench cannot show a surface of the model %s", m->model);
    if (m->kappa != 1)
        return err_set(e, ERR_INPUT, "the estimate has kappa = %g: fit it again with kappa = 1", m->kappa);
    bool rough = reflectance_column(model, MATERIAL_SIGMA) >= 0;
    bool glossy = reflectance_column(model, MATERIAL_GAMMA) >= 0;
    *s = (struct simulate_surface){.sigma = rough ? m->value[MATERIAL_SIGMA] : SMOOTH_SIGMA,
                                   .gamma = glossy ? m->value[MATERIAL_GAMMA] : 1,
                                   .beta_prime = glossy ? m->value[MATERIAL_BETA_PRIME] : 0,
                                   .n = glossy ? m->value[MATERIAL_N] : 1.5};
    spectrum_of(m, s);
    return 0;
}

double simulate_surface_mean(const struct simulate_surface *s, const struct aperture_form *form,
                             double theta_i_deg, double theta_v_deg, const int mean_nm[2]) {
    double mean, q, beta;
    mean_of(s, mean_nm, &mean, &q);
    const double value[MATERIAL_PARAMETERS] = {[MATERIAL_S] = mean,
                                               [MATERIAL_SIGMA] = s->sigma,
                                               [MATERIAL_GAMMA] = s->gamma,
                                               [MATERIAL_BETA_PRIME] = s->beta_prime,
                                               [MATERIAL_N] = s->n};
    const struct reflectance_optics optics = {.kappa = 1, .q = q};
    int rc =
        aperture_at(form, theta_i_deg, theta_v_deg, REFLECTANCE_COMPOSITE, value, &optics, &beta, NULL, NULL);
    return rc < 0 ? NAN : beta;
}
