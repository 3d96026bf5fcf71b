/* What stands on the simulated bench from a file, the one that goniosim takes: parameters with a spectrum from CSV, and
 * a measured surface, each as the truth that a campaign finds. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sim/goniosim_config.h"
#include "tests/support/judgement.h"
#include "tests/support/lab.h"

static const char JOB[] =
    "name: own\nsamples:\n  - {name: patch, holder: sample, paint: never heard of, support: unknown,\n"
    "     size_mm: [120, 80]}\ngeometry: {theta_i_deg: [20, 40], theta_v_deg: [-60, -30, 0, 20, 30, 40, "
    "50]}\n"
    "reference: {certificate: ptfe.csv}\n";

static char dir[96];

static int set_up(void **state) {
    (void)state;
    lab_make_dir(dir);
    return 0;
}

static int tear_down(void **state) {
    (void)state;
    lab_remove_dir(dir);
    return 0;
}

static void put(const char *name, const char *text) {
    char path[160];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    FILE *out = fopen(path, "w");
    fputs(text, out);
    fclose(out);
}

static void put_bench(const char *surface) {
    char text[900];
    snprintf(text, sizeof text,
             "seed: 5\noptics: {stray_light: 1e-4}\naxes:\n  - {role: source, unit: 1, u_zero_deg: "
             "0.01}\nholder:\n"
             "  - {name: sample, deg: 0, %s}\n  - {name: reference, deg: 90}\n",
             surface);
    put("bench.yaml", text);
}

/* S rises through the band of the mean, as on a red paint. */
static void put_spectrum(void) {
    put("s.csv", "lambda_nm,value\n380,0.05\n550,0.08\n600,0.4\n780,0.5\n");
}

/* beta = 0.3 at all angles but for a lobe about the mirror direction of 40 deg; f_r in 1/sr, two wavelengths. */
static void put_surface(void) {
    char text[8000] = "2\n380 780\n", line[160];
    for (int i = 10; i <= 60; i += 10)
        for (int v = -70; v <= 70; v += 10) {
            double beta = 0.3 + 0.2 * exp(-(v - i) * (v - i) / 400.0);
            snprintf(line, sizeof line, "%.9f 0 %.9f %.9f %.9f %.9f\n", i * M_PI / 180, abs(v) * M_PI / 180,
                     v > 0 ? M_PI : 0, beta / M_PI, 1.2 * beta / M_PI);
            strcat(text, line);
        }
    put("surface.brdf", text);
}

/* Which bench it was is in the session. */
static void look_for_bench(struct session *s, const struct simulate_bench *bench) {
    char *text;
    assert_int_equal(session_get_text(s, "bench", &text, NULL), 0);
    assert_non_null(text);
    assert_string_equal(text, simulate_bench_text(bench));
    assert_non_null(strstr(text, "seed: 5\n"));
    free(text);
}

static void measure(struct judgement *j) {
    struct lab lab;
    struct err_list errors = {0};
    struct simulate_bench *bench;
    struct goniosim_config file;
    char path[160], name[192];
    snprintf(path, sizeof path, "%s/bench.yaml", dir);
    if (simulate_bench_read(&bench, path, &errors) < 0)
        fail_msg("%s", errors.item[0].text);
    assert_int_equal(simulate_bench_seed(bench), 5);
    assert_int_equal(goniosim_config_read(path, &file, &errors), 0); /* the same file serves goniosim */
    lab_open(&lab, dir, &(struct simulate_options){.seed = simulate_bench_seed(bench), .file = bench}, NULL);
    lab_job(&lab, JOB);
    lab_run(&lab);
    assert_int_equal(lab.ended, CAMPAIGN_DONE);
    assert_true(lab_session(&lab, 0, name));
    struct session *s = lab_open_session(&lab, name);
    memset(j, 0, sizeof *j);
    j->surface = file.place[0].surface;
    judge_session(s, j);
    look_for_bench(s, bench);
    session_close(s, NULL);
    lab_close(&lab);
    simulate_bench_free(bench);
    goniosim_config_free(&file);
    print_message("# %d points, pulls: mean %.2f, rms %.2f, worst %.2f\n", j->n, j->sum / j->n,
                  sqrt(j->sum2 / j->n), j->worst);
    assert_true(j->n >= 10);
    assert_int_equal(j->provisional, 0);
    assert_true(fabs(j->worst) < 5);
}

static void parameters_with_a_spectrum_are_the_truth(void **state) {
    (void)state;
    char surface[300];
    struct judgement j;
    put_spectrum();
    snprintf(surface, sizeof surface, "sigma: 0.3, gamma: 0.12, beta_prime: 4, n: 1.5, spectrum: %s/s.csv",
             dir);
    put_bench(surface);
    measure(&j);
}

static void a_measured_surface_is_the_truth(void **state) {
    (void)state;
    char surface[300];
    struct judgement j;
    put_surface();
    snprintf(surface, sizeof surface, "brdf: %s/surface.brdf", dir);
    put_bench(surface);
    measure(&j);
}

static void a_session_of_another_bench_is_not_resumed(void **state) {
    (void)state;
    struct lab lab;
    struct err_list errors = {0};
    struct simulate_bench *bench;
    char path[160], name[192];
    put_bench("paint: Cobalt Blue Hue");
    snprintf(path, sizeof path, "%s/bench.yaml", dir);
    assert_int_equal(simulate_bench_read(&bench, path, &errors), 0);
    lab_open(&lab, dir, &(struct simulate_options){.seed = 5, .file = bench}, NULL);
    lab_script(&lab, (struct lab_line){.steps = 3, .state = CAMPAIGN_RUNNING, .command = COMMAND_INTERRUPT});
    lab_job(&lab, JOB);
    lab_run(&lab);
    assert_true(lab_session(&lab, 0, name));
    lab_close(&lab);
    simulate_bench_free(bench);
    lab_open(&lab, dir, &(struct simulate_options){.seed = 5}, NULL);
    lab_resume(&lab, name);
    lab_run_refused(&lab, ERR_STATE, "the file of the simulated bench has changed");
    lab_close(&lab);
}

static void mistakes_of_the_file_are_named(void **state) {
    (void)state;
    struct simulate_bench *bench;
    struct err_list errors = {0};
    char path[160];
    put_bench("brdf: /nowhere.brdf");
    snprintf(path, sizeof path, "%s/bench.yaml", dir);
    assert_int_equal(simulate_bench_read(&bench, path, &errors), -ERR_INPUT);
    assert_non_null(strstr(errors.item[0].text, "/nowhere.brdf"));
    err_list_free(&errors);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, set_up, tear_down)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(parameters_with_a_spectrum_are_the_truth),
        TEST(a_measured_surface_is_the_truth),
        TEST(a_session_of_another_bench_is_not_resumed),
        TEST(mistakes_of_the_file_are_named),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
