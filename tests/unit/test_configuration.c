#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "daemon/configuration.h"
#include "proto/file.h"
#include "sim/sim.h"
#include "tests/support/plan_bench.h"

#define DOCUMENT "docs/configuration.md"
#define EXAMPLES "docs/examples/"

static void the_document_is_what_the_tables_say(void **state) {
    (void)state;
    char *printed, *text;
    size_t printed_size, size;
    FILE *out = open_memstream(&printed, &printed_size);
    configuration_print(out);
    fclose(out);
    assert_int_equal(file_read(DOCUMENT, 1 << 20, &text, &size, NULL), 0);
    if (strcmp(printed, text) != 0)
        fail_msg("%s is out of date: build/tests/unit/test_configuration --write", DOCUMENT);
    free(printed);
    free(text);
}

/* The certificate that the example job names is the one of the simulated diffuser. */
static void the_certificate_is_the_simulated_diffusers(void **state) {
    (void)state;
    char folder[] = "/tmp/goniod-ptfe-XXXXXX", path[64], *stored, *written;
    size_t stored_size, written_size;
    struct sim_config config;
    struct err e = {0};
    sim_config_default(&config);
    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/ptfe.csv", folder);
    assert_int_equal(sim_certificate_write(&config, path, &e), 0);
    assert_int_equal(file_read(EXAMPLES "demo/ptfe.csv", 1 << 20, &stored, &stored_size, NULL), 0);
    assert_int_equal(file_read(path, 1 << 20, &written, &written_size, NULL), 0);
    if (strcmp(stored, written) != 0)
        fail_msg("%sdemo/ptfe.csv is out of date: build/tests/unit/test_configuration --write", EXAMPLES);
    assert_int_equal(sim_certificate_write(&config, path, &e), -ERR_BUSY); /* not over what is there */
    unlink(path);
    rmdir(folder);
    free(stored);
    free(written);
}

static void the_small_certificate_agrees_with_it(void **state) {
    (void)state;
    struct certificate one, table;
    struct err_list errors = {0};
    char *text;
    size_t size;
    assert_int_equal(file_read(EXAMPLES "certificate.csv", 1 << 20, &text, &size, NULL), 0);
    assert_int_equal(certificate_read_text("certificate.csv", text, size, &one, &errors), 0);
    free(text);
    assert_int_equal(file_read(EXAMPLES "demo/ptfe.csv", 1 << 20, &text, &size, NULL), 0);
    assert_int_equal(certificate_read_text("ptfe.csv", text, size, &table, &errors), 0);
    free(text);
    double beta[2][BANDS], u[2][BANDS], used;
    bool covered[BANDS];
    assert_int_equal(certificate_at(&one, 45, 0, 0, beta[0], u[0], covered, &used, NULL), 0);
    assert_int_equal(certificate_at(&table, 45, 0, 0, beta[1], u[1], covered, &used, NULL), 0);
    for (int band = 0; band < BANDS; band++) {
        assert_float_equal(beta[0][band], beta[1][band], 1e-5);
        assert_float_equal(u[0][band], u[1][band], 1e-5);
    }
    certificate_free(&one);
    certificate_free(&table);
}

static void the_example_job_runs_on_the_built_in_bench(void **state) {
    (void)state;
    static struct plan_bench bench;
    struct job_file files[JOB_FILES];
    char *text;
    size_t size;
    int n;
    plan_bench_open(&bench, NULL);
    assert_int_equal(job_load_files(EXAMPLES "job.yaml", &text, &size, files, &n, &bench.errors), 0);
    int rc = job_read_text("job.yaml", text, size, files, n, &bench.job, &bench.errors);
    plan_bench_show(&bench.errors);
    assert_int_equal(rc, 0);
    bench.devices.utc_s = 1767225600; /* the epoch of a virtual clock */
    rc = plan_bench_make(&bench);
    plan_bench_show(&bench.errors);
    assert_int_equal(rc, 0);
    assert_true(bench.plan.n_points > 200);
    free(text);
    job_files_free(files, n);
    plan_bench_close(&bench);
}

static void the_example_bench_is_valid(void **state) {
    (void)state;
    struct config config;
    struct err_list errors = {0};
    int rc = config_read_file(EXAMPLES "goniod.yaml", &config, &errors);
    plan_bench_show(&errors);
    assert_int_equal(rc, 0);
}

static int write_documents(void) {
    struct sim_config config;
    struct err e = {0};
    sim_config_default(&config);
    FILE *out = fopen(DOCUMENT, "w");
    unlink(EXAMPLES "demo/ptfe.csv");
    if (!out || sim_certificate_write(&config, EXAMPLES "demo/ptfe.csv", &e) < 0)
        return 1;
    configuration_print(out);
    return fclose(out) != 0;
}

int main(int argc, char **argv) {
    if (argc == 2 && strcmp(argv[1], "--write") == 0)
        return write_documents();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_document_is_what_the_tables_say),
        cmocka_unit_test(the_certificate_is_the_simulated_diffusers),
        cmocka_unit_test(the_small_certificate_agrees_with_it),
        cmocka_unit_test(the_example_job_runs_on_the_built_in_bench),
        cmocka_unit_test(the_example_bench_is_valid),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
