#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/points_csv.h"
#include "fit/points_session.h"
#include "proto/units.h"
#include "tests/support/goniometry.h"
#include "tests/support/session_rows.h"

static int read_csv(const char *text, struct fitset *d, struct err_list *errors) {
    fitset_init(d);
    return points_csv_read("p.csv", text, strlen(text), d, errors);
}

static void columns_may_stand_in_any_order(void **state) {
    (void)state;
    struct fitset d;
    struct err_list errors = {0};
    const struct estimate_input *in;
    assert_int_equal(read_csv("# from a friend\nu_ind,beta,theta_v_deg,theta_i_deg,u_common_rel\n"
                              "0.001,0.25,-30,10,0.01\n0.002,-0.0001,80,60,0.01\n",
                              &d, &errors),
                     0);
    assert_int_equal(fitset_input(&d, &in, NULL), 0);
    assert_int_equal(in->n, 2);
    assert_true(in->theta_i_deg[1] == 60 && in->theta_v_deg[0] == -30 && in->beta[1] == -0.0001);
    assert_true(in->u_ind[0] == 0.001 && in->band_beta == NULL);
    assert_int_equal(in->n_common, 1);
    assert_float_equal(in->common[0].mean[0], 0.0025, 1e-15);
    assert_false(d.independence_assumed);
    fitset_free(&d);
}

static void a_total_uncertainty_is_split_or_said_to_be_independent(void **state) {
    (void)state;
    struct fitset d;
    struct err_list errors = {0};
    const struct estimate_input *in;
    assert_int_equal(read_csv("theta_i_deg,theta_v_deg,beta,u_beta\n10,0,0.5,0.01\n", &d, &errors), 0);
    assert_true(d.independence_assumed);
    assert_int_equal(fitset_input(&d, &in, NULL), 0);
    assert_true(in->u_ind[0] == 0.01 && in->n_common == 0);
    fitset_free(&d);
    assert_int_equal(read_csv("theta_i_deg,theta_v_deg,beta,u_beta,u_ind\n10,0,0.5,0.05,0.03\n", &d, &errors),
                     0);
    assert_int_equal(fitset_input(&d, &in, NULL), 0);
    assert_true(in->u_ind[0] == 0.03);
    assert_float_equal(in->common[0].mean[0], 0.04, 1e-15);
    fitset_free(&d);
    assert_int_equal(read_csv("theta_i_deg,theta_v_deg,beta\n10,0,0.5\n", &d, &errors), 0);
    assert_int_equal(fitset_input(&d, &in, NULL), 0);
    assert_null(in->u_ind);
    fitset_free(&d);
}

static void columns_by_wavelength_give_bands_and_mean(void **state) {
    (void)state;
    struct fitset d;
    struct err_list errors = {0};
    const struct estimate_input *in;
    assert_int_equal(read_csv("theta_i_deg,theta_v_deg,beta_390nm,beta_500nm,u_500nm,beta_601.5nm,u_601.5nm\n"
                              "10,0,9,0.5,0.03,0.7,0.04\n",
                              &d, &errors),
                     0);
    assert_int_equal(fitset_input(&d, &in, NULL), 0);
    assert_true(in->band_beta[2] == 9 && in->band_beta[24] == 0.5 && in->band_beta[44] == 0.7);
    assert_true(isnan(in->band_beta[3]) && isnan(in->band_u_ind[2]) && in->band_u_ind[24] == 0.03);
    assert_float_equal(in->beta[0], 0.6, 1e-15); /* 390 nm is not visible */
    assert_float_equal(in->u_ind[0], 0.025, 1e-15);
    fitset_free(&d);
    assert_int_equal(
        read_csv("theta_i_deg,theta_v_deg,beta_500nm,beta_600nm,u_common_rel\n10,0,0.5,0.7,0.01\n", &d,
                 &errors),
        0);
    assert_int_equal(fitset_input(&d, &in, NULL), 0);
    assert_float_equal(in->common[0].mean[0], 0.006, 1e-15);
    fitset_free(&d);
}

