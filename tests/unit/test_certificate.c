#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "proto/certificate.h"

static const char one[] = "# geometry: 45:0\n# k: 2\n# serial: SRS-99\n# date: 2026-01-31\n"
                          "# valid_until: 2028-02-29\nlambda_nm,beta,u\n700,0.97,0.006\n400,0.99,0.004\n";
static const char table[] = "# geometry: in-plane table\n# k: 1\n# correlation_nm: 50\n"
                            "lambda_nm,beta,u,theta_i_deg,theta_v_deg\n"
                            "400,1.00,0.01,0,0\n700,1.02,0.01,0,0\n400,0.96,0.01,0,60\n700,0.98,0.01,0,60\n"
                            "400,1.10,0.02,60,-30\n700,1.10,0.02,60,-30\n"
                            "400,1.20,0.02,60,60\n700,1.20,0.02,60,60\n";

struct values {
    double beta[BANDS], u[BANDS], used;
    bool covered[BANDS];
};

static void read_good(const char *text, struct certificate *c) {
    struct err_list errors = {0};
    int rc = certificate_read_text("ptfe.csv", text, strlen(text), c, &errors);
    for (size_t i = 0; i < errors.n; i++)
        print_error("%d:%d: %s\n", errors.item[i].line, errors.item[i].column, errors.item[i].text);
    assert_int_equal(rc, 0);
}

static int at(const struct certificate *c, double theta_i_deg, double theta_v_deg, double angular_u_rel,
              struct values *v, struct err *e) {
    return certificate_at(c, theta_i_deg, theta_v_deg, angular_u_rel, v->beta, v->u, v->covered, &v->used, e);
}

static void one_geometry(void **state) {
    (void)state;
    struct certificate c;
    struct values v;
    struct err e = {0};
    read_good(one, &c);
    assert_string_equal(c.serial, "SRS-99");
    assert_string_equal(c.date, "2026-01-31");
    assert_string_equal(c.valid_until, "2028-02-29");
    assert_string_equal(c.text, one);
    assert_int_equal(at(&c, 45.003, -0.002, 0, &v, &e), 0); /* as read back */
    assert_true(v.used == 0);
    assert_true(fabs(v.beta[4] - 0.99) < 1e-15 && fabs(v.u[4] - 0.002) < 1e-15);
    assert_true(fabs(v.beta[34] - 0.98) < 1e-12 && fabs(v.u[34] - 0.0025) < 1e-12); /* 550 nm */
    assert_false(v.covered[3]);
    assert_true(isnan(v.beta[3]));
    assert_true(v.covered[64]);
    assert_false(v.covered[65]);
    assert_int_equal(at(&c, 0, 45, 0, &v, &e), -ERR_RANGE);
    assert_non_null(strstr(e.text, "of theta_i 45, theta_v 0 deg, not of 0, 45"));
    assert_int_equal(at(&c, 0, 45, 0.01, &v, NULL), 0);
    assert_true(v.used == 0.01 && fabs(v.beta[4] - 0.99) < 1e-15);
    certificate_free(&c);
    assert_null(c.row);
}

static void a_table_is_linear_between_its_nodes(void **state) {
    (void)state;
    struct certificate c;
    struct values v;
    struct err e = {0};
    read_good(table, &c);
    assert_true(c.correlation_nm == 50);
    assert_int_equal(at(&c, 0, 30, 0, &v, &e), 0);
    assert_true(fabs(v.beta[4] - 0.98) < 1e-15 && fabs(v.beta[64] - 1.00) < 1e-15);
    assert_int_equal(at(&c, 0, -30, 0, &v, &e), 0); /* at normal incidence sides are one */
    assert_true(fabs(v.beta[4] - 0.98) < 1e-15);
    assert_int_equal(at(&c, 30, 30, 0, &v, &e), 0);
    double at_0 = 0.98, at_60 = 1.10 + 0.1 * 60 / 90;
    assert_true(fabs(v.beta[4] - (at_0 + at_60) / 2) < 1e-15);
    assert_true(fabs(v.u[4] - 0.015) < 1e-15);
    assert_int_equal(at(&c, 60.05, 60.05, 0, &v, &e), 0);
    assert_true(fabs(v.beta[4] - 1.2) < 1e-15);
    certificate_free(&c);
}

static void nothing_is_extrapolated(void **state) {
    (void)state;
    struct certificate c;
    struct values v;
    read_good(table, &c);
    const double outside[][2] = {{60.2, 0}, {60, 60.2}, {60, -30.2}, {30, -40}, {0, 61}};
    for (size_t i = 0; i < sizeof outside / sizeof *outside; i++) {
        struct err e = {0};
        assert_int_equal(at(&c, outside[i][0], outside[i][1], 0, &v, &e), -ERR_RANGE);
        assert_non_null(strstr(e.text, "does not hold"));
    }
    assert_int_equal(at(&c, 75, 70, 0.02, &v, NULL), 0);
    assert_true(v.used == 0.02 && v.beta[4] == 1.2);
    certificate_free(&c);
}

