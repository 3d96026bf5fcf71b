#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/material.h"

static double noise(unsigned *seed) {
    *seed = *seed * 1664525u + 1013904223u;
    return (*seed >> 8) / 16777216.0 - 0.3;
}

static void fill(struct estimate *m, const char *model, unsigned seed) {
    memset(m, 0, sizeof *m);
    snprintf(m->model, sizeof m->model, "%s", model);
    m->converged = seed % 2;
    m->provisional = !m->converged;
    m->n_points = 198;
    for (int i = 0; i < MATERIAL_PARAMETERS; i++) {
        if (!material_parameter_name(model, i))
            continue;
        m->n_parameters++;
        m->value[i] = noise(&seed);
        for (int k = 0; k <= i; k++)
            if (material_parameter_name(model, k)) {
                m->statistical[i][k] = m->statistical[k][i] = noise(&seed) * 1e-7;
                m->common[i][k] = m->common[k][i] = noise(&seed) * 1e-9;
            }
        m->statistical[i][i] = fabs(m->statistical[i][i]);
        m->common[i][i] = fabs(m->common[i][i]);
    }
    m->kappa = M_PI;
    m->q = 1.3;
    m->mean_low_nm = 420;
    m->mean_high_nm = 680;
    m->chi2 = noise(&seed) * 1e3;
    m->bic = -INFINITY;
    m->r2 = NAN;
    m->median_relative_error = 1.0 / 3;
    m->specular_energy = 5e-324;
    m->theta_i_high_deg = 60;
    m->theta_v_low_deg = -80;
    m->theta_v_high_deg = 80;
    snprintf(m->refusal, sizeof m->refusal, "too few angles: 3 of \"5\"");
    m->n_warnings = 2;
    snprintf(m->warning[0], sizeof m->warning[0], "specular energy 1.2");
    snprintf(m->warning[1], sizeof m->warning[1], "σ > 0.8");
    m->at_bound[MATERIAL_S] = true;
    m->limit_95[MATERIAL_S] = 0.0123456789012345678;
    m->not_identifiable[MATERIAL_S] = true;
    m->gap[MATERIAL_S] = (struct material_gap){"no far backscatter", true, 60, -80};
    m->has_spectrum = true;
    m->band_first = 4;
    m->band_last = 64;
    for (int k = 0; k < BANDS; k++) {
        m->s_lambda[k] = k < 4 || k > 64 ? NAN : noise(&seed);
        m->u_s_lambda[k] = k < 4 || k > 64 ? NAN : noise(&seed);
    }
}

static bool same(double a, double b) {
    return a == b || (isnan(a) && isnan(b));
}

static void assert_same(const struct estimate *a, const struct estimate *b) {
    assert_string_equal(a->model, b->model);
    assert_string_equal(a->refusal, b->refusal);
    assert_true(a->converged == b->converged && a->provisional == b->provisional);
    assert_true(a->n_points == b->n_points && a->n_parameters == b->n_parameters);
    assert_memory_equal(a->value, b->value, sizeof a->value);
    assert_memory_equal(a->statistical, b->statistical, sizeof a->statistical);
    assert_memory_equal(a->common, b->common, sizeof a->common);
    assert_memory_equal(a->at_bound, b->at_bound, sizeof a->at_bound);
    assert_memory_equal(a->limit_95, b->limit_95, sizeof a->limit_95);
    assert_memory_equal(a->not_identifiable, b->not_identifiable, sizeof a->not_identifiable);
    assert_string_equal(a->gap[0].why, b->gap[0].why);
    assert_true(a->gap[0].has_next == b->gap[0].has_next);
    assert_true(a->gap[0].next_theta_i_deg == b->gap[0].next_theta_i_deg);
    assert_true(a->gap[0].next_theta_v_deg == b->gap[0].next_theta_v_deg);
    assert_true(a->kappa == b->kappa && a->q == b->q);
    assert_true(a->mean_low_nm == b->mean_low_nm && a->mean_high_nm == b->mean_high_nm);
    assert_true(same(a->chi2, b->chi2) && same(a->bic, b->bic) && same(a->r2, b->r2));
    assert_true(a->median_relative_error == b->median_relative_error);
    assert_true(a->specular_energy == b->specular_energy);
    assert_true(a->theta_i_low_deg == b->theta_i_low_deg && a->theta_i_high_deg == b->theta_i_high_deg);
    assert_true(a->theta_v_low_deg == b->theta_v_low_deg && a->theta_v_high_deg == b->theta_v_high_deg);
    assert_int_equal(a->n_warnings, b->n_warnings);
    for (int i = 0; i < a->n_warnings; i++)
        assert_string_equal(a->warning[i], b->warning[i]);
    assert_true(a->has_spectrum == b->has_spectrum);
    assert_true(a->band_first == b->band_first && a->band_last == b->band_last);
    for (int k = 0; k < BANDS; k++)
        assert_true(same(a->s_lambda[k], b->s_lambda[k]) && same(a->u_s_lambda[k], b->u_s_lambda[k]));
}

