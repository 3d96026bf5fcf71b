#include "proto/joint.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int joint_allocate(struct joint *joint, int n, struct err *e) {
    size_t cells = (size_t)n * (size_t)n + 1;
    joint->n = n;
    joint->statistical = calloc(cells, sizeof(double));
    joint->common = calloc(cells, sizeof(double));
    if (joint->statistical && joint->common)
        return 0;
    joint_free(joint);
    return err_set(e, ERR_NOMEM, "no memory for a covariance of %d rows", n);
}

void joint_free(struct joint *joint) {
    free(joint->statistical);
    free(joint->common);
    joint->statistical = joint->common = NULL;
    joint->n = 0;
}

int joint_copy(struct joint *to, const struct joint *from, struct err *e) {
    *to = *from;
    to->statistical = to->common = NULL;
    if (from->n == 0)
        return 0;
    int rc = joint_allocate(to, from->n, e);
    size_t size = (size_t)from->n * (size_t)from->n * sizeof(double);
    if (rc == 0) {
        memcpy(to->statistical, from->statistical, size);
        memcpy(to->common, from->common, size);
    }
    return rc;
}

int joint_row(const struct joint *joint, int parameter, int band) {
    for (int i = 0; i < joint->n; i++)
        if (joint->row[i].parameter == parameter && joint->row[i].band == band)
            return i;
    return -1;
}

double joint_u(const struct joint *joint, int parameter, int band) {
    int i = joint_row(joint, parameter, band);
    size_t at = (size_t)i * (size_t)(joint->n + 1);
    return i < 0 ? NAN : sqrt(joint->statistical[at] + joint->common[at]);
}

size_t joint_triangle(int n) {
    return (size_t)n * (size_t)(n + 1) / 2;
}

void joint_pack(int n, const double *matrix, double *triangle) {
    for (int i = 0; i < n; i++)
        for (int k = i; k < n; k++)
            *triangle++ = matrix[i * n + k];
}

void joint_unpack(int n, const double *triangle, double *matrix) {
    for (int i = 0; i < n; i++)
        for (int k = i; k < n; k++)
            matrix[i * n + k] = matrix[k * n + i] = *triangle++;
}

/* ---- to JSON ---- */

static json_t *number_or_null(double value) {
    return isfinite(value) ? json_real(value) : json_null();
}

static json_t *list_of(const double *value, size_t n) {
    json_t *list = json_array();
    for (size_t i = 0; i < n; i++)
        json_array_append_new(list, number_or_null(value[i]));
    return list;
}

static json_t *triangle_of(const struct joint *joint, const double *matrix) {
    json_t *list = json_array();
    for (int i = 0; i < joint->n; i++)
        for (int k = i; k < joint->n; k++)
            json_array_append_new(list, number_or_null(matrix[i * joint->n + k]));
    return list;
}

static json_t *rows_of(const struct joint *joint) {
    json_t *list = json_array();
    for (int i = 0; i < joint->n; i++) {
        const struct joint_row *row = &joint->row[i];
        const char *name = material_parameter_name(joint->model, row->parameter);
        json_array_append_new(list, row->band < 0 ? json_pack("[s]", name)
                                                  : json_pack("[s,i]", name, band_nm(row->band)));
    }
    return list;
}

static void put_values(json_t *json, const struct joint *joint) {
    json_t *values = json_object(), *bounds = json_array(), *std = json_object();
    for (int p = 0; p < MATERIAL_PARAMETERS; p++) {
        const char *name = material_parameter_name(joint->model, p);
        if (!name || !isfinite(joint->value[p]))
            continue;
        json_object_set_new(values, name, json_real(joint->value[p]));
        json_object_set_new(std, name, number_or_null(joint_u(joint, p, -1)));
        if (joint->at_bound[p])
            json_array_append_new(bounds, json_string(name));
    }
    json_object_set_new(values, "kappa", json_real(joint->kappa));
    json_object_set_new(json, "parameters", values);
    json_object_set_new(json, "std", std);
    json_object_set_new(json, "at_bound", bounds);
}

