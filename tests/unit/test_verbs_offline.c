#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <jansson.h>
#include <math.h>
#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "daemon/verbs.h"
#include "fit/points.h"
#include "tests/support/recorded_session.h"
#include "tests/support/session_rows.h"

static int make_session(void **state) {
    row_setup(state);
    recorded_session_make(row_path);
    return 0;
}

struct said {
    int status;
    char *out, *err;
};

static char *read_all(FILE *f) {
    long size = ftell(f);
    char *text = calloc((size_t)size + 1, 1);
    rewind(f);
    assert_int_equal(fread(text, 1, (size_t)size, f), size);
    fclose(f);
    return text;
}

/* Runs a verb with its two streams caught: words[0] is the verb, NULL ends them. */
static struct said run(const char *const *words) {
    struct said said;
    FILE *out = tmpfile(), *err = tmpfile();
    char *argv[12];
    int argc = 0;
    while (words[argc] && argc < 11) {
        argv[argc] = strdup(words[argc]);
        argc++;
    }
    argv[argc] = NULL;
    const struct verb *v = VERBS;
    while (strcmp(v->name, argv[0]) != 0)
        v++;
    fflush(stdout);
    fflush(stderr);
    int keep_out = dup(1), keep_err = dup(2);
    dup2(fileno(out), 1);
    dup2(fileno(err), 2);
    said.status = v->run(argc, argv);
    fflush(stdout);
    fflush(stderr);
    dup2(keep_out, 1);
    dup2(keep_err, 2);
    close(keep_out);
    close(keep_err);
    for (int i = 0; i < argc; i++)
        free(argv[i]);
    fseek(out, 0, SEEK_END);
    fseek(err, 0, SEEK_END);
    said.out = read_all(out);
    said.err = read_all(err);
    return said;
}

#define RUN(...) run((const char *const[]){__VA_ARGS__, NULL})

static void forget(struct said *said) {
    free(said->out);
    free(said->err);
}

static void expect(struct said said, int status, const char *out, const char *err) {
    if (said.status != status || !strstr(said.out, out) || !strstr(said.err, err))
        fail_msg("status %d, '%.300s', '%.300s'; expected %d, '%s', '%s'", said.status, said.out, said.err,
                 status, out, err);
    forget(&said);
}

static int raw_sql(const char *sql) {
    sqlite3 *db;
    assert_int_equal(sqlite3_open(row_path, &db), SQLITE_OK);
    int rc = sqlite3_exec(db, sql, NULL, NULL, NULL);
    sqlite3_close(db);
    return rc;
}

static void show_tells_a_person(void **state) {
    (void)state;
    expect(RUN("show", row_path), 0, "hg60: Hooker's Green on drawing paper, 60 % water", "");
    expect(RUN("show", row_path), 0,
           "origin     goniod 0.1.0, simulated bench of seed 17, as its file says (fnv1a 85944171f73967e8)",
           "");
    expect(RUN("show", row_path), 0, "state      done", "");
    expect(RUN("show", row_path), 0, "6 final, 1 provisional (their bracket is not closed); 3 brackets", "");
    expect(RUN("show", row_path), 0, "1 of them saturated; 7 exchanges", "");
    expect(RUN("show", row_path), 0, "linearity  the diffuser in 60 ms over 15 ms: ratio ", "");
    expect(RUN("show", row_path), 0, "u of the counts at full scale: 0.001 (stated 0.001)", "");
    expect(RUN("show", row_path), 0, "beta_prime", "");
    expect(RUN("show", "nowhere"), 2, "", "there is no session nowhere");
    expect(RUN("show"), 2, "", "show");
    char longest[4096];
    memset(longest, 'x', sizeof longest);
    longest[sizeof longest - 1] = 0;
    expect(RUN("show", longest), 2, "", "at most 500 characters long, not 4095");
}

static void show_as_json(void **state) {
    (void)state;
    struct said said = RUN("show", row_path, "--json");
    json_t *all = json_loads(said.out, 0, NULL);
    assert_int_equal(said.status, 0);
    assert_int_equal(json_integer_value(json_object_get(all, "points_final")), RECORDED_POINTS);
    assert_string_equal(json_string_value(json_object_get(all, "state")), "done");
    json_t *points = json_object_get(all, "points");
    assert_int_equal(json_array_size(points),
                     RECORDED_POINTS + 1); /* one stays provisional: its bracket was cut off */
    assert_true(json_number_value(json_object_get(json_array_get(points, 0), "beta")) > 0.05);
    assert_non_null(json_object_get(all, "estimate"));
    const json_t *linearity = json_object_get(all, "linearity");
    assert_int_equal(json_integer_value(json_object_get(linearity, "short_us")), 15000);
    assert_true(json_is_false(json_object_get(linearity, "beyond")));
    json_decref(all);
    forget(&said);
}

