#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/config.h"
#include "tests/support/plan_bench.h"

static int read_text(const char *text, struct config *config, struct err_list *errors) {
    return config_read_text("goniod.yaml", text, strlen(text), config, errors);
}

static void the_built_in_bench_is_valid(void **state) {
    (void)state;
    struct config config;
    struct err_list errors = {0};
    assert_int_equal(read_text(config_builtin_text(), &config, &errors), 0);
    assert_int_equal(config.source.kind, CONFIG_AXIS_MOTOR);
    assert_string_equal(config.source.link, "sim:modbus");
    assert_string_equal(config.spectrometer.link, "sim:usb");
    assert_string_equal(config.holder.profile, "om-az");
    assert_true(config_position_find(&config.holder, "reference")->deg == 90);
    assert_null(config_position_find(&config.holder, "attic"));
    assert_string_equal(config.operate[0], "goniod");
}

static void a_bench_turned_by_hand(void **state) {
    (void)state;
    struct config config;
    struct err_list errors = {0};
    assert_int_equal(
        read_text("spectrometer: {model: usb4000, serial: FLMT05929}\n"
                  "shutter: manual\n"
                  "optics: {beam_mm: 20, view_mm: 3}\n"
                  "axes:\n"
                  "  source: {profile: om-az, link: \"rtu:/dev/ttyUSB0\", unit: 1, baud: 9600, parity: N,\n"
                  "           limits_deg: [-70, 140], blind_deg: 8, direction: -1}\n"
                  "  sample: {fixed_deg: 45}\n"
                  "keep_out:\n"
                  "  - {source_deg: [100, 140], sample_deg: [-90, -60]}\n"
                  "notify: [/usr/local/bin/tell-me]\n",
                  &config, &errors),
        0);
    assert_int_equal(config.sample.kind, CONFIG_AXIS_FIXED);
    assert_true(config.sample.fixed_deg == 45);
    assert_int_equal(config.holder.kind, CONFIG_AXIS_MANUAL);
    assert_int_equal(config.shutter, SHUTTER_MANUAL);
    assert_int_equal(config.source.parity, 'N');
    assert_int_equal(config.source.direction, -1);
    assert_int_equal(config.n_keep_out, 1);
    assert_true(config.keep_out[0].sample_deg[1] == -60);
    assert_true(config.lamp_warm_up_min == 30);
    assert_string_equal(config.spectrometer.link, "usb");
    assert_string_equal(config.notify[0], "/usr/local/bin/tell-me");
    assert_string_equal(config.watch[0], "users");
}

struct expected {
    int line, column;
    const char *part;
};

static void assert_errors(const struct err_list *errors, const struct expected *expected, size_t n) {
    if (errors->n != n)
        plan_bench_show(errors);
    assert_int_equal(errors->n, n);
    for (size_t k = 0; k < n; k++) {
        bool found = false;
        for (size_t i = 0; i < errors->n; i++)
            found = found || (errors->item[i].line == expected[k].line &&
                              errors->item[i].column == expected[k].column &&
                              strstr(errors->item[i].text, expected[k].part));
        if (!found) {
            plan_bench_show(errors);
            fail_msg("no error at %d:%d that says '%s'", expected[k].line, expected[k].column,
                     expected[k].part);
        }
    }
}

static void ten_mistakes_in_one_pass(void **state) {
    (void)state;
    const char *text = "spectrometer: {model: usb9000, link: serial}\n"
                       "shuter: none\n"
                       "optics: {beam_mm: 3, view_mm: 20}\n"
                       "axes:\n"
                       "  source: {profile: om-az, link: \"rtu:/dev/a\", unit: 1, limits_deg: [140, -70]}\n"
                       "  sample: {profile: om-az, link: \"rtu:/dev/a\", unit: 1, limits_deg: [-90, 90],\n"
                       "           blind_deg: 8, positions: {x: 1}, baud: 9600}\n"
                       "lamp: {warm_up_min: soon}\n";
    const struct expected expected[] = {
        {1, 16, "unknown model 'usb9000'"},
        {1, 32, "no way to a spectrometer"},
        {2, 1, "did you mean 'shutter'"},
        {3, 22, "view-in-beam"},
        {5, 57, "reversed"},
        {6, 48, "already axes.source"},
        {7, 12, "belongs to axes.source"},
        {7, 26, "positions belong to the holder"},
        {7, 45, "not their baud"},
        {8, 21, "must be a number"},
    };
    struct config config;
    struct err_list errors = {0};
    assert_int_equal(read_text(text, &config, &errors), -ERR_INPUT);
    assert_errors(&errors, expected, sizeof expected / sizeof expected[0]);
    err_list_free(&errors);
}

