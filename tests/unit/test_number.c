#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <locale.h>

#include "proto/number.h"

static void decimals_in_every_locale(void **state) {
    (void)state;
    const char *locales[] = {"C", "de_DE.UTF-8", "fr_FR.UTF-8"}; /* those not installed change nothing */
    for (int i = 0; i < 3; i++) {
        double v = 0;
        setlocale(LC_ALL, locales[i]);
        assert_true(number_read_double("-12.5e-1", &v) && v == -1.25);
        assert_true(number_read_double("+.5", &v) && v == 0.5);
        assert_true(number_read_double("5.", &v) && v == 5);
        assert_true(number_read_double("0.1", &v) && v == 0.1);
        assert_true(number_read_double("1e-400", &v) && v == 0);
    }
    setlocale(LC_ALL, "C");
}

static void what_is_no_number(void **state) {
    (void)state;
    const char *texts[] = {"",   ".",  "+",    "e5",  "1e",  "1e+",   "0,5",
                           " 1", "1 ", "0x10", "inf", "nan", "1e999", "--1"};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        double v = 7;
        assert_false(number_read_double(texts[i], &v));
        assert_true(v == 7);
    }
}

static void whole_numbers(void **state) {
    (void)state;
    int64_t v = 7;
    const char *wrong[] = {"", "-", "0x", "0xg", "1.0", "1e3", " 1", "9223372036854775808", "0x+1"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        assert_false(number_read_int(wrong[i], &v));
    assert_int_equal(v, 7);
    assert_true(number_read_int("0x2000", &v) && v == 8192);
    assert_true(number_read_int("-0X1f", &v) && v == -31);
    assert_true(number_read_int("+007", &v) && v == 7);
    assert_true(number_read_int("9223372036854775807", &v) && v == INT64_MAX);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(decimals_in_every_locale),
        cmocka_unit_test(what_is_no_number),
        cmocka_unit_test(whole_numbers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
