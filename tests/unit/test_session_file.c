#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <fcntl.h>
#include <signal.h>
#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/support/session_rows.h"

static void closing_leaves_one_file(void **state) {
    (void)state;
    struct session *s = row_fill(row_path, 3);
    char name[120];
    snprintf(name, sizeof name, "%s-wal", row_path);
    assert_int_equal(access(name, F_OK), 0);
    ROW_OK(session_close(s, e));
    static const char *const tails[] = {"-wal", "-shm", "-lock", "-journal"};
    for (int i = 0; i < 4; i++) {
        snprintf(name, sizeof name, "%s%s", row_path, tails[i]);
        assert_int_not_equal(access(name, F_OK), 0);
    }
    assert_int_equal(session_create(&s, row_path, NULL), -ERR_BUSY);
}

static int count_point(void *arg, const struct point *p) {
    (void)p;
    ++*(int *)arg;
    return 0;
}

static void a_reader_sees_a_live_writer_and_a_second_writer_is_refused(void **state) {
    (void)state;
    struct session *s = row_fill(row_path, 2), *reader, *other;
    struct err e = {0};
    assert_int_equal(session_open(&other, row_path, false, &e), -ERR_BUSY);
    assert_non_null(strstr(e.text, "another goniod"));
    ROW_OK(session_open(&reader, row_path, true, e));
    int n = 0;
    ROW_OK(session_each_point(reader, true, count_point, &n, e));
    assert_int_equal(n, 2);
    struct point p;
    row_point(3, 1, &p);
    ROW_OK(session_begin(s, e));
    ROW_OK(session_add_point(s, &p, e));
    n = 0;
    ROW_OK(session_each_point(reader, true, count_point, &n, e));
    assert_int_equal(n, 2);
    ROW_OK(session_commit(s, e));
    n = 0;
    ROW_OK(session_each_point(reader, true, count_point, &n, e));
    assert_int_equal(n, 3);
    assert_int_equal(session_add_point(reader, &p, NULL), -ERR_STATE);
    ROW_OK(session_close(reader, e));
    ROW_OK(session_close(s, e));
}

/* Another program's hands on the file, with nothing of ours in between. */
static int raw_sql(const char *sql) {
    sqlite3 *db;
    assert_int_equal(sqlite3_open(row_path, &db), SQLITE_OK);
    int rc = sqlite3_exec(db, sql, NULL, NULL, NULL);
    sqlite3_close(db);
    return rc;
}

static void tables_are_insert_only(void **state) {
    (void)state;
    ROW_OK(session_close(row_fill(row_path, 2), e));
    assert_int_equal(raw_sql("UPDATE point SET mean = 1"), SQLITE_CONSTRAINT);
    assert_int_equal(raw_sql("DELETE FROM exposure WHERE id = 2"), SQLITE_CONSTRAINT);
    assert_int_equal(raw_sql("UPDATE fact SET value = 'x'"), SQLITE_CONSTRAINT);
    assert_int_equal(raw_sql("INSERT INTO event VALUES (NULL, 1, 'note', '', NULL)"), SQLITE_OK);
}

static void a_final_point_supersedes_its_provisional_one_once(void **state) {
    (void)state;
    struct session *s = row_fill(row_path, 2);
    struct point p;
    row_point(1, 1, &p);
    p.provisional = false;
    p.supersedes = 1;
    ROW_OK(session_add_point(s, &p, e));
    assert_int_equal(p.id, 3);
    assert_int_equal(session_add_point(s, &p, NULL), -ERR_STATE);
    p.supersedes = 99;
    assert_int_equal(session_add_point(s, &p, NULL), -ERR_STATE);
    p.supersedes = 2;
    p.exposure_id = 99;
    assert_int_equal(session_add_point(s, &p, NULL), -ERR_STATE);
    int all = 0, standing = 0;
    ROW_OK(session_each_point(s, true, count_point, &all, e));
    ROW_OK(session_each_point(s, false, count_point, &standing, e));
    assert_int_equal(all, 3);
    assert_int_equal(standing, 2);
    ROW_OK(session_close(s, e));
}

static void a_failed_row_spoils_its_transaction(void **state) {
    (void)state;
    struct session *s = row_fill(row_path, 1);
    struct point p;
    ROW_OK(session_begin(s, e));
    row_point(2, 1, &p);
    ROW_OK(session_add_point(s, &p, e));
    p.exposure_id = 99;
    assert_int_equal(session_add_point(s, &p, NULL), -ERR_STATE);
    assert_int_equal(session_add_event(s, 1, "note", "", NULL), -ERR_STATE);
    assert_int_equal(session_commit(s, NULL), -ERR_STATE);
    int n = 0;
    ROW_OK(session_each_point(s, true, count_point, &n, e));
    assert_int_equal(n, 1);
    ROW_OK(session_close(s, e));
}