static void every_mistake_has_its_place(void **state) {
    (void)state;
    struct fitset d;
    struct err_list errors = {0};
    assert_int_equal(
        read_csv("theta_i_deg,theta_v_deg,beta,u_ind\n10,0,0.5,0.01\nx,0,0.5,0.01\n10,95,0.5,0.01\n"
                 "10,0,0.5,-1\n-1,0,nan,0.01\n",
                 &d, &errors),
        -ERR_INPUT);
    fitset_free(&d);
    static const int place[][2] = {{3, 1}, {4, 4}, {5, 10}, {6, 1}, {6, 6}};
    assert_int_equal(errors.n, 5);
    for (size_t i = 0; i < errors.n; i++) {
        assert_int_equal(errors.item[i].line, place[i][0]);
        assert_int_equal(errors.item[i].column, place[i][1]);
        assert_string_equal(errors.item[i].file, "p.csv");
    }
    err_list_free(&errors);
    static const char *const wrong[] = {"",
                                        "\n",
                                        "theta_i_deg,theta_v_deg\n1,2\n",
                                        "theta_i_deg,beta\n1,2\n",
                                        "a,b\n1,2\n",
                                        "theta_i_deg,theta_v_deg,beta,beta\n1,2,3,4\n",
                                        "theta_i_deg,theta_v_deg,beta,beta_550nm\n1,2,3,4\n",
                                        "theta_i_deg,theta_v_deg,beta_550nm,beta_551nm\n1,2,3,4\n",
                                        "theta_i_deg,theta_v_deg,beta_1550nm\n1,2,3\n",
                                        "theta_i_deg,theta_v_deg,beta_550nm,u_ind\n1,2,3,0.1\n",
                                        "theta_i_deg,theta_v_deg,beta_infnm\n1,2,3\n",
                                        "theta_i_deg,theta_v_deg,beta\n1,2\n"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        struct err_list found = {0};
        if (read_csv(wrong[i], &d, &found) != -ERR_INPUT || found.n == 0) {
            fail_msg("'%s' was accepted", wrong[i]);
        }
        err_list_free(&found);
        fitset_free(&d);
    }
}

/* A session of the 198-point grid: every third point measured with both axes negated, one bracket an incidence. */
static void write_point(struct session *s, const struct goniometry *m, size_t i, const uint16_t *counts) {
    struct exposure x;
    struct point p;
    row_exposure((int)i, &x, (uint16_t *)(uintptr_t)counts);
    x.mirrored = i % 3 == 0;
    x.saturated_pixels = 0;
    x.theta_i_udeg = udeg_from_deg(m->theta_i_deg[i]);
    x.theta_v_udeg = udeg_from_deg(m->theta_v_deg[i]);
    ROW_OK(session_add_exposure(s, &x, e));
    row_point((int)i, x.id, &p);
    p.n_common = 1;
    snprintf(p.common[0].name, sizeof p.common[0].name, "certificate");
    p.bracket = 1 + (int)i / 33;
    p.tau_us = 1e6 * (double)(i % 33 + 1);
    p.tau_r_us = 0;
    p.theta_i_udeg = x.theta_i_udeg;
    p.theta_v_udeg = x.theta_v_udeg;
    p.mean = m->beta[i];
    p.mean_u_ind = m->u[i];
    p.common[0].mean = 0.01 * m->beta[i];
    for (int b = 0; b < BANDS; b++) {
        p.present[b] = true;
        p.beta[b] = m->band_beta[i * BANDS + (size_t)b];
        p.u_ind[b] = m->band_u[i * BANDS + (size_t)b];
        p.common[0].sensitivity[b] = 0.01 * p.beta[b];
    }
    p.provisional = true;
    ROW_OK(session_add_point(s, &p, e));
    if (i != 5) { /* point 5 never gets its final value */
        p.supersedes = p.id;
        p.provisional = false;
        ROW_OK(session_add_point(s, &p, e));
    }
}

