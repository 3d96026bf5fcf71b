/* A session that was damaged after it was written: no flipped bit is read as a value. And files of an older goniod. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <fcntl.h>
#include <math.h>
#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "proto/session_linearity.h"
#include "tests/support/seed.h"
#include "tests/support/session_rows.h"

#define FLIPS 400

/* At least one row in every table. */
static void make_session(void) {
    struct session *s = row_fill(row_path, 3);
    struct estimate m;
    struct bracket b = {.number = 1, .open_us = 10, .ended_by = "hold", .last_exposure_id = 3};
    struct linearity l = {.step = 1, .long_id = 1, .short_id = 2, .ratio = 1.0 / 3, .pull = -1};
    struct point_slope slope = {.point_id = 2, .source_per_deg = 0.1, .sample_per_deg = -0.1};
    row_estimate(1, &m);
    ROW_OK(session_add_bracket(s, &b, e));
    ROW_OK(session_add_linearity(s, &l, e));
    ROW_OK(session_add_estimate(s, 7, 3, &m, e));
    ROW_OK(session_add_slopes(s, &slope, 1, e));
    ROW_OK(session_add_event(s, 9, "note", "{\"a\":1}", e));
    ROW_OK(session_add_exchange(s, 1, 2, "rtu:A", "request", 7, "reply", 5, 0, e));
    ROW_OK(session_close(s, e));
}

/* NULL where it cannot be read. */
static char *dump(void) {
    struct session *s;
    char *text = NULL;
    size_t size;
    if (session_open(&s, row_path, true, NULL) < 0)
        return NULL;
    FILE *out = open_memstream(&text, &size);
    int rc = session_dump(s, out, NULL);
    fclose(out);
    session_close(s, NULL);
    if (rc == 0)
        return text;
    free(text);
    return NULL;
}

static size_t things_found; /* by the last found_in */

/* The first thing found, or "". */
static const char *found_in(char text[600]) {
    struct err_list found = {0};
    struct err e = {0};
    int rc = session_verify(row_path, &found, &e);
    things_found = found.n;
    snprintf(text, 600, "%s", rc == 0 ? "" : found.n ? found.item[0].text : e.text);
    err_list_free(&found);
    return text;
}

static void flip(off_t at, int bit) {
    uint8_t byte;
    int fd = open(row_path, O_RDWR);
    assert_int_equal(pread(fd, &byte, 1, at), 1);
    byte ^= (uint8_t)(1 << bit);
    assert_int_equal(pwrite(fd, &byte, 1, at), 1);
    close(fd);
}

static off_t find(const void *bytes, size_t size) {
    static uint8_t file[1 << 20];
    int fd = open(row_path, O_RDONLY);
    ssize_t n = read(fd, file, sizeof file);
    close(fd);
    const uint8_t *at = memmem(file, (size_t)n, bytes, size);
    assert_non_null(at);
    return at - file;
}

static void sql(const char *text) {
    sqlite3 *db;
    assert_int_equal(sqlite3_open(row_path, &db), SQLITE_OK);
    if (sqlite3_exec(db, text, NULL, NULL, NULL) != SQLITE_OK)
        fail_msg("%s: %s", text, sqlite3_errmsg(db));
    sqlite3_close(db);
}

static void a_flipped_bit_of_a_spectrum_is_named(void **state) {
    (void)state;
    char text[600];
    struct exposure x;
    uint16_t counts[ROW_SCANS * ROW_PIXELS];
    make_session();
    assert_string_equal(found_in(text), "");
    row_exposure(2, &x, counts);
    flip(find(counts, 64) + 20, 3);
    if (!strstr(found_in(text), "exposure, id 2: its values do not match their checksum"))
        fail_msg("%s", text);
}

static void a_flipped_letter_of_a_fact_is_named(void **state) {
    (void)state;
    char text[600];
    make_session();
    flip(find("samples: []", 11), 0);
    if (!strstr(found_in(text), "fact, key job: its values do not match"))
        fail_msg("%s", text);
}

static void a_lost_checksum_is_named(void **state) {
    (void)state;
    char text[600];
    make_session();
    sql("DROP TRIGGER event_no_update; UPDATE event SET crc = NULL");
    if (!strstr(found_in(text), "event, id 1: its checksum is missing"))
        fail_msg("%s", text);
}

