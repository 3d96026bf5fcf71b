#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "proto/file.h"

static void a_file_up_to_its_limit(void **state) {
    (void)state;
    char path[] = "/tmp/test_file_XXXXXX";
    int fd = mkstemp(path);
    assert_int_equal(write(fd, "0123456789", 10), 10);
    close(fd);
    struct err e = {0};
    char *text = NULL;
    size_t size = 0;
    assert_int_equal(file_read(path, 10, &text, &size, &e), 0);
    assert_int_equal(size, 10);
    assert_string_equal(text, "0123456789");
    free(text);
    assert_int_equal(file_read(path, 9, &text, &size, &e), -ERR_INPUT);
    assert_string_equal(e.file, path);
    unlink(path);
}

static void what_is_no_file_does_not_block(void **state) {
    (void)state;
    char folder[] = "/tmp/test_file_XXXXXX", pipe_path[64];
    assert_non_null(mkdtemp(folder));
    snprintf(pipe_path, sizeof pipe_path, "%s/pipe", folder);
    assert_int_equal(mkfifo(pipe_path, 0600), 0);
    char *text;
    size_t size;
    struct err e = {0};
    assert_int_equal(file_read(pipe_path, 10, &text, &size, &e), -ERR_INPUT);
    assert_non_null(strstr(e.text, "pipe"));
    err_clear(&e);
    assert_int_equal(file_read(folder, 10, &text, &size, &e), -ERR_INPUT);
    assert_non_null(strstr(e.text, "directory"));
    err_clear(&e);
    unlink(pipe_path);
    assert_int_equal(file_read(pipe_path, 10, &text, &size, &e), -ERR_IO);
    assert_non_null(strstr(e.text, "No such file"));
    rmdir(folder);
}

static void text_is_utf8(void **state) {
    (void)state;
    const char *good[] = {"", "plain\n\ttab\r\n", "\xC3\xA4\xE2\x82\xAC\xF0\x9F\x98\x80"};
    for (size_t i = 0; i < sizeof good / sizeof *good; i++)
        assert_int_equal(file_check_text("f", good[i], strlen(good[i]), NULL), 0);
    const char *bad[] = {"\x80", "\xC0\x80", "\xED\xA0\x80", "\xF4\x90\x80\x80",
                         "\xC3", "\xE2\x82", "\x7F",         "\x1B"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        char text[16];
        struct err e = {0};
        snprintf(text, sizeof text, "a\n\xC3\xA4%s", bad[i]);
        assert_int_equal(file_check_text("f", text, strlen(text), &e), -ERR_INPUT);
        assert_true(e.line == 2 && e.column == 2);
    }
}

/* Vectors of the FNV reference code. */
static void a_hash_is_fnv1a(void **state) {
    (void)state;
    static const char *const text[] = {"", "a", "foobar"}, *const hash[] = {"cbf29ce484222325",
                                                                            "af63dc4c8601ec8c",
                                                                            "85944171f73967e8"};
    for (size_t i = 0; i < 3; i++) {
        char hex[17];
        file_hash(text[i], strlen(text[i]), hex);
        assert_string_equal(hex, hash[i]);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_file_up_to_its_limit),
        cmocka_unit_test(what_is_no_file_does_not_block),
        cmocka_unit_test(text_is_utf8),
        cmocka_unit_test(a_hash_is_fnv1a),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
