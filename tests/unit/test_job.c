#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "daemon/job.h"
#include "tests/support/plan_bench.h"

static const char good[] =
    "name: hookers-green\n"
    "samples:\n"
    "  - {name: hg60, paint: Hooker's Green, support: drawing paper, size_mm: [60, 40],\n"
    "     water_percent: 60, notes: {applicator: 100 um}}\n"
    "geometry: {theta_i_deg: [30, 10, 10], theta_v_deg: {from: -80, to: 80, step: 5},\n"
    "           mirror_step_deg: 1, mirror_half_width_deg: 10}\n"
    "exposure: {average: 3}\n"
    "reference: {certificate: ptfe.csv, mode: per_incidence, bracket_min: 20}\n";

static struct job job; /* 100 kB, too large for a stack */

static int read_with(const char *text, const char *certificate, struct err_list *errors) {
    struct job_file file = {"ptfe.csv", certificate, strlen(certificate)};
    return job_read_text("job.yaml", text, strlen(text), &file, 1, &job, errors);
}

static int read_text(const char *text, struct err_list *errors) {
    char *certificate = plan_bench_certificate();
    int rc = read_with(text, certificate, errors);
    free(certificate);
    return rc;
}

static void a_job_is_read_with_its_defaults(void **state) {
    (void)state;
    struct err_list errors = {0};
    int rc = read_text(good, &errors);
    plan_bench_show(&errors);
    assert_int_equal(rc, 0);
    assert_string_equal(job.series, "hookers-green");
    assert_int_equal(job.n_samples, 1);
    assert_string_equal(job.sample[0].holder, "sample");
    assert_true(job.sample[0].has_water && job.sample[0].water_percent == 60);
    assert_true(job.sample[0].size_mm[1] == 40);
    assert_non_null(strstr(job.sample[0].notes, "100 um"));
    assert_int_equal(job.geometry.n_theta_i, 2); /* sorted, and each once */
    assert_true(job.geometry.theta_i_deg[0] == 10 && job.geometry.theta_i_deg[1] == 30);
    assert_int_equal(job.geometry.n_theta_v, 33);
    assert_true(job.geometry.theta_v_deg[32] == 80);
    assert_int_equal(job.mean_nm[0], 400);
    assert_int_equal(job.mean_nm[1], 700);
    assert_int_equal(job.exposure.average, 3);
    assert_true(job.exposure.target == 0.8 && job.exposure.max_ms == 5000);
    assert_int_equal(job.reference.mode, REFERENCE_PER_INCIDENCE);
    assert_string_equal(job_mode_name(job.reference.mode), "per_incidence");
    assert_true(job.reference.theta_v_deg == 0 && job.reference.bracket_min == 20);
    assert_string_equal(job.fit_model, "composite");
    assert_string_equal(job.certificate.serial, "T-1");
    assert_string_equal(job.text, good);
    job_free(&job);
}

static void ten_mistakes_in_one_pass(void **state) {
    (void)state;
    static const char text[] =
        "name: bad name\n"
        "sampels: []\n"
        "samples:\n"
        "  - {name: a, size_mm: [60]}\n"
        "  - {name: a, size_mm: [60, 40], water_percent: much}\n"
        "geometry: {theta_i_deg: [10, 95], theta_v_deg: {from: 20, to: -20, step: 5},\n"
        "           mirror_step_deg: 0}\n"
        "exposure: {min_ms: 100, max_ms: 10}\n"
        "reference: {certificate: ptfe.csv, mode: sometimes}\n"
        "fit: {model: composit}\n";
    static const struct {
        int line, column;
        const char *part;
    } expected[] = {
        {1, 1, "cannot be part of a file name"},
        {2, 1, "did you mean 'samples'"},
        {4, 24, "in the plane of incidence"},
        {5, 6, "already in the list"},
        {5, 49, "must be a number"},
        {6, 30, "outside 0 .. 89"},
        {6, 48, "runs backwards"},
        {7, 12, "a step of 0 deg never ends"},
        {8, 12, "larger than max_ms"},
        {9, 42, "must be one of"},
        {10, 7, "did you mean composite"},
    };
    struct err_list errors = {0};
    assert_int_equal(read_text(text, &errors), -ERR_INPUT);
    for (size_t k = 0; k < sizeof expected / sizeof expected[0]; k++) {
        bool found = false;
        for (size_t i = 0; i < errors.n; i++)
            found = found ||
                    (errors.item[i].line == expected[k].line && errors.item[i].column == expected[k].column &&
                     strstr(errors.item[i].text, expected[k].part));
        if (!found) {
            plan_bench_show(&errors);
            fail_msg("no error at %d:%d that says '%s'", expected[k].line, expected[k].column,
                     expected[k].part);
        }
    }
    assert_int_equal(errors.n, sizeof expected / sizeof expected[0]);
    err_list_free(&errors);
    job_free(&job);
}

