#include "fit/request.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/loss.h"
#include "fit/spot.h"

static int refuse(struct err *e, const char *where, const char *expected) {
    return err_set(e, ERR_INPUT, "in the request %s must be %s", where, expected);
}

/* null is NaN: a value that is not there. */
static int number_of(const json_t *json, double *value) {
    if (json_is_number(json)) {
        *value = json_number_value(json);
        return 0;
    }
    *value = NAN;
    return json_is_null(json) ? 0 : -ERR_INPUT;
}

static int get_number(const json_t *object, const char *key, double *value, struct err *e) {
    const json_t *json = json_object_get(object, key);
    return json && number_of(json, value) ? refuse(e, key, "a number or null") : 0;
}

static int get_bool(const json_t *object, const char *key, bool *value, struct err *e) {
    const json_t *json = json_object_get(object, key);
    if (json && !json_is_boolean(json)) {
        return refuse(e, key, "true or false");
    }
    *value = json ? json_is_true(json) : *value;
    return 0;
}

static int get_bands(const json_t *json, const char *key, double *bands, struct err *e) {
    if (!json_is_array(json) || json_array_size(json) != BANDS) {
        return refuse(e, key, "a list of 81 numbers or nulls");
    }
    for (size_t b = 0; b < BANDS; b++) {
        if (number_of(json_array_get(json, b), &bands[b])) {
            return refuse(e, key, "a list of 81 numbers or nulls");
        }
    }
    return 0;
}

/* A list that, where it is there, has exactly n members. */
static int get_list(const json_t *object, const char *key, size_t n, const json_t **list, struct err *e) {
    *list = json_object_get(object, key);
    if (*list && (!json_is_array(*list) || json_array_size(*list) != n)) {
        return err_set(e, ERR_INPUT, "in the request %s must be a list of %zu members", key, n);
    }
    return 0;
}

static int read_point(struct request *r, const json_t *json, size_t at, struct err *e) {
    double bands[BANDS], bands_u[BANDS], bands_cov[BANDS];
    const json_t *band_list = json_object_get(json, "bands"), *u_list = json_object_get(json, "bands_u");
    const json_t *cov_list = json_object_get(json, "bands_cov_next");
    struct fitset_point point = {.theta_i_deg = NAN,
                                 .theta_v_deg = NAN,
                                 .beta = NAN,
                                 .u_ind = NAN,
                                 .bands = NULL,
                                 .bands_u = NULL,
                                 .bands_cov = NULL};
    bool provisional = false;
    int status;
    if (!json_is_object(json)) {
        return refuse(e, "points", "a list of objects");
    }
    if ((status = get_number(json, "theta_i_deg", &point.theta_i_deg, e)) ||
        (status = get_number(json, "theta_v_deg", &point.theta_v_deg, e)) ||
        (status = get_number(json, "beta", &point.beta, e)) ||
        (status = get_number(json, "u_ind", &point.u_ind, e)) ||
        (status = get_bool(json, "mirrored", &point.mirrored, e)) ||
        (status = get_bool(json, "provisional", &provisional, e))) {
        return status;
    }
    if (band_list && !json_is_null(band_list)) {
        point.bands = bands;
        status = get_bands(band_list, "bands", bands, e);
    }
    if (!status && point.bands && u_list && !json_is_null(u_list)) {
        point.bands_u = bands_u;
        status = get_bands(u_list, "bands_u", bands_u, e);
    }
    if (!status && point.bands && cov_list && !json_is_null(cov_list)) {
        point.bands_cov = bands_cov;
        status = get_bands(cov_list, "bands_cov_next", bands_cov, e);
    }
    r->index[at] = -1;
    if (status || isnan(point.beta)) {
        r->data.mask.left_out[MASK_NO_VALUE] += !status;
        return status;
    }
    r->data.input.any_provisional = r->data.input.any_provisional || provisional;
    r->index[at] = (int)r->data.n;
    return fitset_add_point(&r->data, &point, e);
}

static int read_points(struct request *r, const json_t *list, struct err *e) {
    if (!json_is_array(list)) {
        return refuse(e, "points", "a list of objects");
    }
    r->n_points = json_array_size(list);
    r->index = calloc(r->n_points + 1, sizeof *r->index);
    if (!r->index) {
        return err_set(e, ERR_NOMEM, "no memory for a request of %zu points", r->n_points);
    }
    int status = 0;
    for (size_t i = 0; i < r->n_points && !status; i++) {
        status = read_point(r, json_array_get(list, i), i, e);
    }
    return status;
}