static void nothing_is_lost_through_text(void **state) {
    (void)state;
    const char *models[] = {"lambert",    "oren-nayar",  "eq1",     "composite",
                            "heavy-tail", "transmitted", "two-lobe"};
    for (unsigned i = 0; i < 7; i++) {
        struct estimate before, after;
        struct err e = {0};
        fill(&before, models[i], i + 1);
        json_t *json = estimate_to_json(&before);
        char *text = json_dumps(json, JSON_COMPACT);
        json_t *back = json_loads(text, 0, NULL);
        int rc = estimate_from_json(back, &after, &e);
        if (rc != 0)
            print_error("%s: %s\n", models[i], e.text);
        assert_int_equal(rc, 0);
        assert_same(&before, &after);
        json_decref(json);
        json_decref(back);
        free(text);
    }
}

static void what_people_read(void **state) {
    (void)state;
    struct estimate m;
    fill(&m, "eq1", 3);
    m.statistical[MATERIAL_GAMMA][MATERIAL_GAMMA] = 9e-6;
    m.common[MATERIAL_GAMMA][MATERIAL_GAMMA] = 16e-6;
    m.statistical[MATERIAL_GAMMA][MATERIAL_N] = 1e-6;
    m.common[MATERIAL_GAMMA][MATERIAL_N] = 2e-6;
    m.statistical[MATERIAL_N][MATERIAL_N] = 1e-4;
    m.common[MATERIAL_N][MATERIAL_N] = 0;
    json_t *json = estimate_to_json(&m);
    double std = 0, statistical = 0, common = 0, kappa = 0, correlation = 0;
    const char *order = NULL, *bound = NULL, *gap = NULL;
    int low = 0, high = 0;
    assert_int_equal(json_unpack(json, "{s:{s:F},s:{s:F},s:{s:F},s:{s:F,s:[i,i]},s:[s,s*],s:[s],s:[{s:s}]}",
                                 "std", "gamma", &std, "std_statistical", "gamma", &statistical, "std_common",
                                 "gamma", &common, "parameters", "kappa", &kappa, "mean_nm", &low, &high,
                                 "order", &order, &gap, "at_bound", &bound, "not_identifiable", "parameter",
                                 &gap),
                     0);
    assert_true(fabs(std - 5e-3) < 1e-15 && fabs(statistical - 3e-3) < 1e-15 && fabs(common - 4e-3) < 1e-15);
    assert_true(kappa == M_PI && low == 420 && high == 680);
    assert_string_equal(order, "S");
    assert_string_equal(bound, "S");
    correlation =
        json_number_value(json_array_get(json_array_get(json_object_get(json, "correlation"), 1), 3));
    assert_true(fabs(correlation - 3e-6 / (5e-3 * 1e-2)) < 1e-12);
    assert_null(json_object_get(json_object_get(json, "parameters"), "sigma"));
    json_decref(json);
}

static void wrong_json_is_refused(void **state) {
    (void)state;
    const struct {
        const char *text, *part;
    } cases[] = {
        {"[]", "'model'"},
        {"{}", "'model'"},
        {"{\"model\":\"phong\"}", "'model' must be the name of a known model"},
        {"{\"model\":\"lambert\"}", "'parameters' must be an object"},
        {"{\"model\":\"lambert\",\"parameters\":{}}", "'S' must be there"},
        {"{\"model\":\"lambert\",\"parameters\":{\"S\":\"x\"}}", "'S' must be a number or null"},
        {"{\"model\":\"lambert\",\"parameters\":{\"S\":1,\"mean_nm\":[1]}}", "'mean_nm'"},
        {"{\"model\":\"lambert\",\"parameters\":{\"S\":1},\"covariance_common\":[[]]}",
         "'covariance_common'"},
        {"{\"model\":\"lambert\",\"parameters\":{\"S\":1},\"at_bound\":[\"n\"]}", "'at_bound'"},
        {"{\"model\":\"lambert\",\"parameters\":{\"S\":1},\"spectrum\":{\"S\":[1]}}", "'S' must be a list"},
        {"{\"model\":\"lambert\",\"parameters\":{\"S\":1},\"converged\":1}", "'converged'"},
        {"{\"model\":\"a model with a long name\"}", "'model'"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct estimate m;
        struct err e = {0};
        json_t *json = json_loads(cases[i].text, 0, NULL);
        assert_int_equal(estimate_from_json(json, &m, &e), -ERR_INPUT);
        if (!strstr(e.text, cases[i].part))
            print_error("%s -> %s\n", cases[i].text, e.text);
        assert_non_null(strstr(e.text, cases[i].part));
        json_decref(json);
    }
}

static void parameters_alone(void **state) {
    (void)state;
    struct estimate m = {.model = "composite"};
    struct err e = {0};
    json_t *json =
        json_loads("{\"S\":0.1,\"sigma\":0.3,\"gamma\":0.05,\"beta_prime\":126,\"n\":1.4}", 0, NULL);
    assert_int_equal(estimate_parameters_from_json(json, &m, &e), 0);
    assert_true(m.value[MATERIAL_BETA_PRIME] == 126 && m.kappa == 1 && m.q == 1 && m.mean_high_nm == 700);
    json_decref(json);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_is_lost_through_text),
        cmocka_unit_test(what_people_read),
        cmocka_unit_test(wrong_json_is_refused),
        cmocka_unit_test(parameters_alone),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
