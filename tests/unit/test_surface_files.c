#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/alta.h"
#include "proto/astm.h"
#include "proto/nist.h"

#define RAD (M_PI / 180)

typedef int reader(const char *file, const char *text, size_t size, struct brdf *b, struct err_list *errors);

static void read_good(reader *read, const char *text, struct brdf *b) {
    struct err_list errors = {0};
    int rc = read("s", text, strlen(text), b, &errors);
    for (size_t i = 0; i < errors.n; i++)
        print_error("%d:%d %s\n", errors.item[i].line, errors.item[i].column, errors.item[i].text);
    assert_int_equal(rc, 0);
    assert_int_equal(errors.n, 0);
}

/* The first mistake: its place, and a part of its sentence. */
static void read_bad(reader *read, const char *text, int line, int column, const char *part) {
    struct brdf b;
    struct err_list errors = {0};
    assert_int_equal(read("s", text, strlen(text), &b, &errors), -ERR_INPUT);
    assert_true(errors.n > 0);
    const struct err *e = &errors.item[0];
    if (!strstr(e->text, part) || e->line != line || e->column != column)
        fail_msg("%d:%d '%s'; expected %d:%d '%s'", e->line, e->column, e->text, line, column, part);
    assert_string_equal(e->file, "s");
    err_list_free(&errors);
}

static void expect(const struct brdf *b, size_t i, double theta_i_deg, double theta_v_deg, double beta) {
    assert_float_equal(b->geometry[i].theta_i_deg, theta_i_deg, 1e-9);
    assert_float_equal(b->geometry[i].theta_v_deg, theta_v_deg, 1e-9);
    assert_float_equal(b->beta[i * b->n_lambda], beta, 1e-12);
}

static void astm_as_goniod_writes_it(void **state) {
    (void)state;
    struct brdf b;
    read_good(astm_read_text,
              "ASTM E 1392-96 style\nUNITS \"angles rad, BRDF 1/sr; phi_s = pi on the mirror side\"\n"
              "NUM_POINTS 2\nVARS theta_i,phi_i,theta_s,phi_s,BRDF_400nm,BRDF_405nm\n"
              "0.5,0,0.25,3.141592654,0.1,0.2\n0.5,0,0.25,0,-0.01,0\n",
              &b);
    assert_true(b.azimuth_stated && b.n_notes == 0 && b.n == 2 && b.n_lambda == 2 && !b.u);
    assert_true(b.lambda_nm[0] == 400 && b.lambda_nm[1] == 405);
    expect(&b, 0, 0.5 / RAD, 0.25 / RAD, 0.1 * M_PI);
    expect(&b, 1, 0.5 / RAD, -0.25 / RAD, -0.01 * M_PI);
    assert_true(b.beta[3] == 0);
    brdf_free(&b);
}

static void astm_columns_that_vars_does_not_name(void **state) {
    (void)state;
    struct brdf b;
    read_good(astm_read_text, /* six names, seven columns: the azimuth of the sensor is the one left out */
              "LAB_NAME X\nAPERTURE Circular\n\nNUM_POINTS 3\nVARS theta_i,phi_i,theta_s,465nm,525nm,630nm\n"
              "0.5,3.1415926536,0.25,0,1,2,3\r\n0.5 3.1415926536 0.25 3.1415926536 4 5 6\n",
              &b);
    expect(&b, 0, 0.5 / RAD, 0.25 / RAD, 1 * M_PI);
    expect(&b, 1, 0.5 / RAD, -0.25 / RAD, 4 * M_PI);
    assert_true(b.lambda_nm[0] == 465 && b.lambda_nm[2] == 630 && !b.azimuth_stated);
    assert_string_equal(b.note[0], "column 4, which VARS does not name, is taken for phi_s");
    assert_string_equal(b.note[1], "NUM_POINTS says 3, but the rows are 2");
    assert_int_equal(b.n_notes, 2);
    brdf_free(&b);
    read_good(astm_read_text, /* all angles are named: what is left over stands at the end */
              "NUM_POINTS 1\nVARS theta_s theta_i phi_s phi_i R\n0.25 0.5 1 1 0.3 7 8\n", &b);
    expect(&b, 0, 0.5 / RAD, -0.25 / RAD, 0.3 * M_PI);
    assert_true(isnan(b.lambda_nm[0]));
    assert_string_equal(b.note[0], "the last 2 of 7 columns, which VARS does not name, are not read");
    brdf_free(&b);
    read_good(astm_read_text, "NUM_POINTS 1\nVARS theta_i,theta_s,Integrated radiance\n0.5,-0.25,1\n", &b);
    expect(&b, 0, 0.5 / RAD, 0.25 / RAD, M_PI); /* below 0: the other side of the normal */
    assert_int_equal(b.n_notes, 2);
    assert_non_null(strstr(b.note[0], "no phi_s"));
    brdf_free(&b);
}