static void write_session(const char *path, const struct goniometry *m) {
    uint16_t counts[ROW_SCANS * ROW_PIXELS];
    struct calibration calibration;
    struct session *s;
    row_calibration(&calibration);
    ROW_OK(session_create(&s, path, e));
    ROW_OK(session_begin(s, e));
    ROW_OK(session_set_calibration(s, &calibration, e));
    ROW_OK(session_set_text(s, "fit_setup", "{\"u_zero_sample_deg\":0.01,\"mean_nm\":[400,700]}", e));
    for (size_t i = 0; i < m->input.n; i++) {
        write_point(s, m, i, counts);
    }
    for (int n = 1; n <= 6; n++) {
        struct bracket b;
        row_bracket(n, &b);
        b.open_us = 1000000LL * n;
        b.close_us = b.open_us + 34 * 1000000LL;
        b.mean_rate = 1e-8;
        ROW_OK(session_add_bracket(s, &b, e));
    }
    ROW_OK(session_commit(s, e));
    ROW_OK(session_close(s, e));
}

static void a_session_gives_its_final_points(void **state) {
    (void)state;
    static struct goniometry m;
    const double value[MATERIAL_PARAMETERS] = {0.2, 0.3, 0.07, 7.6, 1.7};
    char folder[64], path[96];
    struct fitset d;
    struct estimate estimate;
    row_make_folder(folder, path);
    goniometry_make(&m, value, 60, 5);
    goniometry_colour(&m, 0.04, 0.45);
    write_session(path, &m);
    fitset_init(&d);
    ROW_OK(points_session_read(path, &d, e));
    assert_int_equal(d.n, 197);
    assert_int_equal(d.n_causes, 1);
    assert_int_equal(d.n_brackets, 6);
    assert_int_equal(d.bracket[0].n, 32);
    assert_true(d.mirrored[0] && !d.mirrored[1]);
    assert_true(d.bracket[1].length_us == 34e6 && d.bracket[1].tau_us[0] == 1e6);
    assert_true(d.input.u_zero_sample_deg == 0.01);
    ROW_OK(fitset_fit(&d, &estimate, e));
    assert_true(estimate.converged && !estimate.provisional);
    assert_float_equal(estimate.value[MATERIAL_N], 1.7, 1e-4);
    assert_float_equal(estimate.q, m.q, 1e-4);
    assert_float_equal(estimate.s_lambda[40], m.s_lambda[40], 1e-4);
    assert_true(estimate.common[MATERIAL_S][MATERIAL_S] > 0 && estimate.common[MATERIAL_N][MATERIAL_N] > 0);
    fitset_free(&d);
    fitset_init(&d); /* a mask takes points out together with what belongs to them */
    d.mask = (struct mask){.max_theta_i_deg = 30, .max_theta_v_deg = 60};
    ROW_OK(points_session_read(path, &d, e));
    assert_int_equal(d.n, 3 * 25 - 1);
    assert_int_equal(d.mask.left_out[MASK_THETA_I], 99);
    assert_int_equal(d.mask.left_out[MASK_THETA_V], 3 * 8);
    assert_int_equal(d.cause[0].n, d.n);
    assert_true(d.bracket[0].n == 24 && d.bracket[5].n == 0 && d.bracket[2].point[24] == 73);
    ROW_OK(fitset_fit(&d, &estimate, e));
    assert_true(estimate.converged && estimate.n_points == 74);
    fitset_free(&d);
    row_remove_folder(folder);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(columns_may_stand_in_any_order),
        cmocka_unit_test(a_total_uncertainty_is_split_or_said_to_be_independent),
        cmocka_unit_test(columns_by_wavelength_give_bands_and_mean),
        cmocka_unit_test(every_mistake_has_its_place),
        cmocka_unit_test(a_session_gives_its_final_points),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
