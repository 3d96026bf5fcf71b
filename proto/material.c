#include "proto/material.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const struct {
    const char *key;
    size_t offset;
} figures[] = {
    {"chi2", offsetof(struct estimate, chi2)},
    {"bic", offsetof(struct estimate, bic)},
    {"r2", offsetof(struct estimate, r2)},
    {"median_relative_error", offsetof(struct estimate, median_relative_error)},
    {"condition", offsetof(struct estimate, condition)},
    {"n_effective", offsetof(struct estimate, n_effective)},
    {"loio", offsetof(struct estimate, loio)},
    {"specular_energy", offsetof(struct estimate, specular_energy)},
    {"source_width_deg", offsetof(struct estimate, source_width_deg)},
    {"sensor_width_deg", offsetof(struct estimate, sensor_width_deg)},
    {"mirror_offset_deg", offsetof(struct estimate, mirror_offset_deg)},
    {"u_mirror_offset_deg", offsetof(struct estimate, u_mirror_offset_deg)},
    {"zero_source_deg", offsetof(struct estimate, zero_source_deg)},
    {"zero_sample_deg", offsetof(struct estimate, zero_sample_deg)},
    {"polarisation", offsetof(struct estimate, polarisation)},
    {"u_polarisation", offsetof(struct estimate, u_polarisation)},
};
#define FIGURES (sizeof figures / sizeof *figures)

static json_t *number_to_json(double value) {
    if (isnan(value))
        return json_null();
    if (isinf(value))
        return json_string(value > 0 ? "inf" : "-inf");
    return json_real(value);
}

static bool number_from_json(const json_t *json, double *value) {
    const char *text = json_string_value(json);
    if (json_is_number(json))
        *value = json_number_value(json);
    else if (json_is_null(json))
        *value = NAN;
    else if (text && strcmp(text, "inf") == 0)
        *value = INFINITY;
    else if (text && strcmp(text, "-inf") == 0)
        *value = -INFINITY;
    else
        return false;
    return true;
}

/* One number per parameter of the model, as {"S": ..., "sigma": ...}. */
static json_t *named(const struct estimate *m, const double value[MATERIAL_PARAMETERS]) {
    json_t *json = json_object();
    for (int i = 0; i < MATERIAL_PARAMETERS; i++) {
        const char *name = material_parameter_name(m->model, i);
        if (name)
            json_object_set_new(json, name, number_to_json(value[i]));
    }
    return json;
}

static json_t *names_of(const struct estimate *m, const bool *wanted) {
    json_t *json = json_array();
    for (int i = 0; i < MATERIAL_PARAMETERS; i++) {
        const char *name = material_parameter_name(m->model, i);
        if (name && (!wanted || wanted[i]))
            json_array_append_new(json, json_string(name));
    }
    return json;
}

static json_t *matrix(const struct estimate *m, double cell[MATERIAL_PARAMETERS][MATERIAL_PARAMETERS]) {
    json_t *rows = json_array();
    for (int i = 0; i < MATERIAL_PARAMETERS; i++) {
        if (!material_parameter_name(m->model, i))
            continue;
        json_t *row = json_array();
        for (int k = 0; k < MATERIAL_PARAMETERS; k++)
            if (material_parameter_name(m->model, k))
                json_array_append_new(row, number_to_json(cell[i][k]));
        json_array_append_new(rows, row);
    }
    return rows;
}

static json_t *pair(double low, double high) {
    json_t *json = json_array();
    json_array_append_new(json, number_to_json(low));
    json_array_append_new(json, number_to_json(high));
    return json;
}

static json_t *int_pair(int low, int high) {
    return json_pack("[i,i]", low, high);
}

static json_t *parameters_to_json(const struct estimate *m) {
    json_t *json = named(m, m->value);
    json_object_set_new(json, "kappa", number_to_json(m->kappa));
    json_object_set_new(json, "q", number_to_json(m->q));
    json_object_set_new(json, "mean_nm", int_pair(m->mean_low_nm, m->mean_high_nm));
    return json;
}