/* The index'th member of a list of request points as an index into the fitset; -1 = left out. */
static int member_of(const struct request *r, const json_t *points, size_t index, int *at, struct err *e) {
    json_int_t named = (json_int_t)index;
    if (points) {
        const json_t *json = json_array_get(points, index);
        named = json_is_integer(json) ? json_integer_value(json) : -1;
    }
    if (named < 0 || (size_t)named >= r->n_points) {
        return err_set(e, ERR_INPUT,
                       "in the request a list of points names one that is not there; there are %zu",
                       r->n_points);
    }
    *at = r->index[named];
    return 0;
}

static int read_cause(struct request *r, const json_t *json, struct err *e) {
    const char *name = json_string_value(json_object_get(json, "name"));
    const json_t *points = json_object_get(json, "points"), *means, *bands;
    size_t n = points ? json_array_size(points) : r->n_points;
    int status = name ? 0 : refuse(e, "common", "a list of objects with a name");
    if (status || (status = get_list(json, "mean", n, &means, e)) ||
        (status = get_list(json, "bands", n, &bands, e))) {
        return status;
    }
    if (!means) {
        return refuse(e, "mean", "a list of numbers, one for each point");
    }
    for (size_t i = 0; i < n && !status; i++) {
        double mean, row[BANDS];
        int at = -1;
        if ((status = member_of(r, points, i, &at, e))) {
            break;
        }
        if (number_of(json_array_get(means, i), &mean)) {
            return refuse(e, "mean", "a list of numbers");
        }
        if (bands && (status = get_bands(json_array_get(bands, i), "bands", row, e))) {
            break;
        }
        status = at < 0 ? 0 : fitset_add_cause(&r->data, name, (size_t)at, mean, bands ? row : NULL, e);
    }
    return status;
}

static int read_bracket(struct request *r, const json_t *json, struct err *e) {
    const json_t *points = json_object_get(json, "bracket_points"), *tau, *tau_r;
    size_t n = json_array_size(points), bracket = r->data.n_brackets;
    double length_us = 0, rate = 0;
    int status = json_is_array(points) ? 0 : refuse(e, "drift", "a list of objects with bracket_points");
    if (status || (status = get_list(json, "tau_us", n, &tau, e)) ||
        (status = get_list(json, "tau_r_us", n, &tau_r, e)) ||
        (status = get_number(json, "T_us", &length_us, e)) || (status = get_number(json, "rate", &rate, e))) {
        return status;
    }
    if (!tau) {
        return refuse(e, "tau_us", "a list of numbers, one for each of bracket_points");
    }
    status = fitset_add_bracket(&r->data, isnan(length_us) ? 0 : length_us, rate, e);
    for (size_t i = 0; i < n && !status; i++) {
        double tau_us, tau_r_us = 0;
        int at = -1;
        if (number_of(json_array_get(tau, i), &tau_us) ||
            (tau_r && number_of(json_array_get(tau_r, i), &tau_r_us))) {
            return refuse(e, "tau_us and tau_r_us", "lists of numbers");
        }
        if ((status = member_of(r, points, i, &at, e)) == 0 && at >= 0) {
            status = fitset_add_to_bracket(&r->data, bracket, (size_t)at, tau_us, tau_r_us, e);
        }
    }
    return status;
}

static int read_mean_nm(const json_t *json, struct fitset *data, struct err *e) {
    const json_t *list = json_object_get(json, "mean_nm");
    if (!list) {
        return 0;
    }
    if (!json_is_integer(json_array_get(list, 0)) || !json_is_integer(json_array_get(list, 1))) {
        return refuse(e, "mean_nm", "two whole numbers");
    }
    data->input.mean_low_nm = (int)json_integer_value(json_array_get(list, 0));
    data->input.mean_high_nm = (int)json_integer_value(json_array_get(list, 1));
    return 0;
}

static int read_model(const json_t *json, struct fitset *data, struct err *e) {
    const json_t *model = json_object_get(json, "model");
    enum reflectance_model found;
    if (!model) {
        return 0;
    }
    if (!json_is_string(model)) {
        return refuse(e, "model", "the name of a model, or all");
    }
    data->all_models = strcmp(json_string_value(model), "all") == 0;
    if (data->all_models) {
        data->input.model = reflectance_name(REFLECTANCE_COMPOSITE);
        return 0;
    }
    int status = reflectance_find(json_string_value(model), &found, e);
    data->input.model = status ? data->input.model : reflectance_name(found); /* outlives the JSON */
    return status;
}