/* Wherever a bit flips: verify says so, or no value has changed (room that is not in use). */
static void no_flipped_bit_is_read_as_a_value(void **state) {
    (void)state;
    unsigned seed = (unsigned)test_seed((uint64_t)time(NULL));
    make_session();
    struct stat st;
    stat(row_path, &st);
    char *whole = dump(), text[600];
    int n_found = 0;
    for (int k = 0; k < FLIPS; k++) {
        off_t at = (off_t)(((uint64_t)rand_r(&seed) << 15 ^ (uint64_t)rand_r(&seed)) % (uint64_t)st.st_size);
        int bit = rand_r(&seed) % 8;
        flip(at, bit);
        bool found = *found_in(text) != 0;
        char *now = found ? NULL : dump();
        if (!found && (!now || strcmp(now, whole) != 0))
            fail_msg("bit %d of byte %lld changes what is read, and verify does not see it", bit,
                     (long long)at);
        n_found += found;
        free(now);
        flip(at, bit);
    }
    print_message("# %d of %d flips found in %lld bytes; the others changed no value\n", n_found, FLIPS,
                  (long long)st.st_size);
    assert_true(n_found > FLIPS / 8); /* half the pages of so small a session are hardly filled */
    free(whole);
}

static void a_missing_row_is_named(void **state) {
    (void)state;
    char text[600];
    struct session *s;
    make_session();
    ROW_OK(session_open(&s, row_path, false, e));
    ROW_OK(session_add_event(s, 10, "note", "{}", e));
    ROW_OK(session_add_event(s, 11, "note", "{}", e));
    ROW_OK(session_close(s, e));
    sql("DROP TRIGGER event_no_delete; DELETE FROM event WHERE id = 1");
    if (!strstr(found_in(text), "event, id 2: the row before it is missing"))
        fail_msg("%s", text);
    assert_int_equal(things_found, 1); /* nothing is missing before row 3 */
}

static void a_covariance_of_another_size_is_not_known(void **state) {
    (void)state;
    struct session *s;
    struct estimate m;
    make_session();
    sql("DROP TRIGGER estimation_no_update; UPDATE estimation SET statistical = x'0000'");
    ROW_OK(session_open(&s, row_path, true, e));
    ROW_OK(session_last_estimate(s, &m, e));
    assert_true(isnan(m.statistical[0][0]) &&
                !isnan(m.common[0][0])); /* not zero: nothing would be as certain */
    ROW_OK(session_close(s, e));
}

/* What user_version 1 was: no checksums, no linearity. */
static void make_old(void) {
    static const char *const tables[] = {"fact",
                                         "calibration",
                                         "exposure",
                                         "exchange",
                                         "exchange_request",
                                         "event",
                                         "bracket",
                                         "point",
                                         "point_band",
                                         "point_common",
                                         "estimation",
                                         "estimation_parameter",
                                         "estimation_spectrum",
                                         "estimation_warning",
                                         "estimation_point"};
    make_session();
    for (size_t i = 0; i < sizeof tables / sizeof tables[0]; i++) {
        char text[100];
        snprintf(text, sizeof text, "ALTER TABLE %s DROP COLUMN crc", tables[i]);
        sql(text);
    }
    sql("DROP TABLE linearity; DROP TABLE estimation_joint_row; DROP TABLE estimation_joint; "
        "DROP TABLE estimation_instrument; DROP TABLE estimation_quality; DROP TABLE estimation_models; "
        "PRAGMA user_version = 1");
}

static void an_older_file_is_read_and_goes_on(void **state) {
    (void)state;
    char text[600];
    struct session *s;
    make_old();
    char *before = dump();
    assert_non_null(before);
    assert_null(strstr(before, "linearity\t"));
    assert_string_equal(found_in(text), "");
    ROW_OK(session_open(&s, row_path, false, e));
    ROW_OK(session_add_event(s, 10, "resume", "{}", e));
    struct linearity l = {.step = 1, .long_id = 1, .short_id = 2};
    ROW_OK(session_add_linearity(s, &l, e));
    ROW_OK(session_close(s, e));
    assert_string_equal(found_in(text), "");
    char *after = dump();
    assert_non_null(strstr(after, "linearity\tid=1"));
    assert_non_null(strstr(after, "event\tid=2\tat_us=10"));
    flip(find("resume{}", 8), 0); /* new rows have checksums */
    assert_non_null(strstr(found_in(text), "event, id 2"));
    free(before);
    free(after);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, row_setup, row_teardown)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(a_flipped_bit_of_a_spectrum_is_named),
        TEST(a_flipped_letter_of_a_fact_is_named),
        TEST(a_lost_checksum_is_named),
        TEST(no_flipped_bit_is_read_as_a_value),
        TEST(a_missing_row_is_named),
        TEST(a_covariance_of_another_size_is_not_known),
        TEST(an_older_file_is_read_and_goes_on),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