static int count_lines(const char *text, const char *start) {
    int n = 0;
    size_t length = strlen(start);
    for (const char *line = text; line && *line; line = strchr(line, '\n') ? strchr(line, '\n') + 1 : NULL)
        n += strncmp(line, start, length) == 0;
    return n;
}

static void reduce_gives_the_bytes_of_the_dump(void **state) {
    (void)state;
    struct said dump = RUN("show", row_path, "--dump"), reduced = RUN("reduce", row_path);
    assert_int_equal(reduced.status, 0);
    assert_string_equal(reduced.err, "");
    assert_int_equal(count_lines(reduced.out, "point\t"), 2 * RECORDED_POINTS + 1);
    assert_int_equal(count_lines(reduced.out, "bracket\t"), 3);
    assert_int_equal(count_lines(reduced.out, "linearity\t"), 1);
    const char *first = strstr(dump.out, "\nlinearity\t");
    assert_non_null(first);
    const char *after = strstr(dump.out, "\nestimation\t");
    assert_non_null(after);
    size_t length = (size_t)(after - first);
    assert_int_equal(length, strlen(reduced.out));
    assert_memory_equal(first + 1, reduced.out, length);
    forget(&dump);
    forget(&reduced);
}

static void reduce_names_the_first_difference(void **state) {
    (void)state;
    raw_sql("DROP TRIGGER point_band_no_update; UPDATE point_band SET beta = 0.5 WHERE point_id = 3 AND band "
            "= 17");
    expect(RUN("reduce", row_path), 1, "point_band",
           "point_band point_id=3 band=17: stored beta=0.5, derived beta=0.195");
    expect(RUN("reduce", row_path, "--json"), 1, "\"same\":false", "");
    raw_sql(
        "DROP TRIGGER point_band_no_delete; DELETE FROM point_band WHERE point_id = 13; DROP TRIGGER "
        "point_common_no_delete; DELETE FROM point_common WHERE point_id = 13; DROP TRIGGER point_no_delete; "
        "DELETE FROM point WHERE id = 13");
    expect(RUN("reduce", row_path), 1, "", "point id=13: derived, but not stored");
}

static void reduce_says_what_it_misses(void **state) {
    (void)state;
    raw_sql("DROP TRIGGER fact_no_delete; DELETE FROM fact WHERE key = 'reduce_setup'");
    expect(RUN("reduce", row_path), 1, "", "holds no 'reduce_setup'");
}

static void verify_and_copy(void **state) {
    (void)state;
    char copy[120];
    snprintf(copy, sizeof copy, "%s/copy.gonio", row_folder);
    expect(RUN("verify", row_path), 0, "sound", "");
    expect(RUN("copy", row_path, copy), 0, "", "");
    expect(RUN("copy", row_path, copy), 1, "", "exists already");
    expect(RUN("verify", "copy", "--sessions", row_folder), 0, "sound", "");
    expect(RUN("reduce", copy), 0, "point", "");
    raw_sql("DROP TRIGGER exposure_no_update; UPDATE exposure SET settled_us = end_us WHERE id = 4");
    expect(RUN("verify", row_path), 1, "exposure 4: settled < start < end", "");
    expect(RUN("verify", row_path, "--json"), 1, "\"sound\":false", "");
}

static void sessions_are_listed_with_what_is_wrong(void **state) {
    (void)state;
    char other[120];
    snprintf(other, sizeof other, "%s/broken.gonio", row_folder);
    FILE *f = fopen(other, "w");
    fputs("not a session", f);
    fclose(f);
    expect(RUN("sessions", "--sessions", row_folder), 0, "test.gonio", "");
    expect(RUN("sessions", "--sessions", row_folder), 0, "7 points", "");
    expect(RUN("sessions", "--sessions", row_folder), 0, "1 of them provisional", "");
    expect(RUN("sessions", "--sessions", row_folder), 0, "not a goniod session", "");
    struct said said = RUN("sessions", "--sessions", row_folder, "--json");
    json_t *all = json_loads(said.out, 0, NULL);
    assert_int_equal(json_array_size(json_object_get(all, "sessions")), 2);
    json_decref(all);
    forget(&said);
    expect(RUN("sessions", "--sessions", "/nowhere"), 2, "", "cannot be read");
}

static char *exported(const char *format, const char *extra) {
    char name[120];
    snprintf(name, sizeof name, "%s/export", row_folder);
    remove(name);
    expect(RUN("export", row_path, "--format", format, "-o", name, extra), 0, "", "");
    FILE *f = fopen(name, "rb");
    fseek(f, 0, SEEK_END);
    return read_all(f);
}