static void put_uncertainty(json_t *json, const struct estimate *m) {
    double total[MATERIAL_PARAMETERS], statistical[MATERIAL_PARAMETERS], common[MATERIAL_PARAMETERS];
    double correlation[MATERIAL_PARAMETERS][MATERIAL_PARAMETERS],
        copy[2][MATERIAL_PARAMETERS][MATERIAL_PARAMETERS];
    for (int i = 0; i < MATERIAL_PARAMETERS; i++) {
        statistical[i] = sqrt(m->statistical[i][i]);
        common[i] = sqrt(m->common[i][i]);
        total[i] = sqrt(m->statistical[i][i] + m->common[i][i]);
        if (total[i] == 0 &&
            (m->at_bound[i] || m->not_identifiable[i])) /* not exact, but without any: null */
            statistical[i] = common[i] = total[i] = NAN;
    }
    for (int i = 0; i < MATERIAL_PARAMETERS; i++)
        for (int k = 0; k < MATERIAL_PARAMETERS; k++)
            correlation[i][k] = i == k ? 1 : (m->statistical[i][k] + m->common[i][k]) / (total[i] * total[k]);
    memcpy(copy[0], m->statistical, sizeof copy[0]);
    memcpy(copy[1], m->common, sizeof copy[1]);
    json_object_set_new(json, "std", named(m, total));
    json_object_set_new(json, "std_statistical", named(m, statistical));
    json_object_set_new(json, "std_common", named(m, common));
    json_object_set_new(json, "order", names_of(m, NULL));
    json_object_set_new(json, "correlation", matrix(m, correlation));
    json_object_set_new(json, "covariance_statistical", matrix(m, copy[0]));
    json_object_set_new(json, "covariance_common", matrix(m, copy[1]));
}

static json_t *gaps_to_json(const struct estimate *m) {
    json_t *list = json_array();
    for (int i = 0; i < MATERIAL_PARAMETERS; i++) {
        const char *name = material_parameter_name(m->model, i);
        if (!name || !m->not_identifiable[i])
            continue;
        const struct material_gap *gap = &m->gap[i];
        json_t *json = json_object();
        json_object_set_new(json, "parameter", json_string(name));
        json_object_set_new(json, "why", json_string(gap->why));
        if (gap->has_next)
            json_object_set_new(json, "measure_next",
                                json_pack("{s:f,s:f}", "theta_i_deg", gap->next_theta_i_deg, "theta_v_deg",
                                          gap->next_theta_v_deg));
        json_array_append_new(list, json);
    }
    return list;
}

static json_t *limits_to_json(const struct estimate *m) {
    json_t *json = json_object();
    for (int i = 0; i < MATERIAL_PARAMETERS; i++) {
        const char *name = material_parameter_name(m->model, i);
        if (name && m->at_bound[i])
            json_object_set_new(json, name, number_to_json(m->limit_95[i]));
    }
    return json;
}

static json_t *losses_to_json(const struct estimate *m) {
    json_t *json = json_object();
    for (int i = 0; i < MATERIAL_LOSSES; i++)
        json_object_set_new(json, material_loss_name((enum material_loss)i), number_to_json(m->loss[i]));
    return json;
}

static json_t *bands_to_json(const double value[BANDS]) {
    json_t *json = json_array();
    for (int k = 0; k < BANDS; k++)
        json_array_append_new(json, number_to_json(value[k]));
    return json;
}

static json_t *span_to_json(const struct material_span *span) {
    json_t *json = json_object();
    json_object_set_new(json, "P", pair(-span->p_limit, span->p_limit));
    json_object_set_new(json, "n", pair(span->n[0], span->n[1]));
    json_object_set_new(json, "beta_prime", pair(span->beta_prime[0], span->beta_prime[1]));
    return json;
}

static json_t *spectrum_to_json(const struct estimate *m) {
    json_t *json = json_object();
    json_object_set_new(json, "first_nm", json_integer(BAND_FIRST_NM));
    json_object_set_new(json, "step_nm", json_integer(BAND_STEP_NM));
    json_object_set_new(json, "measured_nm", int_pair(band_nm(m->band_first), band_nm(m->band_last)));
    json_object_set_new(json, "S", bands_to_json(m->s_lambda));
    json_object_set_new(json, "u", bands_to_json(m->u_s_lambda));
    return json;
}