static void refused(const char *text, int line, const char *part) {
    struct err_list errors = {0};
    assert_int_equal(read_text(text, &errors), -ERR_INPUT);
    bool found = false;
    for (size_t i = 0; i < errors.n; i++)
        found = found || (errors.item[i].line == line && strstr(errors.item[i].text, part));
    if (!found) {
        plan_bench_show(&errors);
        fail_msg("no error in line %d that says '%s'", line, part);
    }
    err_list_free(&errors);
    job_free(&job);
}

#define HEAD "name: x\nsamples: [{name: a, size_mm: [60, 40]}]\n"
#define TAIL "reference: {certificate: ptfe.csv}\n"

static void contradictions_have_their_place(void **state) {
    (void)state;
    refused(HEAD "geometry: {theta_i_deg: [1]}\n" TAIL, 3, "theta_v_deg is missing");
    refused(HEAD "geometry: {theta_i_deg: [1], theta_v_deg: [1], pairs: [[1, 1]]}\n" TAIL, 3, "either pairs");
    refused(HEAD "geometry: {pairs: [[1]]}\n" TAIL, 3, "a pair [theta_i, theta_v]");
    refused(HEAD "geometry: {pairs: [[-1, 3]]}\n" TAIL, 3, "theta_i lies in 0");
    refused(HEAD "geometry: {theta_i_deg: [1], theta_v_deg: [1], mirror_step_deg: 1}\n" TAIL, 3,
            "half_width");
    refused(HEAD "geometry: {theta_i_deg: [1], theta_v_deg: [1], mirror_half_width_deg: 1}\n" TAIL, 3,
            "mirror_step_deg is missing");
    refused(HEAD "geometry: {theta_i_deg: [1], theta_v_deg: {from: 0, to: 80, step: 0.01}}\n" TAIL, 3,
            "too many");
    refused("name: x\nsamples: []\ngeometry: {pairs: [[1, 1]]}\n" TAIL, 2, "samples");
    refused(HEAD "geometry: {pairs: [[1, 1]]}\nreference: {certificate: other.csv}\n", 4,
            "did not come with");
    refused(HEAD "geometry: {pairs: [[1, 1]]}\nmean_nm: [700, 400]\n" TAIL, 4, "smaller wavelength");
    refused(HEAD "geometry: {pairs: [[1, 1]]}\nmean_nm: [401, 700]\n" TAIL, 4, "no band");
    refused(HEAD "geometry: {pairs: [[1, 1]]}\n"
                 "reference: {certificate: ptfe.csv, mode: per_incidence, geometry: {theta_i_deg: 3}}\n",
            4, "only theta_v_deg is used");
}

static void a_certificate_too_short_or_broken(void **state) {
    (void)state;
    struct err_list errors = {0};
    assert_int_equal(read_with(good,
                               "# geometry: 45:0\n# k: 2\nlambda_nm,beta,u\n450,0.98,0.01\n650,0.98,0.01\n",
                               &errors),
                     -ERR_INPUT);
    assert_int_equal(errors.n, 1);
    assert_int_equal(errors.item[0].line, 8);
    assert_non_null(strstr(errors.item[0].text, "450 .. 650 nm"));
    err_list_free(&errors);
    job_free(&job);
    assert_int_equal(read_with(good, "# geometry: 45:0\n# k: 2\nlambda_nm,beta\n450,0.98\n", &errors),
                     -ERR_INPUT);
    assert_string_equal(errors.item[0].file, "ptfe.csv");
    err_list_free(&errors);
    job_free(&job);
}