static void an_8di_value_needs_its_angular_u(void **state) {
    (void)state;
    struct certificate c;
    struct values v;
    struct err e = {0};
    read_good("# geometry: 8:di\n# k: 2\nlambda_nm,beta,u\n350,0.98,0.01\n2500,0.95,0.01\n", &c);
    assert_int_equal(at(&c, 8, 0, 0, &v, &e), -ERR_RANGE);
    assert_non_null(strstr(e.text, "8:di"));
    assert_int_equal(at(&c, 45, 0, 0.03, &v, NULL), 0);
    assert_true(v.used == 0.03 && v.covered[0] && v.covered[80]);
    certificate_free(&c);
    read_good("# geometry: 8:di\n# k: 2\nlambda_nm,beta,u\n900,0.98,0.01\n2500,0.95,0.01\n", &c);
    err_clear(&e);
    assert_int_equal(at(&c, 45, 0, 0.03, &v, &e), -ERR_RANGE);
    assert_non_null(strstr(e.text, "covers 900 to 2500 nm"));
    certificate_free(&c);
}

static void all_mistakes_at_once(void **state) {
    (void)state;
    static const struct {
        int line, column;
        const char *part;
    } expected[] = {
        {2, 11, "unknown heading 'serail'; did you mean 'serial'?"},
        {1, 13, "geometry must be theta_i:theta_v"},
        {3, 9, "date must be a date written YYYY-MM-DD, not '2025-02-29'"},
        {0, 0, "the line '# k:' is missing"},
        {6, 1, "lambda_nm is 5; it must be from 100 to 5000"},
        {6, 3, "beta is 98.5; it must be from 0 to 10"},
        {7, 10, "u must be a number, not 'x'"},
    };
    const char *text =
        "# geometry: 95:0\n# serail: 5\n# date: 2025-02-29\n# a remark: free\nlambda_nm,beta,u\n"
        "5,98.5,0.1\n400,0.98,x\n";
    struct certificate c;
    struct err_list errors = {0};
    assert_int_equal(certificate_read_text("c.csv", text, strlen(text), &c, &errors), -ERR_INPUT);
    for (size_t i = 0; i < errors.n; i++)
        if (errors.n != 7 || errors.item[i].line != expected[i].line ||
            errors.item[i].column != expected[i].column || !strstr(errors.item[i].text, expected[i].part))
            print_error("%zu: %d:%d: %s\n", i, errors.item[i].line, errors.item[i].column,
                        errors.item[i].text);
    assert_int_equal(errors.n, 7);
    for (size_t i = 0; i < errors.n; i++) {
        assert_true(errors.item[i].line == expected[i].line && errors.item[i].column == expected[i].column);
        assert_non_null(strstr(errors.item[i].text, expected[i].part));
    }
    err_list_free(&errors);
}

static void expect(const char *text, const char *part) {
    struct certificate c;
    struct err_list errors = {0};
    assert_int_equal(certificate_read_text("c.csv", text, strlen(text), &c, &errors), -ERR_INPUT);
    assert_int_equal(errors.n, 1);
    if (!strstr(errors.item[0].text, part))
        print_error("%s\n", errors.item[0].text);
    assert_non_null(strstr(errors.item[0].text, part));
    err_list_free(&errors);
}

static void single_mistakes(void **state) {
    (void)state;
    expect("", "empty");
    expect("# k: 2\nlambda_nm,beta,u\n400,1,0\n", "'# geometry:' is missing");
    expect("# geometry: 45:0\n# k: 0\nlambda_nm,beta,u\n400,1,0\n", "k is 0");
    expect("# geometry: 45:0\n# k: 1\n# k: 2\nlambda_nm,beta,u\n400,1,0\n",
           "heading 'k' stands here a second");
    expect("# geometry: 45:0\n# k: 1\n# date: 2026-01-02\n# valid_until: "
           "2026-01-01\nlambda_nm,beta,u\n400,1,0\n",
           "valid_until lies before date");
    expect("# geometry: 45:0\n# k: 1\nlambda_nm,beta,u,theta_i_deg,theta_v_deg\n400,1,0,45,0\n",
           "belong to '# geometry: in-plane table'");
    expect("# geometry: in-plane table\n# k: 1\nlambda_nm,beta,u,theta_i_deg\n400,1,0,45\n",
           "the column 'theta_v_deg' is missing");
    expect("# geometry: 45:0\n# k: 1\nlambda_nm,beta,u\n400,1,0\n400,1,0\n", "more than once");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_geometry),
        cmocka_unit_test(a_table_is_linear_between_its_nodes),
        cmocka_unit_test(nothing_is_extrapolated),
        cmocka_unit_test(an_8di_value_needs_its_angular_u),
        cmocka_unit_test(all_mistakes_at_once),
        cmocka_unit_test(single_mistakes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