static int read_loss(const json_t *json, struct fitset *data, struct err *e) {
    const json_t *loss = json_object_get(json, "loss");
    if (loss && !json_is_string(loss)) {
        return refuse(e, "loss", "the name of a loss");
    }
    return loss ? loss_find(json_string_value(loss), &data->input.loss, e) : 0;
}

static int read_polarisation(const json_t *json, struct fitset *data, struct err *e) {
    const json_t *polarisation = json_object_get(json, "polarisation");
    const char *word = json_string_value(polarisation);
    struct estimate_input *in = &data->input;
    if (!polarisation) {
        return 0;
    }
    in->polarisation = in->u_polarisation = 0;
    in->polarisation_unknown = word && strcmp(word, "unknown") == 0;
    if (word ? in->polarisation_unknown || strcmp(word, "depolarised") == 0
             : json_is_number(json_object_get(polarisation, "value")) &&
                   json_is_number(json_object_get(polarisation, "u"))) {
        in->polarisation = json_number_value(json_object_get(polarisation, "value"));
        in->u_polarisation = json_number_value(json_object_get(polarisation, "u"));
        return 0;
    }
    return refuse(e, "polarisation", "unknown, depolarised, or {value, u}");
}

static int read_spot(const json_t *json, struct fitset *data, struct err *e) {
    const json_t *filling = json_object_get(json, "filling"), *reference = json_object_get(json, "reference");
    if ((filling && !json_is_string(filling)) || (reference && !json_is_string(reference))) {
        return refuse(e, "filling and reference", "the names of a filling case and of a reference mode");
    }
    int status = filling ? spot_find_filling(json_string_value(filling), &data->input.filling, e) : 0;
    return status || !reference
               ? status
               : spot_find_reference(json_string_value(reference), &data->input.reference, e);
}

int request_read_settings(const json_t *json, struct fitset *data, struct err *e) {
    struct estimate_input *in = &data->input;
    struct {
        const char *key;
        double *value;
    } numbers[] = {{"kappa", &in->kappa},
                   {"u_repeat_source_deg", &in->u_repeat_source_deg},
                   {"u_repeat_sample_deg", &in->u_repeat_sample_deg},
                   {"u_zero_source_deg", &in->u_zero_source_deg},
                   {"u_zero_sample_deg", &in->u_zero_sample_deg},
                   {"source_width_deg", &in->source_width_deg},
                   {"sensor_width_deg", &in->sensor_width_deg}};
    if (!json_is_object(json)) {
        return err_set(e, ERR_INPUT, "a request must be a JSON object");
    }
    int status = read_model(json, data, e);
    status = status ? status : read_loss(json, data, e);
    status = status ? status : read_spot(json, data, e);
    status = status ? status : read_polarisation(json, data, e);
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers && !status; i++) {
        status = get_number(json, numbers[i].key, numbers[i].value, e);
    }
    if (status || (status = read_mean_nm(json, data, e)) ||
        (status = get_bool(json, "q_is_one", &in->q_is_one, e)) ||
        (status = get_bool(json, "hold_offset", &in->hold_offset, e))) {
        return status;
    }
    return get_bool(json, "unweighted", &in->unweighted, e);
}

static int read_each(struct request *r, const json_t *json, const char *key,
                     int (*read)(struct request *r, const json_t *json, struct err *e), struct err *e) {
    const json_t *list = json_object_get(json, key);
    if (list && !json_is_array(list)) {
        return refuse(e, key, "a list of objects");
    }
    int status = 0;
    for (size_t i = 0; i < json_array_size(list) && !status; i++) {
        status = read(r, json_array_get(list, i), e);
    }
    return status;
}

int request_read(const json_t *json, struct request *request, struct err *e) {
    int status = request_read_settings(json, &request->data, e);
    if (status || (status = get_bool(json, "final", &request->final, e)) ||
        (status = read_points(request, json_object_get(json, "points"), e)) ||
        (status = read_each(request, json, "common", read_cause, e))) {
        return status;
    }
    if (!request->final) { /* what it would change is asked once, at the end */
        request->data.input.polarisation_unknown = false;
    }
    return read_each(request, json, "drift", read_bracket, e);
}

void request_free(struct request *request) {
    fitset_free(&request->data);
    free(request->index);
    request->index = NULL;
}
