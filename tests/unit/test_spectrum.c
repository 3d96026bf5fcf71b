#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "proto/spectrum.h"

static int read_text(const char *text, struct spectrum *s, struct err_list *errors) {
    return spectrum_read_text("s.csv", text, strlen(text), s, errors);
}

static void a_file_on_the_bands_is_taken_as_it_is(void **state) {
    (void)state;
    char text[4096] = "lambda_nm,value\n";
    for (int k = BANDS - 1; k >= 0; k--) /* any order */
        snprintf(text + strlen(text), 40, "%d,%.17g\n", band_nm(k), 0.1 + sin(k));
    struct spectrum s;
    struct err_list errors = {0};
    assert_int_equal(read_text(text, &s, &errors), 0);
    for (int k = 0; k < BANDS; k++)
        assert_true(s.covered[k] && s.value[k] == 0.1 + sin(k));
}

static void between_nodes_linear_outside_nothing(void **state) {
    (void)state;
    struct spectrum s;
    struct err_list errors = {0};
    assert_int_equal(read_text("value,lambda_nm\n0.2,402\n0.4,412\n", &s, &errors), 0);
    assert_false(s.covered[4]); /* 400 nm */
    assert_true(isnan(s.value[4]));
    assert_true(fabs(s.value[5] - 0.26) < 1e-15 && fabs(s.value[6] - 0.36) < 1e-15);
    assert_false(s.covered[7]); /* 415 nm */
}

static void mistakes_have_places(void **state) {
    (void)state;
    struct spectrum s;
    struct err_list errors = {0};
    assert_int_equal(read_text("lambda_nm,value\n400,1\n405,x\n5,1\n", &s, &errors), -ERR_INPUT);
    assert_int_equal(errors.n, 2);
    assert_true(errors.item[0].line == 3 && errors.item[0].column == 5);
    assert_true(errors.item[1].line == 4 && errors.item[1].column == 1);
    assert_int_equal(read_text("lambda_nm,value\n400,1\n400.0,2\n", &s, &errors), -ERR_INPUT);
    assert_string_equal(errors.item[2].text, "400 nm stands here a second time; first in line 2");
    assert_int_equal(spectrum_read_file("/nonexistent", &s, &errors), -ERR_IO);
    err_list_free(&errors);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_file_on_the_bands_is_taken_as_it_is),
        cmocka_unit_test(between_nodes_linear_outside_nothing),
        cmocka_unit_test(mistakes_have_places),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