json_t *estimate_to_json(const struct estimate *m) {
    json_t *json = json_object(), *range = json_object(), *warnings = json_array();
    if (!json || !range || !warnings)
        return NULL;
    json_object_set_new(json, "model", json_string(m->model));
    json_object_set_new(json, "n_points", json_integer(m->n_points));
    json_object_set_new(json, "iterations", json_integer(m->iterations));
    json_object_set_new(json, "n_parameters", json_integer(m->n_parameters));
    json_object_set_new(json, "converged", json_boolean(m->converged));
    if (m->refusal[0])
        json_object_set_new(json, "refusal", json_string(m->refusal));
    json_object_set_new(json, "provisional", json_boolean(m->provisional));
    json_object_set_new(json, "beam_in_view", json_boolean(m->beam_in_view));
    json_object_set_new(json, "parameters", parameters_to_json(m));
    put_uncertainty(json, m);
    for (size_t i = 0; i < FIGURES; i++)
        json_object_set_new(
            json, figures[i].key,
            number_to_json(*(const double *)(const void *)((const char *)m + figures[i].offset)));
    json_object_set_new(json, "loss", json_string(material_loss_name(m->minimised)));
    json_object_set_new(json, "losses", losses_to_json(m));
    json_object_set_new(json, "at_bound", names_of(m, m->at_bound));
    json_object_set_new(json, "limit_95", limits_to_json(m));
    json_object_set_new(json, "not_identifiable", gaps_to_json(m));
    for (int i = 0; i < m->n_warnings; i++)
        json_array_append_new(warnings, json_string(m->warning[i]));
    json_object_set_new(json, "warnings", warnings);
    json_object_set_new(range, "theta_i_deg", pair(m->theta_i_low_deg, m->theta_i_high_deg));
    json_object_set_new(range, "theta_v_deg", pair(m->theta_v_low_deg, m->theta_v_high_deg));
    json_object_set_new(json, "range", range);
    if (m->polarisation_span.p_limit > 0)
        json_object_set_new(json, "polarisation_span", span_to_json(&m->polarisation_span));
    if (m->has_spectrum)
        json_object_set_new(json, "spectrum", spectrum_to_json(m));
    return json;
}

static int refuse(struct err *e, const char *key, const char *expected) {
    return err_set(e, ERR_INPUT, "in the JSON of an estimate '%s' must be %s", key, expected);
}

/* An absent key leaves *value as it is. */
static int take_number(const json_t *object, const char *key, double *value, struct err *e) {
    const json_t *json = json_object_get(object, key);
    if (json && !number_from_json(json, value))
        return refuse(e, key, "a number or null");
    return 0;
}

static int take_int(const json_t *object, const char *key, int *value, struct err *e) {
    const json_t *json = json_object_get(object, key);
    if (json && !json_is_integer(json))
        return refuse(e, key, "a whole number");
    if (json)
        *value = (int)json_integer_value(json);
    return 0;
}

static int take_bool(const json_t *object, const char *key, bool *value, struct err *e) {
    const json_t *json = json_object_get(object, key);
    if (json && !json_is_boolean(json))
        return refuse(e, key, "true or false");
    *value = json_is_true(json);
    return 0;
}

static int take_text(const json_t *object, const char *key, char *text, size_t size, struct err *e) {
    const json_t *json = json_object_get(object, key);
    if (!json)
        return 0;
    if (!json_is_string(json) || json_string_length(json) >= size)
        return refuse(e, key, "a text that is not too long");
    strcpy(text, json_string_value(json));
    return 0;
}

static int take_pair(const json_t *object, const char *key, double *low, double *high, struct err *e) {
    const json_t *json = json_object_get(object, key);
    if (!json)
        return 0;
    if (json_array_size(json) != 2 || !number_from_json(json_array_get(json, 0), low) ||
        !number_from_json(json_array_get(json, 1), high))
        return refuse(e, key, "a list of two numbers");
    return 0;
}

static int take_int_pair(const json_t *object, const char *key, int *low, int *high, struct err *e) {
    double a = *low, b = *high;
    int rc = take_pair(object, key, &a, &b, e);
    if (rc == 0 && !(fabs(a) < 1e6 && fabs(b) < 1e6))
        return refuse(e, key, "a list of two whole numbers");
    *low = (int)a;
    *high = (int)b;
    return rc;
}