static void an_exposure_out_of_order_is_refused(void **state) {
    (void)state;
    struct session *s = row_fill(row_path, 0);
    uint16_t counts[ROW_SCANS * ROW_PIXELS];
    struct exposure x;
    struct err e = {0};
    row_exposure(1, &x, counts);
    x.start_us = x.settled_us;
    assert_int_equal(session_add_exposure(s, &x, &e), -ERR_STATE);
    assert_non_null(strstr(e.text, "settled"));
    x.kind = EXPOSURE_DARK;
    ROW_OK(session_add_exposure(s, &x, e));
    x.end_us = x.start_us;
    assert_int_equal(session_add_exposure(s, &x, NULL), -ERR_STATE);
    ROW_OK(session_close(s, e));
}

/* A limit on the size of files stands in for the full disk: the kernel refuses the same write. */
static void write_until_full(void) {
    struct session *s = row_fill(row_path, 20);
    struct rlimit limit = {60000, 60000};
    signal(SIGXFSZ, SIG_IGN);
    struct stat st;
    char log[120];
    snprintf(log, sizeof log, "%s-wal", row_path);
    stat(log, &st);
    limit.rlim_cur = (rlim_t)st.st_size + 200000;
    limit.rlim_max = RLIM_INFINITY;
    setrlimit(RLIMIT_FSIZE, &limit);
    struct err e = {0};
    int rc = 0, stored = 20;
    uint16_t counts[ROW_SCANS * ROW_PIXELS];
    while (rc == 0 && stored < 10000) {
        struct exposure x;
        struct point p;
        row_exposure(stored + 1, &x, counts);
        rc = session_begin(s, &e);
        if (rc == 0)
            rc = session_add_exposure(s, &x, &e);
        row_point(stored + 1, x.id, &p);
        if (rc == 0)
            rc = session_add_point(s, &p, &e);
        if (rc == 0)
            rc = session_commit(s, &e);
        stored += rc == 0;
    }
    if (rc != -ERR_FULL || !strstr(e.text, "no space"))
        _exit(1);
    session_rollback(s);
    int n = 0;
    session_each_point(s, true, count_point, &n, NULL);
    if (n != stored)
        _exit(2);
    limit.rlim_cur = RLIM_INFINITY;
    setrlimit(RLIMIT_FSIZE, &limit);
    struct exposure x;
    row_exposure(stored + 1, &x, counts);
    if (session_add_exposure(s, &x, NULL) != 0 || x.id != stored + 1 || session_close(s, NULL) != 0)
        _exit(3);
    _exit(0);
}

static void a_full_disk_loses_no_committed_row(void **state) {
    (void)state;
    pid_t child = fork();
    if (child == 0)
        write_until_full();
    int status;
    waitpid(child, &status, 0);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
    struct err_list found = {0};
    ROW_OK(session_verify(row_path, &found, e));
    err_list_free(&found);
}

static void expect_refused(int code, const char *word) {
    struct session *s;
    struct err e = {0};
    assert_int_equal(session_open(&s, row_path, true, &e), -code);
    if (!strstr(e.text, word))
        fail_msg("'%s' does not say '%s'", e.text, word);
}

static void write_file(const void *bytes, size_t size) {
    FILE *f = fopen(row_path, "wb");
    assert_non_null(f);
    fwrite(bytes, 1, size, f);
    fclose(f);
}

static void foreign_and_broken_files_are_named(void **state) {
    (void)state;
    expect_refused(ERR_IO, "No such file");
    write_file("", 0);
    expect_refused(ERR_INPUT, "empty");
    char noise[5000];
    for (size_t i = 0; i < sizeof noise; i++)
        noise[i] = (char)(i * 2654435761u >> 13);
    write_file(noise, sizeof noise);
    expect_refused(ERR_INPUT, "not a goniod session");
    unlink(row_path);
    assert_int_equal(raw_sql("CREATE TABLE other (x)"), SQLITE_OK);
    expect_refused(ERR_INPUT, "another program");
    unlink(row_path);
    mkdir(row_path, 0755);
    expect_refused(ERR_INPUT, "not a file");
    rmdir(row_path);
    ROW_OK(session_close(row_fill(row_path, 5), e));
    struct stat st;
    stat(row_path, &st);
    assert_int_equal(truncate(row_path, st.st_size / 2), 0);
    expect_refused(ERR_INPUT, "truncated");
    unlink(row_path);
    ROW_OK(session_close(row_fill(row_path, 1), e));
    assert_int_equal(raw_sql("PRAGMA user_version = 99"), SQLITE_OK);
    expect_refused(ERR_INPUT, "newer goniod");
}