static void astm_mistakes_have_their_place(void **state) {
    (void)state;
    static const char keys[] = "VARS theta_i,phi_i,theta_s,phi_s,R\n";
    char text[256];
    read_bad(astm_read_text, "", 0, 0, "no line VARS");
    read_bad(astm_read_text, "NUM_POINTS 3\n1,2,3,4\n", 2, 0, "no line VARS");
    read_bad(astm_read_text, "VARS theta_i,theta_i\n", 1, 14, "twice");
    read_bad(astm_read_text, "VARS theta_i,phi_i,R\n", 1, 1, "does not name theta_s");
    read_bad(astm_read_text, "VARS theta_i,theta_s\n", 1, 1, "no value");
    read_bad(astm_read_text, keys, 1, 0, "no row");
    static const struct {
        const char *rows;
        int line, column;
        const char *part;
    } rows[] = {{"0,0,0,0,1\n0.5,0,0.25,x,1\n", 3, 12, "'x' is no number"},
                {"0,0,,0,1\n", 2, 5, "a number is missing"},
                {"0,0,0,0\n", 2, 1, "4 columns, but VARS names 5"},
                {"0,0,0,0,1\n0,0,0,0,1,2\n", 3, 1, "but the first row has 5"},
                {"30,0,10,0,1\n", 2, 1, "angles here are radians"},
                {"0,0,0,0,nan\n", 2, 9, "no number"},
                {"0,0,0,0,1e7\n", 2, 9, "within 1e6"},
                {"0,0,0,\x01,1\n", 2, 7, "no text"}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        snprintf(text, sizeof text, "%s%s", keys, rows[i].rows);
        read_bad(astm_read_text, text, rows[i].line, rows[i].column, rows[i].part);
    }
}

