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
#include "sim/measured.h"
#include "sim/sim.h"
#include "tests/support/skipping.h"

#define GARNET "../shared/data/brdf/painted/garnet_red.brdf"

static void check_nodes(const struct brdf *b, const struct measured *m) {
    double beta[BANDS];
    int nodes = 0;
    for (size_t i = 0; i < b->n; i++) {
        const struct brdf_geometry *g = &b->geometry[i];
        if (!g->in_plane)
            continue;
        nodes++;
        measured_at(m, g->theta_i_deg, g->theta_v_deg, beta);
        for (size_t k = 0; k < b->n_lambda; k++) {
            double node = b->beta[i * b->n_lambda + k];
            int band = ((int)b->lambda_nm[k] - BAND_FIRST_NM) / BAND_STEP_NM;
            assert_true(fabs(beta[band] - node) <= 1e-12 + 1e-9 * node);
        }
    }
    assert_true(nodes > 3);
}

/* The twin of garnet_red: irregular angles with a hole, 10 nm steps, a value of 0. */
static const char TWIN[] = "# twin\n3\n500 510 520\n"
                           "0.17453293 0 0.14154 3.14159265 0.1 0.2 0.25\n"
                           "0.17453293 0 0.5 0 0.01 0.02 0.03\n"
                           "0.17453293 0 0.42743 3.14159265 0.05 0.06 0\n"
                           "0.34906585 0 0.42743 3.14159265 0.2 0.3 0.5\n"
                           "0.34906585 0 0.14154 3.14159265 0.02 0.04 0.05\n"
                           "0.34906585 0 0.6 1.2 9 9 9\n";

static void test_it_passes_through_its_nodes(void **state) {
    (void)state;
    struct brdf b;
    struct measured *m;
    struct err e = {0};
    assert_int_equal(brdf_read_text("twin.brdf", TWIN, sizeof TWIN - 1, &b, &e), 0);
    assert_int_equal(measured_new(&m, &b, &e), 0);
    check_nodes(&b, m);
    measured_free(m);
    brdf_free(&b);
}

static void test_a_lobe_moves_between_incidences(void **state) {
    (void)state;
    double angle[5] = {-20, -10, 0, 10, 20}, lambda_nm[2] = {380, 780};
    struct brdf_geometry g[10];
    double beta[20], got[BANDS];
    for (int c = 0; c < 2; c++)
        for (int i = 0; i < 5; i++) {
            double theta_i_deg = 30 + 10 * c;
            g[5 * c + i] = (struct brdf_geometry){theta_i_deg, theta_i_deg + angle[i], 180, true,
                                                  theta_i_deg + angle[i]};
            beta[2 * (5 * c + i)] = beta[2 * (5 * c + i) + 1] = angle[i] == 0 ? 4 : 1;
        }
    struct brdf b = {.n = 10, .n_lambda = 2, .lambda_nm = lambda_nm, .geometry = g, .beta = beta};
    struct measured *m;
    assert_int_equal(measured_new(&m, &b, NULL), 0);
    measured_at(m, 35, 35, got);
    assert_true(fabs(got[7] - 4) < 1e-12); /* at half way the peak is as high, at its own mirror direction */
    measured_at(m, 35, 40, got);
    assert_true(fabs(got[7] - 2.5) < 1e-12);
    measured_at(m, 5, 85, got); /* beyond the table: its end, never an extrapolation */
    assert_true(fabs(got[7] - 1) < 1e-12);
    measured_free(m);
}

static void test_nothing_in_the_plane_is_an_error(void **state) {
    (void)state;
    struct brdf b;
    struct measured *m;
    struct err e = {0};
    static const char text[] = "1\n500\n0.3 0 0.6 1.2 9\n";
    assert_int_equal(brdf_read_text("x.brdf", text, sizeof text - 1, &b, &e), 0);
    assert_int_equal(measured_new(&m, &b, &e), -ERR_INPUT);
    brdf_free(&b);
}

static void test_garnet_red(void **state) {
    (void)state;
    struct brdf b;
    struct measured *m;
    struct err e = {0};
    skip_without_file(GARNET); /* test_it_passes_through_its_nodes is its twin */
    assert_int_equal(brdf_read_file(GARNET, &b, &e), 0);
    assert_int_equal(measured_new(&m, &b, &e), 0);
    check_nodes(&b, m);
    struct sim_surface s = {.measured = m};
    assert_true(sim_surface_beta(&s, 50, 50, 64) > sim_surface_beta(&s, 50, 20, 64));
    measured_free(m);
    brdf_free(&b);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_it_passes_through_its_nodes),
        cmocka_unit_test(test_a_lobe_moves_between_incidences),
        cmocka_unit_test(test_nothing_in_the_plane_is_an_error),
        cmocka_unit_test(test_garnet_red),
    };
    return cmocka_run_group_tests_name("sim_measured", tests, NULL, NULL);
}
