#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/plan_forecast.h"
#include "proto/material.h"
#include "tests/support/plan_bench.h"

#define REFERENCE                                                                                            \
    "{mode: fixed, geometry: {theta_i_deg: 45, theta_v_deg: 0}, holder: reference, certificate: ptfe.csv, "  \
    "bracket_min: 15}"

static json_t *forecast_of(const char *geometry, char **text) {
    struct plan_bench b;
    struct err e = {0};
    size_t size = 0;
    plan_bench_open(&b, NULL);
    plan_bench_job(&b, NULL, geometry, REFERENCE);
    if (plan_bench_make(&b) < 0)
        plan_bench_show(&b.errors);
    json_t *forecast = plan_forecast(&b.plan, &b.job, &b.config, &b.devices, &e);
    if (!forecast)
        fail_msg("%s", e.text);
    FILE *out = open_memstream(text, &size);
    plan_forecast_print(forecast, out);
    fclose(out);
    plan_bench_close(&b);
    return forecast;
}

static const json_t *set_of(const json_t *forecast, size_t set) {
    return json_array_get(json_object_get(forecast, "sets"), set);
}

static double u_of(const json_t *forecast, size_t set, const char *kind, const char *parameter) {
    return json_number_value(json_object_get(json_object_get(set_of(forecast, set), kind), parameter));
}

static void every_published_set_and_parameter(void **state) {
    (void)state;
    char *text;
    json_t *f = forecast_of(
        "{theta_i_deg: [10, 20, 30, 40, 50, 60], theta_v_deg: {from: -80, to: 80, step: 5}}", &text);
    assert_int_equal(json_array_size(json_object_get(f, "sets")), 4);
    assert_true(json_integer_value(json_object_get(f, "points")) > 150);
    /* one scale: u(S) is the certificate's; a mean of many pixels counts to about 1e-4 (measurement.md 6) */
    double certificate = json_number_value(json_object_get(f, "certificate_relative"));
    assert_true(certificate > 0);
    for (size_t set = 0; set < 4; set++) {
        double s = json_number_value(json_object_get(json_object_get(set_of(f, set), "parameters"), "S"));
        assert_float_equal(u_of(f, set, "std_common", "S") / s, certificate, 0.1 * certificate);
        for (int p = 0; p <= MATERIAL_N; p++)
            assert_true(u_of(f, set, "std", material_parameter_name("composite", p)) > 0);
        assert_int_equal(json_array_size(json_object_get(set_of(f, set), "not_identifiable")), 0);
    }
    double noise = json_number_value(json_object_get(f, "noise_relative"));
    assert_true(noise > 3e-5 && noise < 3e-4);
    assert_non_null(strstr(text, "acrylic"));
    assert_null(strstr(text, "not identifiable"));
    json_decref(f);
    free(text);
}

static void names_what_the_angles_will_not_tell(void **state) {
    (void)state;
    char *text;
    json_t *f = forecast_of("{theta_i_deg: [10, 20, 30], theta_v_deg: {from: -80, to: 80, step: 5}}", &text);
    const json_t *gaps = json_object_get(set_of(f, 0), "not_identifiable");
    assert_int_equal(json_array_size(gaps), 2);
    assert_string_equal(json_string_value(json_object_get(json_array_get(gaps, 1), "parameter")), "n");
    assert_non_null(strstr(text, "not identifiable on acrylic: n"));
    const json_t *next = json_object_get(json_array_get(gaps, 1), "measure_next");
    assert_true(json_number_value(json_object_get(next, "theta_i_deg")) >
                45); /* what it lacks is steep incidence */
    assert_non_null(strstr(text, "; measure next at incidence "));
    json_decref(f);
    free(text);
    f = forecast_of("{pairs: [[10, 0], [20, 0], [30, 20]]}", &text);
    assert_int_equal(json_array_size(json_object_get(set_of(f, 0), "not_identifiable")), 5);
    assert_true(json_is_null(json_object_get(json_object_get(set_of(f, 0), "std"), "S")));
    assert_non_null(strstr(text, "unknown"));
    json_decref(f);
    free(text);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_published_set_and_parameter),
        cmocka_unit_test(names_what_the_angles_will_not_tell),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