/* The direction pair theta_i = 40 deg, theta_r = 25 deg, delta phi = 110 deg in each parametrisation. */
static void alta_parametrisations_agree(void **state) {
    (void)state;
    double i = 40 * RAD, r = 25 * RAD, d = 110 * RAD;
    double l[3] = {sin(i) * cos(0.3), sin(i) * sin(0.3), cos(i)};
    double v[3] = {sin(r) * cos(0.3 + d), sin(r) * sin(0.3 + d), cos(r)}, h[3], size = 0;
    for (int k = 0; k < 3; k++)
        size += (l[k] + v[k]) * (l[k] + v[k]);
    for (int k = 0; k < 3; k++)
        h[k] = (l[k] + v[k]) / sqrt(size);
    double theta_h = acos(h[2]), phi_h = atan2(h[1], h[0]), theta_d = acos(sqrt(size) / 2);
    /* the view in the frame of the half vector: turned back by phi_h about the normal, by theta_h about y */
    double x = v[0] * cos(phi_h) + v[1] * sin(phi_h), y = v[1] * cos(phi_h) - v[0] * sin(phi_h);
    double phi_d = atan2(y, x * cos(theta_h) - v[2] * sin(theta_h));
    char text[8][160];
    snprintf(text[0], 160, "#DIM 4 1\n#PARAM_IN SPHERICAL_TL_PL_TV_PV\n|%.15g %.15g %.15g %.15g", i, 0.3, r,
             0.3 + d);
    snprintf(text[1], 160, "#DIM 3 1\n#PARAM_IN ISOTROPIC_TV_TL_DPHI\n|%.15g %.15g %.15g", r, i, -d);
    snprintf(text[2], 160, "#DIM 3 1\n#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI\n|%.15g %.15g %.15g", i, r * cos(d),
             r * sin(d));
    snprintf(text[3], 160, "#DIM 6 1\n#PARAM_IN CARTESIAN\n|%.12g %.12g %.12g %.12g %.12g %.12g", v[0], v[1],
             v[2], l[0], l[1], l[2]);
    snprintf(text[4], 160, "#DIM 3 1\n#PARAM_IN RUSIN_TH_TD_PD\n|%.15g %.15g %.15g", theta_h, theta_d, phi_d);
    snprintf(text[5], 160, "#DIM 4 1\n#PARAM_IN RUSIN_TH_PH_TD_PD\n|%.15g %.15g %.15g %.15g", theta_h, phi_h,
             theta_d, phi_d);
    for (int k = 0; k < 6; k++) {
        char whole[320], *bar = strchr(text[k], '|');
        struct brdf b;
        snprintf(whole, sizeof whole, "%.*s#PARAM_OUT INV_STERADIAN\n%s 0.25\n", (int)(bar - text[k]),
                 text[k], bar + 1);
        read_good(alta_read_text, whole, &b);
        assert_float_equal(b.geometry[0].theta_i_deg, 40, 1e-9);
        assert_float_equal(b.geometry[0].theta_s_deg, 25, 1e-9);
        assert_float_equal(b.geometry[0].delta_phi_deg, 110, 1e-9);
        assert_float_equal(b.beta[0], 0.25 * M_PI, 1e-15);
        assert_true(isnan(b.lambda_nm[0]) && b.azimuth_stated);
        brdf_free(&b);
    }
}

static void alta_normal_incidence_and_intervals(void **state) {
    (void)state;
    struct brdf b;
    read_good(alta_read_text,
              "#DIM 2 3\n#PARAM_IN ISOTROPIC_TV_PROJ_DPHI\n#PARAM_OUT RGB_COLOR\n#VS 2\n# a remark\n"
              "0.3 0.4  1 2 3  0.9 1.2\n",
              &b);
    assert_float_equal(b.geometry[0].theta_i_deg, 0, 1e-12);
    assert_float_equal(b.geometry[0].theta_s_deg, 0.5 / RAD, 1e-9);
    assert_int_equal(b.n_lambda, 3);
    assert_float_equal(b.u[0], 0.15 * M_PI, 1e-15);
    assert_true(isnan(b.u[1]));
    assert_non_null(strstr(b.note[0], "one standard uncertainty"));
    brdf_free(&b);
    read_good(alta_read_text,
              "#DIM 3 1\n#PARAM_IN RUSIN_TH_TD_PD\n#PARAM_OUT INV_STERADIAN\n#VS 1\n"
              "0.1 0.2 1 0.5 0.01\n1.5 1.5 3 0.5 0.01\n",
              &b);
    assert_int_equal(b.n, 1);
    assert_float_equal(b.u[0], 0.01 * M_PI, 1e-15);
    assert_non_null(strstr(b.note[1], "1 rows with a direction under the surface"));
    brdf_free(&b);
}