static void csv_is_what_goniofit_reads(void **state) {
    (void)state;
    char *text = exported("csv", NULL);
    assert_int_equal(strncmp(text, "theta_i_deg,theta_v_deg,beta,u_beta,u_ind,u_common_rel\n", 55), 0);
    double i, v, beta, u_beta, u_ind, u_common;
    const char *line = strchr(text, '\n') + 1;
    assert_int_equal(sscanf(line, "%lf,%lf,%lf,%lf,%lf,%lf", &i, &v, &beta, &u_beta, &u_ind, &u_common), 6);
    assert_true(i == 15 && v == -30 && beta > 0.1 && beta < 0.3);
    assert_true(u_beta > u_ind && fabs(u_common - 0.005) < 1e-9);
    assert_true(u_beta * u_beta > u_ind * u_ind + u_common * u_common * beta * beta);
    assert_int_equal(count_lines(text, ""), 1 + RECORDED_POINTS);
    free(text);
    text = exported("csv", "--spectrum");
    assert_non_null(strstr(text, ",beta_550nm,u_550nm,"));
    free(text);
}

static void astm_has_radians_and_brdf(void **state) {
    (void)state;
    char *text = exported("astm", NULL);
    assert_non_null(strstr(text, "SAMPLE_ID \"hg60\""));
    assert_non_null(strstr(text, "NUM_POINTS 6\nVARS theta_i,phi_i,theta_s,phi_s,BRDF_380nm,"));
    assert_non_null(strstr(text, "\n0.261799388,0,0.523598776,3.141592654,"));
    assert_non_null(strstr(text, "\n0.261799388,0,0.523598776,0.000000000,"));
    free(text);
}

/* The other way round: what was exported as .astm is what was exported as CSV, but for the digits of the text. */
static void astm_reads_back(void **state) {
    (void)state;
    struct fitset csv, astm;
    struct points_report report;
    struct points_options none = {0};
    struct err_list errors = {0};
    char name[120];
    free(exported("csv", "--spectrum"));
    snprintf(name, sizeof name, "%s/export", row_folder);
    fitset_init(&csv);
    assert_int_equal(points_read(name, &none, &csv, &report, &errors), 0);
    free(exported("astm", NULL));
    fitset_init(&astm);
    assert_int_equal(points_read(name, &none, &astm, &report, &errors), 0);
    assert_string_equal(report.format, "astm");
    assert_non_null(strstr(report.azimuth, "180 deg (as the file states)"));
    assert_int_equal(astm.n, csv.n);
    assert_int_equal(csv.n, RECORDED_POINTS);
    for (size_t i = 0; i < csv.n; i++) {
        assert_float_equal(astm.theta_i_deg[i], csv.theta_i_deg[i], 1e-7);
        assert_float_equal(astm.theta_v_deg[i], csv.theta_v_deg[i], 1e-7);
        assert_float_equal(astm.beta[i], csv.beta[i], 6e-9 * fabs(csv.beta[i]));
        for (int b = 0; b < BANDS; b++) {
            double there = csv.bands[i * BANDS + (size_t)b], here = astm.bands[i * BANDS + (size_t)b];
            assert_true(isnan(there) ? isnan(here) : fabs(here - there) <= 6e-9 * fabs(there));
        }
    }
    fitset_free(&csv);
    fitset_free(&astm);
}

static void bad_exports_are_refused(void **state) {
    (void)state;
    expect(RUN("export", row_path, "--format", "xls", "-o", "/dev/null"), 2, "", "csv, astm or pcapng");
    expect(RUN("export", row_path, "--format", "csv"), 2, "", "-o FILE");
    expect(RUN("export", row_path, "--format", "csv", "-o", "/nowhere/x"), 1, "", "cannot write /nowhere/x");
}

/* A slip of the finger names the session itself, or a job: it is still there, and whole. */
static void an_export_overwrites_nothing(void **state) {
    (void)state;
    static const char *const formats[] = {"csv", "astm", "pcapng"};
    for (int i = 0; i < 3; i++)
        expect(RUN("export", row_path, "--format", formats[i], "-o", row_path), 1, "",
               "nothing is overwritten");
    expect(RUN("verify", row_path), 0, "sound", "");
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, make_session, row_teardown)

/* --make FILE: a session for tests/wire/test_pcapng.py. --verb ...: one verb, as gonioctl runs it. */
int main(int argc, char **argv) {
    if (argc == 3 && strcmp(argv[1], "--make") == 0) {
        recorded_session_make(argv[2]);
        return 0;
    }
    if (argc > 2 && strcmp(argv[1], "--verb") == 0) {
        const struct verb *v = VERBS;
        while (v->name && strcmp(v->name, argv[2]) != 0)
            v++;
        return v->name ? v->run(argc - 2, argv + 2) : 2;
    }
    const struct CMUnitTest tests[] = {
        TEST(show_tells_a_person),
        TEST(show_as_json),
        TEST(reduce_gives_the_bytes_of_the_dump),
        TEST(reduce_names_the_first_difference),
        TEST(reduce_says_what_it_misses),
        TEST(verify_and_copy),
        TEST(sessions_are_listed_with_what_is_wrong),
        TEST(csv_is_what_goniofit_reads),
        TEST(astm_has_radians_and_brdf),
        TEST(astm_reads_back),
        TEST(bad_exports_are_refused),
        TEST(an_export_overwrites_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
