#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <errno.h>
#include <string.h>

#include "proto/err.h"

static void first_cause_wins(void **state) {
    (void)state;
    struct err e = {0};
    assert_int_equal(err_at(&e, ERR_INPUT, "job.yaml", 3, 7, "unknown key '%s'", "hodler"), -ERR_INPUT);
    assert_int_equal(err_set(&e, ERR_IO, "could not read the job"), -ERR_IO);
    char text[600];
    assert_string_equal(err_format(&e, text, sizeof text), "job.yaml:3:7: unknown key 'hodler'");
    assert_int_equal(e.code, ERR_INPUT);
}

static void errno_is_kept_and_named(void **state) {
    (void)state;
    struct err e = {0};
    err_errno(&e, ERR_IO, ENOENT, "cannot open %s", "a.gonio");
    assert_int_equal(e.saved_errno, ENOENT);
    assert_string_equal(e.text, "cannot open a.gonio: No such file or directory");
    assert_int_equal(err_set(NULL, ERR_IO, "nobody listens"), -ERR_IO);
}

static void a_list_grows(void **state) {
    (void)state;
    struct err_list list = {0};
    for (int i = 0; i < 100; i++) {
        struct err e = {0};
        err_at(&e, ERR_INPUT, "f", i + 1, 0, "mistake %d", i);
        assert_int_equal(err_list_add(&list, &e), 0);
    }
    assert_int_equal(list.n, 100);
    assert_int_equal(list.item[99].line, 100);
    err_list_free(&list);
    assert_null(list.item);
}

static void mistake(struct err_list *list, const char *file, int line, const char *format, ...) {
    va_list ap;
    va_start(ap, format);
    assert_int_equal(err_list_mistake(list, file, line, 5, format, ap), -ERR_INPUT);
    va_end(ap);
}

static void one_bad_file_leaves_room_for_the_next(void **state) {
    (void)state;
    struct err_list list = {0};
    char text[600];
    for (int i = 1; i <= 3 * ERR_LIST_OF_FILE; i++)
        mistake(&list, "a.astm", i, "mistake %d", i);
    mistake(&list, "b.astm", 7, "%s is no number", "'x'");
    assert_int_equal(list.n, ERR_LIST_OF_FILE + 1);
    assert_string_equal(err_format(&list.item[ERR_LIST_OF_FILE], text, sizeof text),
                        "b.astm:7:5: 'x' is no number");
    err_list_free(&list);
}

static void every_code_has_a_name(void **state) {
    (void)state;
    for (int code = 0; code < ERR_CODES; code++)
        assert_true(strlen(err_name(-code)) > 1);
    assert_string_equal(err_name(999), "unknown");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(first_cause_wins),      cmocka_unit_test(errno_is_kept_and_named),
        cmocka_unit_test(a_list_grows),          cmocka_unit_test(one_bad_file_leaves_room_for_the_next),
        cmocka_unit_test(every_code_has_a_name),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
