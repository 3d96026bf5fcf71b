#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "proto/output.h"

static char folder[64], path[128];

static int make_folder(void **state) {
    (void)state;
    snprintf(folder, sizeof folder, "/tmp/test_output_XXXXXX");
    assert_non_null(mkdtemp(folder));
    snprintf(path, sizeof path, "%s/results.csv", folder);
    return 0;
}

static int remove_folder(void **state) {
    (void)state;
    unlink(path);
    return rmdir(folder);
}

static void a_file_that_is_there_stays_as_it_is(void **state) {
    (void)state;
    struct err e = {0};
    FILE *f = output_open(path, &e);
    fputs("measured\n", f);
    assert_int_equal(output_close(f, path, 0, &e), 0);
    assert_null(output_open(path, &e));
    assert_int_equal(e.code, ERR_BUSY);
    assert_non_null(strstr(e.text, "exists already; nothing is overwritten"));
    struct err again = {0};
    assert_int_equal(output_check(path, &again), -ERR_BUSY);
    char text[32] = "";
    f = fopen(path, "r");
    assert_non_null(fgets(text, sizeof text, f));
    fclose(f);
    assert_string_equal(text, "measured\n");
}

static void what_failed_is_removed(void **state) {
    (void)state;
    struct err e = {0};
    FILE *f = output_open(path, &e);
    assert_int_equal(output_check(path, NULL), -ERR_BUSY);
    assert_int_equal(output_close(f, path, -ERR_STATE, &e), -ERR_STATE);
    assert_int_equal(access(path, F_OK), -1);
    assert_int_equal(output_check(path, &e), 0);
    assert_int_equal(access(path, F_OK), -1);
}

static void a_device_is_written_to_and_never_removed(void **state) {
    (void)state;
    struct err e = {0};
    assert_int_equal(mkfifo(path, 0600), 0);
    assert_int_equal(output_check(path, &e), 0);
    assert_int_equal(output_check("/dev/null", &e), 0); /* its folder is not for everyone */
    int reader = open(path, O_RDONLY | O_NONBLOCK);
    FILE *f = output_open(path, &e);
    assert_non_null(f);
    assert_int_equal(output_close(f, path, -ERR_STATE, &e), -ERR_STATE);
    assert_int_equal(access(path, F_OK), 0);
    close(reader);
    f = output_open("/dev/full", &e);
    fputs("x", f);
    assert_int_equal(output_close(f, "/dev/full", 0, &e), -ERR_FULL);
    assert_int_equal(access("/dev/full", F_OK), 0);
}

static void a_folder_that_is_not_there(void **state) {
    (void)state;
    struct err e = {0}, checked = {0};
    assert_null(output_open("/nowhere/x", &e));
    assert_int_equal(e.code, ERR_IO);
    assert_non_null(strstr(e.text, "cannot write /nowhere/x"));
    assert_int_equal(output_check("/nowhere/x", &checked), -ERR_IO);
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, make_folder, remove_folder)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(a_file_that_is_there_stays_as_it_is),
        TEST(what_failed_is_removed),
        TEST(a_device_is_written_to_and_never_removed),
        TEST(a_folder_that_is_not_there),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