static int take_named(const json_t *object, const char *model, double value[MATERIAL_PARAMETERS], bool all,
                      struct err *e) {
    for (int i = 0; i < MATERIAL_PARAMETERS; i++) {
        const char *name = material_parameter_name(model, i);
        const json_t *json = name ? json_object_get(object, name) : NULL;
        if (name && !json && all)
            return refuse(e, name, "there, as the model has this parameter");
        if (json && !number_from_json(json, &value[i]))
            return refuse(e, name, "a number or null");
    }
    return 0;
}

int estimate_parameters_from_json(const json_t *parameters, struct estimate *m, struct err *e) {
    if (!json_is_object(parameters))
        return refuse(e, "parameters", "an object");
    m->kappa = m->q = 1;
    m->mean_low_nm = 400;
    m->mean_high_nm = 700;
    int rc = take_named(parameters, m->model, m->value, true, e);
    if (rc == 0)
        rc = take_number(parameters, "kappa", &m->kappa, e);
    if (rc == 0)
        rc = take_number(parameters, "q", &m->q, e);
    if (rc == 0)
        rc = take_int_pair(parameters, "mean_nm", &m->mean_low_nm, &m->mean_high_nm, e);
    return rc;
}

static int take_names(const json_t *object, const char *key, const char *model, bool *flag, struct err *e) {
    const json_t *list = json_object_get(object, key);
    for (size_t i = 0; i < json_array_size(list); i++) {
        const char *name = json_string_value(json_array_get(list, i));
        int index = material_parameter_find(model, name);
        if (index < 0)
            return refuse(e, key, "a list of the model's parameters");
        flag[index] = true;
    }
    return 0;
}

static int take_matrix(const json_t *object, const char *key, const char *model,
                       double cell[MATERIAL_PARAMETERS][MATERIAL_PARAMETERS], struct err *e) {
    const json_t *rows = json_object_get(object, key);
    size_t row = 0;
    if (!rows)
        return 0;
    for (int i = 0; i < MATERIAL_PARAMETERS; i++) {
        if (!material_parameter_name(model, i))
            continue;
        const json_t *cells = json_array_get(rows, row++);
        size_t column = 0;
        for (int k = 0; k < MATERIAL_PARAMETERS; k++)
            if (material_parameter_name(model, k) &&
                !number_from_json(json_array_get(cells, column++), &cell[i][k]))
                return refuse(e, key, "a matrix with a row and column per parameter");
    }
    return 0;
}

static int take_gaps(const json_t *object, struct estimate *m, struct err *e) {
    static const char key[] = "not_identifiable";
    const json_t *list = json_object_get(object, key);
    for (size_t i = 0; i < json_array_size(list); i++) {
        const json_t *json = json_array_get(list, i), *next = json_object_get(json, "measure_next");
        const char *name = json_string_value(json_object_get(json, "parameter"));
        int index = material_parameter_find(m->model, name);
        if (index < 0)
            return refuse(e, key, "a list of objects with a 'parameter' of the model");
        struct material_gap *gap = &m->gap[index];
        m->not_identifiable[index] = true;
        gap->has_next = next != NULL;
        if (take_text(json, "why", gap->why, sizeof gap->why, e) != 0 ||
            take_number(next, "theta_i_deg", &gap->next_theta_i_deg, e) != 0 ||
            take_number(next, "theta_v_deg", &gap->next_theta_v_deg, e) != 0)
            return -ERR_INPUT;
    }
    return 0;
}

static int take_warnings(const json_t *object, struct estimate *m, struct err *e) {
    const json_t *list = json_object_get(object, "warnings");
    for (size_t i = 0; i < json_array_size(list); i++) {
        const json_t *json = json_array_get(list, i);
        if (i == MATERIAL_WARNINGS || !json_is_string(json))
            return refuse(e, "warnings", "a list of a few texts");
        snprintf(m->warning[m->n_warnings++], sizeof m->warning[0], "%s", json_string_value(json));
    }
    return 0;
}

static int take_bands(const json_t *object, const char *key, double value[BANDS], struct err *e) {
    const json_t *list = json_object_get(object, key);
    for (size_t k = 0; k < BANDS; k++)
        if (!number_from_json(json_array_get(list, k), &value[k]))
            return refuse(e, key, "a list with a number or null for each band");
    return 0;
}