static void a_certificate_expires(void **state) {
    (void)state;
    struct err_list errors = {0};
    const int64_t new_year_2030 = 1893456000, day = 86400;
    assert_int_equal(read_text(good, &errors), 0);
    assert_int_equal(job_check_expiry(&job, new_year_2030, &errors), 0); /* its last day */
    assert_int_equal(job_check_expiry(&job, new_year_2030 + day, &errors), -ERR_INPUT);
    assert_non_null(strstr(errors.item[0].text, "valid until 2030-01-01, today is 2030-01-02"));
    assert_int_equal(errors.item[0].line, 8);
    job.reference.accept_expired = true;
    assert_int_equal(job_check_expiry(&job, new_year_2030 + day, &errors), 0);
    err_list_free(&errors);
    job_free(&job);
}

static void what_is_no_job_is_refused(void **state) {
    (void)state;
    struct err_list errors = {0};
    assert_int_equal(job_read_text("e", "", 0, NULL, 0, &job, &errors), -ERR_INPUT);
    assert_int_equal(errors.n, 1);
    job_free(&job);
    err_list_free(&errors);
    char noise[5000];
    uint32_t x = 7;
    for (size_t i = 0; i < sizeof noise; i++)
        noise[i] = (char)((x = x * 1664525u + 1013904223u) >> 24);
    assert_int_equal(job_read_text("n", noise, sizeof noise, NULL, 0, &job, &errors), -ERR_INPUT);
    job_free(&job);
    err_list_free(&errors);
    assert_int_equal(job_read_text("s", "just words", 10, NULL, 0, &job, &errors), -ERR_INPUT);
    job_free(&job);
    err_list_free(&errors);
}

static void put(const char *path, const char *text) {
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

static void files_are_read_from_beside_the_job(void **state) {
    (void)state;
    char folder[] = "/tmp/goniod-job-XXXXXX", path[64], *text;
    assert_non_null(mkdtemp(folder));
    struct err_list errors = {0};
    struct job_file files[JOB_FILES];
    int n;
    size_t size;
    snprintf(path, sizeof path, "%s/job.yaml", folder);
    assert_true(job_load_files(folder, &text, &size, files, &n, &errors) < 0);
    err_list_free(&errors);
    put(path, good);
    assert_true(job_load_files(path, &text, &size, files, &n, &errors) < 0);
    assert_int_equal(errors.n, 1);
    assert_int_equal(errors.item[0].line, 8); /* names the key that names the missing file */
    err_list_free(&errors);
    put(path, "name: a b\nsamples: [{name: x, size_mm: [60, 40]}]\ngeometry: {pairs: [[1, 1]]}\n"
              "reference: {certificate: ptfe.csv}\n");
    assert_true(job_load_files(path, &text, &size, files, &n, &errors) < 0);
    assert_int_equal(errors.n, 2); /* and what else is wrong with the job */
    err_list_free(&errors);
    put(path, good);
    char beside[80], *certificate = plan_bench_certificate();
    snprintf(beside, sizeof beside, "%s/ptfe.csv", folder);
    put(beside, certificate);
    assert_int_equal(job_load_files(path, &text, &size, files, &n, &errors), 0);
    assert_int_equal(n, 1);
    assert_string_equal(files[0].name, "ptfe.csv");
    assert_string_equal(files[0].text, certificate);
    assert_int_equal(job_read_text(path, text, size, files, n, &job, &errors), 0);
    job_free(&job);
    job_files_free(files, n);
    free(text);
    free(certificate);
    unlink(path);
    unlink(beside);
    rmdir(folder);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_job_is_read_with_its_defaults),
        cmocka_unit_test(ten_mistakes_in_one_pass),
        cmocka_unit_test(contradictions_have_their_place),
        cmocka_unit_test(a_certificate_too_short_or_broken),
        cmocka_unit_test(a_certificate_expires),
        cmocka_unit_test(what_is_no_job_is_refused),
        cmocka_unit_test(files_are_read_from_beside_the_job),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