json_t *joint_found_to_json(const struct joint *joint) {
    json_t *json = json_object();
    json_object_set_new(json, "mirror_offset_deg", number_or_null(joint->mirror_offset_deg));
    json_object_set_new(json, "u_mirror_offset_deg", number_or_null(joint->u_mirror_offset_deg));
    json_object_set_new(json, "polarisation", number_or_null(joint->polarisation));
    json_object_set_new(json, "u_polarisation", number_or_null(joint->u_polarisation));
    return json;
}

json_t *joint_to_json(const struct joint *joint) {
    double u_s[BANDS];
    for (int b = 0; b < BANDS; b++)
        u_s[b] = joint_u(joint, MATERIAL_S, b);
    json_t *json = json_pack("{s:s, s:b, s:s, s:b, s:b, s:i, s:i, s:i}", "model", joint->model, "converged",
                             joint->converged, "refusal", joint->refusal, "beta_prime_per_band",
                             joint->beta_prime_per_band, "misfit", joint->misfit, "n_points", joint->n_points,
                             "n_values", joint->n_values, "n_bands", joint->n_bands);
    json_object_set_new(json, "chi2", number_or_null(joint->chi2));
    json_object_set_new(json, "chi2_expected", number_or_null(joint->chi2_expected));
    put_values(json, joint);
    json_t *found = joint_found_to_json(joint);
    json_object_update(json, found);
    json_decref(found);
    json_object_set_new(json, "s_lambda", list_of(joint->s_lambda, BANDS));
    json_object_set_new(json, "u_s_lambda", list_of(u_s, BANDS));
    if (joint->beta_prime_per_band)
        json_object_set_new(json, "beta_prime_lambda", list_of(joint->beta_prime, BANDS));
    json_object_set_new(json, "rows", rows_of(joint));
    json_object_set_new(json, "covariance_statistical", triangle_of(joint, joint->statistical));
    json_object_set_new(json, "covariance_common", triangle_of(joint, joint->common));
    return json;
}

/* ---- from JSON ---- */

static int refuse(struct err *e, const char *key, const char *expected) {
    return err_set(e, ERR_INPUT, "in a joint fit %s must be %s", key, expected);
}

static int take_list(const json_t *json, const char *key, double *value, size_t n, struct err *e) {
    const json_t *list = json_object_get(json, key);
    if (!json_is_array(list) || json_array_size(list) != n)
        return refuse(e, key, "a list of as many numbers as its rows or bands ask for");
    for (size_t i = 0; i < n; i++) {
        const json_t *number = json_array_get(list, i);
        if (!json_is_number(number) && !json_is_null(number))
            return refuse(e, key, "a list of numbers and nulls");
        value[i] = json_is_null(number) ? NAN : json_number_value(number);
    }
    return 0;
}

static int take_rows(const json_t *json, struct joint *joint, int *n, struct err *e) {
    const json_t *rows = json_object_get(json, "rows");
    if (!json_is_array(rows) || json_array_size(rows) > JOINT_ROWS)
        return refuse(e, "rows", "a list of [parameter] or [parameter, nm]");
    *n = (int)json_array_size(rows);
    for (int i = 0; i < *n; i++) {
        const json_t *row = json_array_get(rows, (size_t)i), *nm = json_array_get(row, 1);
        struct joint_row *to = &joint->row[i];
        to->parameter = material_parameter_find(joint->model, json_string_value(json_array_get(row, 0)));
        to->band = nm ? ((int)json_integer_value(nm) - BAND_FIRST_NM) / BAND_STEP_NM : -1;
        if (to->parameter < 0 || to->band < -1 || to->band >= BANDS)
            return refuse(e, "rows", "parameters of its model at wavelengths of the bands");
    }
    return 0;
}

