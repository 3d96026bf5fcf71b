#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "proto/csv.h"

static const char *const wanted[] = {"lambda_nm", "beta", "note", NULL};

static void notes_names_and_rows(void **state) {
    (void)state;
    const char *text = "\xEF\xBB\xBF# k: 2\r\n  # a remark\r\nbeta, lambda_nm ,\"note\"\r\n\r\n"
                       "0.9,400,\"a, \"\"b\"\"\"\r\n# serial:  X 1 \r\n 1e0 , 405,\r\n";
    struct csv csv;
    struct err_list errors = {0};
    int column[3];
    double v;
    assert_int_equal(csv_parse("t.csv", text, strlen(text), &csv, &errors), 0);
    assert_int_equal(csv.n_rows, 2);
    assert_int_equal(csv_columns(&csv, wanted, 3, column, &errors), 0);
    assert_true(column[0] == 1 && column[1] == 0 && column[2] == 2);
    assert_string_equal(csv.cell[2].text, "a, \"b\"");
    assert_string_equal(csv.cell[5].text, "");
    assert_string_equal(csv_note_find(&csv, "k")->value.text, "2");
    assert_string_equal(csv_note_find(&csv, "serial")->value.text, "X 1");
    assert_null(csv_note_find(&csv, "date"));
    assert_int_equal(csv_number(&csv, &csv.cell[3], "beta", 0, 2, &v, &errors), 0);
    assert_true(v == 1);
    assert_true(csv.cell[4].line == 7 && csv.cell[4].column == 8);
    assert_int_equal(errors.n, 0);
    csv_free(&csv);
}

static void expect(const char *text, int line, int column, const char *part) {
    struct csv csv;
    struct err_list errors = {0};
    assert_int_equal(csv_parse("t.csv", text, strlen(text), &csv, &errors), -ERR_INPUT);
    assert_int_equal(errors.n, 1);
    if (!strstr(errors.item[0].text, part))
        print_error("%s\n", errors.item[0].text);
    assert_non_null(strstr(errors.item[0].text, part));
    assert_int_equal(errors.item[0].line, line);
    assert_int_equal(errors.item[0].column, column);
    err_list_free(&errors);
}

static void broken_tables(void **state) {
    (void)state;
    expect("", 0, 0, "empty");
    expect("# only: notes\n", 0, 0, "empty");
    expect("a,b\n", 0, 0, "no rows");
    expect("a;b\n1;2\n", 1, 1, "separated by ';'");
    expect("a,b\n1,2\n1,2,3\n", 3, 1, "3 cells, but the column names are 2");
    expect("a,b\n1,2\n7\n", 3, 1, "1 cells");
    expect("a,b\n1,\"2\n", 2, 3, "quoted");
    expect("a,b\n1,\"2\"x\n", 2, 3, "quoted");
    expect("a,b\n1,\xFF\n", 2, 3, "0xFF");
}

static void columns_and_numbers_are_judged(void **state) {
    (void)state;
    const char *text = "lamda_nm,beta,beta\n0.5,1,x\n";
    struct csv csv;
    struct err_list errors = {0};
    int column[3];
    double v;
    assert_int_equal(csv_parse("t.csv", text, strlen(text), &csv, &errors), 0);
    assert_int_equal(csv_columns(&csv, wanted, 2, column, &errors), -ERR_INPUT);
    assert_int_equal(csv_number(&csv, &csv.cell[2], "beta", 0, 2, &v, &errors), -ERR_INPUT);
    assert_int_equal(csv_number(&csv, &csv.cell[0], "beta", 0, 0.4, &v, &errors), -ERR_INPUT);
    const char *parts[] = {"unknown column 'lamda_nm'; did you mean 'lambda_nm'?", "a second time",
                           "the column 'lambda_nm' is missing", "must be a number, not 'x'",
                           "beta is 0.5; it must be from 0 to 0.4"};
    assert_int_equal(errors.n, 5);
    for (int i = 0; i < 5; i++)
        assert_non_null(strstr(errors.item[i].text, parts[i]));
    assert_true(errors.item[3].line == 2 && errors.item[3].column == 7);
    err_list_free(&errors);
    csv_free(&csv);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(notes_names_and_rows),
        cmocka_unit_test(broken_tables),
        cmocka_unit_test(columns_and_numbers_are_judged),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