static void alta_mistakes_have_their_place(void **state) {
    (void)state;
    static const char head[] = "#DIM 3 1\n#PARAM_IN ISOTROPIC_TV_TL_DPHI\n#PARAM_OUT INV_STERADIAN\n";
    char text[256];
    read_bad(alta_read_text, "", 0, 0, "no row");
    read_bad(alta_read_text, "#PARAM_IN STARK_2D\n", 1, 1, "STARK_2D is not read");
    read_bad(alta_read_text, "#DIM 3 1\n#PARAM_OUT INV_STERADIAN_COSINE_FACTOR\n", 2, 1, "COSINE_FACTOR");
    read_bad(alta_read_text, "#DIM 0 1\n", 1, 1, "#DIM must give");
    read_bad(alta_read_text, "#DIM 2!1\n#PARAM_IN ISOTROPIC_TV_PROJ_DPHI\n#PARAM_OUT RGB_COLOR\n0 0 1\n", 1,
             1, "#DIM must give");
    read_bad(alta_read_text, "#VS 3\n", 1, 1, "#VS is");
    read_bad(alta_read_text, "#FORMAT binary\n", 1, 1, "binary");
    read_bad(alta_read_text, "1 2 3\n", 1, 1, "before #DIM");
    read_bad(alta_read_text, "#DIM 4 1\n#PARAM_IN RUSIN_TH_TD_PD\n#PARAM_OUT INV_STERADIAN\n1 2 3 4 5\n", 4,
             1, "but RUSIN_TH_TD_PD has 3");
    snprintf(text, sizeof text, "%s0.1 0.2 3 1\n0.1 0.2 3\n", head);
    read_bad(alta_read_text, text, 5, 1, "3 columns");
    snprintf(text, sizeof text, "%s0.1 30 3 1\n", head);
    read_bad(alta_read_text, text, 4, 5, "no angle in radians");
}

static void nist_rows_become_spectra(void **state) {
    (void)state;
    struct brdf b;
    read_good(nist_read_text,
              "lambda,thetai,phi,thetar,phir,f_r11,f_r12/f_r11\n0.633,-30,0,20,0,0.33,0\n"
              "0.532,-30,0,20,0,0.32,0\n0.532,-30,0,20,180,0.31,0\n0.532,-30,0,20,90,0.30,0\n",
              &b);
    assert_int_equal(b.n, 3);
    assert_true(b.n_lambda == 2 && b.lambda_nm[0] == 532 && b.lambda_nm[1] == 633);
    expect(&b, 0, 30, 20, 0.32 * M_PI); /* phir = 0 is the mirror side: the source stands at theta < 0 */
    expect(&b, 2, 30, -20, 0.31 * M_PI);
    assert_false(b.geometry[1].in_plane);
    assert_float_equal(b.beta[1], 0.33 * M_PI, 1e-15);
    assert_true(isnan(b.beta[3]));
    brdf_free(&b);
    read_bad(nist_read_text, "lambda,thetai,phi,thetar,f_r11\n1,2,3,4,5\n", 1, 1, "'phir' is missing");
    read_bad(nist_read_text, "lambda,thetai,phi,thetar,phir,f_r11\n0.5,-95,0,20,0,1\n", 2, 5,
             "from -90 to 90");
    read_bad(nist_read_text, "lambda,thetai,phi,thetar,phir,f_r11\n532,-45,0,20,0,1\n", 2, 1,
             "from 0.1 to 5");
    read_bad(nist_read_text, "lambda,thetai,phii,thetar,phir,fr11\n0.5,-45,0,20,0,1\n0.5,-45,0,20,0,2\n", 0,
             0, "two values for 500 nm");
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(astm_as_goniod_writes_it),
        cmocka_unit_test(astm_columns_that_vars_does_not_name),
        cmocka_unit_test(astm_mistakes_have_their_place),
        cmocka_unit_test(alta_parametrisations_agree),
        cmocka_unit_test(alta_normal_incidence_and_intervals),
        cmocka_unit_test(alta_mistakes_have_their_place),
        cmocka_unit_test(nist_rows_become_spectra),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