static int take_matrix(const json_t *json, const char *key, struct joint *joint, double *matrix,
                       struct err *e) {
    size_t n = joint_triangle(joint->n);
    double *triangle = malloc((n + 1) * sizeof *triangle);
    if (!triangle)
        return err_set(e, ERR_NOMEM, "no memory for a covariance of %d rows", joint->n);
    int rc = take_list(json, key, triangle, n, e);
    if (rc == 0)
        joint_unpack(joint->n, triangle, matrix);
    free(triangle);
    return rc;
}

static int take_texts(const json_t *json, struct joint *joint, struct err *e) {
    const char *model = json_string_value(json_object_get(json, "model"));
    const char *refusal = json_string_value(json_object_get(json, "refusal"));
    if (!model || !material_parameter_name(model, MATERIAL_S))
        return refuse(e, "model", "the name of a model");
    snprintf(joint->model, sizeof joint->model, "%s", model);
    snprintf(joint->refusal, sizeof joint->refusal, "%s", refusal ? refusal : "");
    joint->converged = json_is_true(json_object_get(json, "converged"));
    joint->beta_prime_per_band = json_is_true(json_object_get(json, "beta_prime_per_band"));
    joint->misfit = json_is_true(json_object_get(json, "misfit"));
    joint->n_points = (int)json_integer_value(json_object_get(json, "n_points"));
    joint->n_values = (int)json_integer_value(json_object_get(json, "n_values"));
    joint->n_bands = (int)json_integer_value(json_object_get(json, "n_bands"));
    return 0;
}

static double number_of(const json_t *json, const char *key) {
    const json_t *number = json_object_get(json, key);
    return json_is_number(number) ? json_number_value(number) : NAN;
}

/* Files and programs of before it was said say nothing: not fitted. */
void joint_found_from_json(const json_t *json, struct joint *joint) {
    joint->mirror_offset_deg = json_number_value(json_object_get(json, "mirror_offset_deg"));
    joint->u_mirror_offset_deg = json_number_value(json_object_get(json, "u_mirror_offset_deg"));
    joint->polarisation = json_number_value(json_object_get(json, "polarisation"));
    joint->u_polarisation = json_number_value(json_object_get(json, "u_polarisation"));
}

static void take_values(const json_t *json, struct joint *joint) {
    const json_t *values = json_object_get(json, "parameters"), *name;
    size_t i;
    joint_found_from_json(json, joint);
    joint->chi2 = number_of(json, "chi2");
    joint->chi2_expected = number_of(json, "chi2_expected");
    joint->kappa = number_of(values, "kappa");
    for (int p = 0; p < MATERIAL_PARAMETERS; p++) {
        const char *key = material_parameter_name(joint->model, p);
        joint->value[p] = key ? number_of(values, key) : NAN;
    }
    json_array_foreach(json_object_get(json, "at_bound"), i, name) {
        int p = material_parameter_find(joint->model, json_string_value(name));
        if (p >= 0)
            joint->at_bound[p] = true;
    }
}

static int take_bands(const json_t *json, struct joint *joint, struct err *e) {
    int rc = take_list(json, "s_lambda", joint->s_lambda, BANDS, e);
    if (rc == 0 && joint->beta_prime_per_band)
        return take_list(json, "beta_prime_lambda", joint->beta_prime, BANDS, e);
    for (int b = 0; b < BANDS; b++)
        joint->beta_prime[b] = isfinite(joint->s_lambda[b]) ? joint->value[MATERIAL_BETA_PRIME] : NAN;
    return rc;
}

int joint_from_json(const json_t *json, struct joint *joint, struct err *e) {
    int n = 0;
    *joint = (struct joint){0};
    int rc = take_texts(json, joint, e);
    if (rc < 0)
        return rc;
    take_values(json, joint);
    if ((rc = take_bands(json, joint, e)) < 0 || (rc = take_rows(json, joint, &n, e)) < 0 ||
        (rc = joint_allocate(joint, n, e)) < 0)
        return rc;
    if ((rc = take_matrix(json, "covariance_statistical", joint, joint->statistical, e)) < 0 ||
        (rc = take_matrix(json, "covariance_common", joint, joint->common, e)) < 0)
        joint_free(joint);
    return rc;
}