static void network_file_systems_are_known(void **state) {
    (void)state;
    assert_string_equal(session_network_filesystem(0x6969), "NFS");
    assert_string_equal(session_network_filesystem(0xFF534D42), "CIFS");
    assert_string_equal(session_network_filesystem(0xFFFFFFFFFF534D42),
                        "CIFS"); /* f_type is signed on some */
    assert_string_equal(session_network_filesystem(0x65735546), "FUSE");
    assert_null(session_network_filesystem(0xEF53));     /* ext4 */
    assert_null(session_network_filesystem(0x01021994)); /* tmpfs */
    assert_null(session_network_filesystem(0x794C7630)); /* overlay */
}

static char *dump_text(const char *file) {
    struct session *s;
    char *text;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    ROW_OK(session_open(&s, file, true, e));
    ROW_OK(session_dump(s, out, e));
    ROW_OK(session_close(s, e));
    fclose(out);
    return text;
}

static void a_copy_of_a_live_session_is_whole(void **state) {
    (void)state;
    struct session *s = row_fill(row_path, 5);
    char copy[120];
    snprintf(copy, sizeof copy, "%s/copy.gonio", row_folder);
    ROW_OK(session_copy(row_path, copy, e));
    assert_int_equal(session_copy(row_path, copy, NULL), -ERR_BUSY);
    char *a = dump_text(row_path), *b = dump_text(copy);
    assert_string_equal(a, b);
    assert_non_null(strstr(a, "fact\tkey=job\tvalue=name: test\\nsamples: []\\t# tab\\n\n"));
    assert_non_null(strstr(a, "theta_v_udeg=-20000001"));
    assert_non_null(strstr(a, "u_ind=0.00050000000000000001"));
    free(a);
    free(b);
    ROW_OK(session_close(s, e));
    struct err_list found = {0};
    ROW_OK(session_verify(copy, &found, e));
    char name[140];
    snprintf(name, sizeof name, "%s-wal", copy);
    assert_int_not_equal(access(name, F_OK), 0);
    err_list_free(&found);
}

static void verify_finds(const char *sql, const char *word) {
    struct err_list found = {0};
    ROW_OK(session_close(row_fill(row_path, 4), e));
    assert_int_equal(session_verify(row_path, &found, NULL), 0);
    assert_int_equal(raw_sql(sql), SQLITE_OK);
    assert_int_equal(session_verify(row_path, &found, NULL), -ERR_INPUT);
    if (!strstr(found.item[0].text, word))
        fail_msg("'%s' does not say '%s'", found.item[0].text, word);
    err_list_free(&found);
    unlink(row_path);
}

/* Start and end of a set are bounds: of two sets in one state they may cross. */
static void sets_of_one_state_may_overlap_by_their_bounds(void **state) {
    (void)state;
    struct err_list found = {0};
    ROW_OK(session_close(row_fill(row_path, 4), e));
    assert_int_equal(
        raw_sql(
            "DROP TRIGGER fact_no_update; UPDATE fact SET crc = NULL;" /* an older file: rows may lack theirs */
            "DROP TRIGGER exposure_no_update; UPDATE exposure SET (settled_us, lamp, "
            "exposure_us, start_us, crc)"
            " = (SELECT settled_us, lamp, exposure_us, end_us - 1, NULL FROM exposure WHERE "
            "id = 2) WHERE id = 3"),
        SQLITE_OK);
    ROW_OK(session_verify(row_path, &found, e));
    err_list_free(&found);
}

static void a_calibration_that_would_be_read_past_its_end_is_refused(void **state) {
    (void)state;
    struct calibration c;
    struct session *s;
    ROW_OK(session_close(row_fill(row_path, 2), e));
    assert_int_equal(
        raw_sql("DROP TRIGGER calibration_no_update; UPDATE calibration SET nonlinearity_order = 1000"),
        SQLITE_OK);
    ROW_OK(session_open(&s, row_path, true, e));
    assert_int_equal(session_get_calibration(s, &c, NULL), -ERR_INPUT);
    ROW_OK(session_close(s, e));
}