static int take_spectrum(const json_t *object, struct estimate *m, struct err *e) {
    const json_t *json = json_object_get(object, "spectrum");
    int low = band_nm(0), high = band_nm(BANDS - 1);
    if (!json)
        return 0;
    m->has_spectrum = true;
    if (take_int_pair(json, "measured_nm", &low, &high, e) != 0 ||
        take_bands(json, "S", m->s_lambda, e) != 0 || take_bands(json, "u", m->u_s_lambda, e) != 0)
        return -ERR_INPUT;
    if (low < band_nm(0) || high > band_nm(BANDS - 1) || low > high)
        return refuse(e, "measured_nm", "within the bands");
    m->band_first = (low - BAND_FIRST_NM) / BAND_STEP_NM;
    m->band_last = (high - BAND_FIRST_NM) / BAND_STEP_NM;
    return 0;
}

static int take_losses(const json_t *json, struct estimate *m, struct err *e) {
    char name[16] = "ml";
    int status = take_text(json, "loss", name, sizeof name, e);
    for (int i = 0; i < MATERIAL_LOSSES && status == 0; i++) {
        const char *known = material_loss_name((enum material_loss)i);
        m->loss[i] = NAN; /* earlier estimates do not have it */
        status = take_number(json_object_get(json, "losses"), known, &m->loss[i], e);
    }
    m->minimised = material_loss_find(name);
    if (status == 0 && m->minimised == MATERIAL_LOSSES)
        status = refuse(e, "loss", "one of ml, ols, log, cuberoot and cosine");
    return status;
}

static int take_state(const json_t *json, struct estimate *m, struct err *e) {
    if (take_int(json, "n_points", &m->n_points, e) != 0 ||
        take_int(json, "iterations", &m->iterations, e) != 0 ||
        take_int(json, "n_parameters", &m->n_parameters, e) != 0 ||
        take_bool(json, "converged", &m->converged, e) != 0 ||
        take_bool(json, "provisional", &m->provisional, e) != 0 ||
        take_bool(json, "beam_in_view", &m->beam_in_view, e) != 0 ||
        take_text(json, "refusal", m->refusal, sizeof m->refusal, e) != 0)
        return -ERR_INPUT;
    for (size_t i = 0; i < FIGURES; i++)
        if (take_number(json, figures[i].key, (double *)(void *)((char *)m + figures[i].offset), e) != 0)
            return -ERR_INPUT;
    return 0;
}

static int take_range(const json_t *json, struct estimate *m, struct err *e) {
    const json_t *range = json_object_get(json, "range");
    int rc = take_pair(range, "theta_i_deg", &m->theta_i_low_deg, &m->theta_i_high_deg, e);
    return rc != 0 ? rc : take_pair(range, "theta_v_deg", &m->theta_v_low_deg, &m->theta_v_high_deg, e);
}

static int take_span(const json_t *object, struct material_span *span, struct err *e) {
    const json_t *json = json_object_get(object, "polarisation_span");
    double low = 0;
    int rc = take_pair(json, "P", &low, &span->p_limit, e);
    if (rc == 0)
        rc = take_pair(json, "n", &span->n[0], &span->n[1], e);
    return rc != 0 ? rc : take_pair(json, "beta_prime", &span->beta_prime[0], &span->beta_prime[1], e);
}

int estimate_from_json(const json_t *json, struct estimate *m, struct err *e) {
    memset(m, 0, sizeof *m);
    if (take_text(json, "model", m->model, sizeof m->model, e) != 0)
        return -ERR_INPUT;
    if (!material_parameter_name(m->model, MATERIAL_S))
        return refuse(e, "model", "the name of a known model");
    if (estimate_parameters_from_json(json_object_get(json, "parameters"), m, e) != 0 ||
        take_state(json, m, e) != 0 || take_losses(json, m, e) != 0 ||
        take_matrix(json, "covariance_statistical", m->model, m->statistical, e) != 0 ||
        take_matrix(json, "covariance_common", m->model, m->common, e) != 0 ||
        take_names(json, "at_bound", m->model, m->at_bound, e) != 0 ||
        take_named(json_object_get(json, "limit_95"), m->model, m->limit_95, false, e) != 0 ||
        take_gaps(json, m, e) != 0 || take_warnings(json, m, e) != 0 || take_range(json, m, e) != 0 ||
        take_span(json, &m->polarisation_span, e) != 0)
        return -ERR_INPUT;
    return take_spectrum(json, m, e);
}