#define AROUND(optics)                                                                                       \
    "spectrometer: {model: usb4000}\noptics: {beam_mm: 20, view_mm: 3, " optics                              \
    "}\naxes: {sample: manual, source: {profile: om-az, link: \"tcp:10.0.0.2:502\", unit: 1, "               \
    "limits_deg: [-70, 140]}}\n"

static void polarisation_is_a_word_or_a_value_with_its_u(void **state) {
    (void)state;
    struct config config;
    struct err_list errors = {0};
    assert_int_equal(read_text(AROUND("filling: view-in-beam"), &config, &errors), 0);
    assert_int_equal(config.optics.polarisation, POLARISATION_UNKNOWN);
    assert_int_equal(read_text(AROUND("polarisation: depolarised"), &config, &errors), 0);
    assert_int_equal(config.optics.polarisation, POLARISATION_DEPOLARISED);
    assert_int_equal(read_text(AROUND("polarisation: {value: -0.03, u: 0.01}"), &config, &errors), 0);
    assert_int_equal(config.optics.polarisation, POLARISATION_STATED);
    assert_true(config.optics.polarisation_p == -0.03 && config.optics.u_polarisation == 0.01);
    assert_int_equal(read_text(AROUND("polarisation: some"), &config, &errors), -ERR_INPUT);
    assert_true(plan_bench_says(&errors, "expected unknown, depolarised"));
    err_list_free(&errors);
    assert_int_equal(read_text(AROUND("polarisation: {value: 2}"), &config, &errors), -ERR_INPUT);
    assert_int_equal(errors.n, 2);
    err_list_free(&errors);
}

static void an_axis_is_one_of_three_things(void **state) {
    (void)state;
    struct config config;
    struct err_list errors = {0};
    assert_int_equal(read_text("spectrometer: {model: usb4000}\n"
                               "optics: {beam_mm: 20, view_mm: 3}\n"
                               "axes: {source: manual, sample: [1, 2]}\n"
                               "holder: {profile: om-az, link: \"tcp:10.0.0.2:502\", unit: 3,\n"
                               "         positions: {a: 500, b: 10, c: 10}, direction: 0}\n",
                               &config, &errors),
                     -ERR_INPUT);
    assert_true(plan_bench_says(&errors, "expected a motor"));
    err_list_free(&errors);
    assert_int_equal(read_text("spectrometer: {model: usb4000}\n"
                               "optics: {beam_mm: 20, view_mm: 3, filling: beam-in-view}\n"
                               "axes: {source: manual, sample: {profile: om-az, link: com1, unit: 2}}\n"
                               "holder: {profile: om-az, link: \"tcp:10.0.0.2:502\", unit: 3,\n"
                               "         positions: {a: 500, b: 10, c: 10}, direction: 0}\n",
                               &config, &errors),
                     -ERR_INPUT);
    const struct expected expected[] = {
        {2, 10, "beam-in-view"},   {3, 8, "the source axis is a motor"},   {3, 24, "limits_deg is missing"},
        {3, 49, "no Modbus link"}, {5, 10, "outside the holder's limits"}, {5, 10, "positions b and c"},
        {5, 45, "1 or -1"},
    };
    assert_errors(&errors, expected, sizeof expected / sizeof expected[0]);
    err_list_free(&errors);
}

static void what_is_no_config_is_refused(void **state) {
    (void)state;
    struct config config;
    struct err_list errors = {0};
    assert_int_equal(read_text("", &config, &errors), -ERR_INPUT);
    assert_int_equal(errors.n, 1);
    err_list_free(&errors);
    assert_true(config_read_file("tests", &config, &errors) < 0);
    assert_int_equal(errors.n, 1);
    err_list_free(&errors);
    size_t size = 10 << 20;
    char *noise = malloc(size);
    uint32_t x = 1;
    for (size_t i = 0; i < size; i++)
        noise[i] = (char)((x = x * 1664525u + 1013904223u) >> 24);
    assert_int_equal(config_read_text("noise", noise, size, &config, &errors), -ERR_INPUT);
    assert_true(errors.n >= 1);
    err_list_free(&errors);
    assert_int_equal(config_read_text("noise", noise, 50000, &config, &errors), -ERR_INPUT);
    err_list_free(&errors);
    free(noise);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_built_in_bench_is_valid),
        cmocka_unit_test(a_bench_turned_by_hand),
        cmocka_unit_test(ten_mistakes_in_one_pass),
        cmocka_unit_test(polarisation_is_a_word_or_a_value_with_its_u),
        cmocka_unit_test(an_axis_is_one_of_three_things),
        cmocka_unit_test(what_is_no_config_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