static void verify_finds_what_was_tampered_with(void **state) {
    (void)state;
    verify_finds("DROP TRIGGER exposure_no_update; UPDATE exposure SET start_us = settled_us WHERE id = 2",
                 "exposure 2: settled < start < end");
    verify_finds("DROP TRIGGER exposure_no_update; UPDATE exposure SET end_us = 9000000 WHERE id = 2",
                 "exposure 2: the next one begins");
    verify_finds("DROP TRIGGER exposure_no_update; UPDATE exposure SET settled_us = (SELECT end_us FROM "
                 "exposure WHERE "
                 "id = 2) WHERE id = 3",
                 "exposure 2: the stage moved before it ended");
    verify_finds("DROP TRIGGER exposure_no_delete; DELETE FROM exposure WHERE id = 3",
                 "its exposure is missing");
    verify_finds(
        "INSERT INTO point SELECT NULL, 1, 1, 2, bracket, tau_us, tau_r_us, theta_i_udeg, theta_v_udeg, "
        "saturated, scan_f, noisy, mean, mean_u_ind, mean_u_common, NULL FROM point WHERE id = 1",
        "supersedes");
    verify_finds(
        "INSERT INTO point SELECT NULL, NULL, 1, 2, bracket, tau_us, tau_r_us, theta_i_udeg, theta_v_udeg, "
        "saturated, scan_f, noisy, mean, mean_u_ind, mean_u_common, NULL FROM point WHERE id = 1",
        "2 points stand");
    verify_finds("DROP TRIGGER point_no_update; UPDATE point SET provisional = 0 WHERE id = 1",
                 "never closed");
    verify_finds("DROP TRIGGER exposure_no_update; UPDATE exposure SET counts = x'00' WHERE id = 1",
                 "spectra");
}

static void damage_inside_is_found(void **state) {
    (void)state;
    ROW_OK(session_close(row_fill(row_path, 40), e));
    int fd = open(row_path, O_RDWR);
    char noise[3000];
    memset(noise, 0xA5, sizeof noise);
    assert_int_equal(pwrite(fd, noise, sizeof noise, 4096 * 12), sizeof noise);
    close(fd);
    struct err_list found = {0};
    assert_int_equal(session_verify(row_path, &found, NULL), -ERR_INPUT);
    err_list_free(&found);
}

#define NOBODY 65534

/* Root may read everything, so the reader is nobody. */
static int read_as_nobody(void) {
    struct session *s;
    struct err e = {0};
    if (geteuid() == 0 && setuid(NOBODY) < 0)
        return 3;
    int rc = session_open(&s, row_path, true, &e);
    if (rc == 0)
        return 2;
    return rc == -ERR_PERMISSION && strstr(e.text, "cut off") ? 0 : 1;
}

static void a_cut_off_session_without_rights_says_so(void **state) {
    (void)state;
    char shared[120];
    pid_t child = fork();
    if (child == 0) {
        row_fill(row_path, 3);
        _exit(0); /* without closing: the log stays */
    }
    int status;
    waitpid(child, &status, 0);
    snprintf(shared, sizeof shared, "%s-shm", row_path);
    assert_int_equal(unlink(shared), 0);
    chmod(row_folder, 0555);
    child = fork();
    if (child == 0)
        _exit(read_as_nobody());
    waitpid(child, &status, 0);
    chmod(row_folder, 0755);
    assert_int_equal(WEXITSTATUS(status), 0);
    struct session *s;
    ROW_OK(session_open(&s, row_path, false, e));
    ROW_OK(session_close(s, e));
}

static void a_reader_does_not_stop_the_close(void **state) {
    (void)state;
    struct session *s = row_fill(row_path, 3), *reader;
    ROW_OK(session_open(&reader, row_path, true, e));
    ROW_OK(session_close(s, e));
    int n = 0;
    ROW_OK(session_each_point(reader, true, count_point, &n, e));
    assert_int_equal(n, 3);
    ROW_OK(session_close(reader, e));
    ROW_OK(session_open(&s, row_path, false, e));
    ROW_OK(session_close(s, e));
    char log[120];
    snprintf(log, sizeof log, "%s-wal", row_path);
    assert_int_not_equal(access(log, F_OK), 0);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, row_setup, row_teardown)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(closing_leaves_one_file),
        TEST(a_reader_sees_a_live_writer_and_a_second_writer_is_refused),
        TEST(tables_are_insert_only),
        TEST(a_final_point_supersedes_its_provisional_one_once),
        TEST(a_failed_row_spoils_its_transaction),
        TEST(an_exposure_out_of_order_is_refused),
        TEST(a_full_disk_loses_no_committed_row),
        TEST(foreign_and_broken_files_are_named),
        TEST(network_file_systems_are_known),
        TEST(a_copy_of_a_live_session_is_whole),
        TEST(sets_of_one_state_may_overlap_by_their_bounds),
        TEST(a_calibration_that_would_be_read_past_its_end_is_refused),
        TEST(verify_finds_what_was_tampered_with),
        TEST(damage_inside_is_found),
        TEST(a_cut_off_session_without_rights_says_so),
        TEST(a_reader_does_not_stop_the_close),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
