#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "proto/file.h"
#include "sim/goniosim_config.h"

static struct goniosim_config config;

static int read_text(const char *text, struct err_list *errors) {
    char path[] = "/tmp/goniosim-XXXXXX";
    int fd = mkstemp(path);
    assert_int_equal(write(fd, text, strlen(text)), strlen(text));
    close(fd);
    int rc = goniosim_config_read(path, &config, errors);
    unlink(path);
    return rc;
}

static bool said(const struct err_list *errors, const char *words) {
    for (size_t i = 0; i < errors->n; i++)
        if (strstr(errors->item[i].text, words))
            return true;
    return false;
}

static void test_without_a_file_it_is_the_built_in_bench(void **state) {
    (void)state;
    struct err_list errors = {0};
    assert_int_equal(goniosim_config_read(NULL, &config, &errors), 0);
    assert_int_equal(config.bench.n_axes, 3);
    assert_int_equal(config.n_buses, 2);
    assert_string_equal(config.bench.position[1].name, "reference");
    assert_true(config.place[0].has_surface && config.place[0].surface.beta_prime == 126);
    goniosim_config_free(&config);
}

static void test_the_defaults_are_those_of_the_tables(void **state) {
    (void)state;
    static struct goniosim_config built_in;
    struct err_list errors = {0};
    assert_int_equal(goniosim_config_read(NULL, &built_in, &errors), 0);
    assert_int_equal(read_text("spectrometer: {}\noptics: {}\nlamp: {}\n", &errors), 0);
    assert_memory_equal(&config.bench, &built_in.bench, sizeof config.bench);
    assert_string_equal(config.usb_listen, built_in.usb_listen);
}

/* docs/goniosim.md ends with what the tables say of themselves. */
static void test_the_document_is_what_the_tables_say(void **state) {
    (void)state;
    char *printed, *text;
    size_t printed_size, size;
    FILE *out = open_memstream(&printed, &printed_size);
    goniosim_config_print_reference(out);
    fclose(out);
    assert_int_equal(file_read("docs/goniosim.md", 1 << 20, &text, &size, NULL), 0);
    char *tables = strstr(text, "## goniosim.yaml");
    if (!tables || strcmp(tables, printed) != 0)
        fail_msg(
            "the tables of docs/goniosim.md are out of date: replace them by build/goniosim --reference");
    free(printed);
    free(text);
}

static void test_the_example_is_good(void **state) {
    (void)state;
    struct err_list errors = {0};
    assert_int_equal(goniosim_config_read("docs/examples/goniosim.yaml", &config, &errors), 0);
    assert_true(config.place[0].has_surface);
    goniosim_config_free(&config);
}

static void test_surfaces_of_three_kinds(void **state) {
    (void)state;
    struct err_list errors = {0};
    char spectrum[] = "/tmp/goniosim-s-XXXXXX", brdf[] = "/tmp/goniosim-b-XXXXXX", text[1024];
    FILE *s = fdopen(mkstemp(spectrum), "w"), *b = fdopen(mkstemp(brdf), "w");
    fputs("lambda_nm,value\n380,0.1\n780,0.5\n", s);
    fputs("1\n500\n0.3 0 0.4 3.14159265 0.25\n", b);
    fclose(s);
    fclose(b);
    snprintf(text, sizeof text,
             "seed: 7\nmodbus: [\"rtu:/tmp/x\"]\noptics: {beam_mm: 3, view_mm: 20}\n"
             "axes: [{role: source, unit: 9}]\n"
             "holder:\n  - {name: a, deg: 0, paint: Cadmium Red, water_percent: 60}\n"
             "  - {name: b, deg: 45, spectrum: %s, sigma: 0.2, gamma: 0.1, beta_prime: 3, n: 1.5}\n"
             "  - {name: c, deg: 90, brdf: %s}\n  - {name: reference, deg: 180}\n",
             spectrum, brdf);
    int rc = read_text(text, &errors);
    for (size_t i = 0; i < errors.n; i++)
        print_message("# %s\n", errors.item[i].text);
    assert_int_equal(rc, 0);
    assert_int_equal(config.bench.seed, 7);
    assert_int_equal(config.bench.n_axes, 1);
    assert_int_equal(config.bench.axis[0].watchdog_ms, 1000);
    assert_int_equal(config.bench.filling, SIM_BEAM_IN_VIEW);
    assert_true(config.place[0].surface.gamma == 0.07);
    assert_true(config.place[1].surface.s_lambda[40] > 0.2999 &&
                config.place[1].surface.s_lambda[40] < 0.3001);
    assert_non_null(config.place[2].surface.measured);
    assert_false(config.place[3].has_surface);
    goniosim_config_free(&config);
    unlink(spectrum);
    unlink(brdf);
}

static void test_mistakes_come_together(void **state) {
    (void)state;
    struct err_list errors = {0};
    assert_int_equal(read_text("modbus: [udp:1]\nspectrometer: {listen: far}\n"
                               "holder:\n  - {name: a, deg: 0, paint: Cadmium Rot}\n"
                               "  - {name: b, deg: 9, paint: Cadmium Red, brdf: x.brdf}\n"
                               "  - {name: c, deg: 20, brdf: /nowhere.brdf}\n",
                               &errors),
                     -ERR_INPUT);
    assert_true(said(&errors, "udp:1") && said(&errors, "far") && said(&errors, "Cadmium Rot"));
    assert_true(said(&errors, "three ways") && said(&errors, "nowhere"));
    err_list_free(&errors);
    errors = (struct err_list){0};
    assert_int_equal(read_text("sed: 1\n", &errors), -ERR_INPUT);
    assert_true(said(&errors, "seed"));
    err_list_free(&errors);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_without_a_file_it_is_the_built_in_bench),
        cmocka_unit_test(test_the_defaults_are_those_of_the_tables),
        cmocka_unit_test(test_the_document_is_what_the_tables_say),
        cmocka_unit_test(test_the_example_is_good),
        cmocka_unit_test(test_surfaces_of_three_kinds),
        cmocka_unit_test(test_mistakes_come_together),
    };
    return cmocka_run_group_tests_name("goniosim_config", tests, NULL, NULL);
}
