#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/brdf.h"
#include "tests/support/skipping.h"

static void geometries_and_sides(void **state) {
    (void)state;
    const char *text = "# a surface\n2\n# wls\n400 500\n"
                       "0.5 0 0.25 3.141593  0.1 0.2\n" /* mirror side */
                       "0.5 0 0.25 -3.141593 0.1\n 0.2 # wrapped\n"
                       "0.5 0 0.25 0 0 -0.001\n"     /* back towards the source */
                       "0.5 1 0.25 2.5 1 1\n"        /* out of plane */
                       "0.5 -2 0.25 4.283185 1 1\n"; /* 2 pi apart: backscatter */
    struct brdf b;
    struct err e = {0};
    int rc = brdf_read_text("t.brdf", text, strlen(text), &b, &e);
    if (rc != 0)
        print_error("%d:%d %s\n", e.line, e.column, e.text);
    assert_int_equal(rc, 0);
    assert_int_equal(b.n, 5);
    assert_int_equal(b.n_lambda, 2);
    double view = 0.25 * 180 / M_PI, back[] = {view, view, -view, NAN, -view};
    for (int i = 0; i < 5; i++) {
        assert_int_equal(b.geometry[i].in_plane, i != 3);
        assert_true(fabs(b.geometry[i].theta_i_deg - 0.5 * 180 / M_PI) < 1e-12);
        assert_true(i == 3 ? isnan(b.geometry[i].theta_v_deg)
                           : fabs(b.geometry[i].theta_v_deg - back[i]) < 1e-12);
    }
    assert_true(fabs(b.geometry[3].delta_phi_deg - 1.5 * 180 / M_PI) < 1e-12);
    assert_true(b.beta[1] == M_PI * 0.2 && b.beta[4] == 0 && b.beta[5] == M_PI * -0.001);
    brdf_free(&b);
}

static void expect(const char *text, int line, const char *part) {
    struct brdf b;
    struct err e = {0};
    assert_int_equal(brdf_read_text("t.brdf", text, strlen(text), &b, &e), -ERR_INPUT);
    if (!strstr(e.text, part))
        print_error("%d:%d %s\n", e.line, e.column, e.text);
    assert_non_null(strstr(e.text, part));
    assert_int_equal(e.line, line);
}

static void broken_files(void **state) {
    (void)state;
    expect("", 1, "the file ends where the number of wavelengths should follow");
    expect("2\n400\n", 3, "the file ends where a wavelength");
    expect("2 400 400", 1, "must ascend");
    expect("1.5 400", 1, "must be whole");
    expect("1e9", 1, "from 1 to 4096");
    expect("1 400\n", 2, "no geometry");
    expect("1 400\n0 0 0\n", 3, "where phi_s should follow");
    expect("1 400\n0 0 0 0 0.1 0.2\n", 3, "where phi_i should follow");
    expect("1 400\n1.6 0 0 0 0.1\n", 2, "theta_i is 1.6");
    expect("1 400\n50 0 0 0 0.1\n", 2, "theta_i is 50");
    expect("1 400\n0 0 0 0 nan\n", 2, "'nan' is no number");
}

static void a_measured_paint(void **state) {
    (void)state;
    static const char path[] = "../shared/data/brdf/painted/garnet_red.brdf";
    struct brdf b;
    struct err e = {0};
    skip_without_file(path);
    assert_int_equal(brdf_read_file(path, &b, &e), 0);
    assert_int_equal(b.n, 1439);
    assert_int_equal(b.n_lambda, 31);
    assert_true(b.lambda_nm[0] == 400 && b.lambda_nm[30] == 700);
    size_t forward = 0, back = 0, peak = 0;
    for (size_t i = 0; i < b.n; i++) {
        if (!b.geometry[i].in_plane)
            continue;
        forward += b.geometry[i].theta_v_deg > 0;
        back += b.geometry[i].theta_v_deg < 0;
        if (b.beta[i * 31 + 5] > b.beta[peak * 31 + 5])
            peak = i;
    }
    assert_true(forward > 20 && back > 20);
    assert_true(b.geometry[peak].theta_v_deg > b.geometry[peak].theta_i_deg - 5); /* gloss: mirror side */
    brdf_free(&b);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(geometries_and_sides),
        cmocka_unit_test(broken_files),
        cmocka_unit_test(a_measured_paint),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
