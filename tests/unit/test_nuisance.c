#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "fit/aperture.h"
#include "fit/estimate.h"
#include "tests/support/goniometry.h"
#include "tests/support/seed.h"

#define SEED 11
#define RUNS 60
#define PRIOR_U_DEG 0.05

static struct goniometry m;
static const struct reflectance_optics plain = {.kappa = 1, .q = 1};

/* Points of a set seen with both zeros off, before noise. */
static void make(int set, double zero_source_deg, double zero_sample_deg) {
    goniometry_make(&m, goniometry_set[set], 60, 5);
    for (size_t i = 0; i < m.input.n; i++) {
        assert_int_equal(aperture_at(&(struct aperture_form){0},
                                     m.theta_i_deg[i] + zero_source_deg - zero_sample_deg,
                                     m.theta_v_deg[i] + zero_sample_deg, REFLECTANCE_COMPOSITE, m.value,
                                     &plain, &m.truth[i], NULL, NULL),
                         0);
        m.beta[i] = m.truth[i];
    }
    m.input.u_zero_source_deg = PRIOR_U_DEG;
    m.input.u_zero_sample_deg = PRIOR_U_DEG;
}

static double total_u(const struct estimate *estimate, int j) {
    return sqrt(estimate->statistical[j][j] + estimate->common[j][j]);
}

static bool says(const struct estimate *estimate, const char *words) {
    for (int i = 0; i < estimate->n_warnings; i++) {
        if (strstr(estimate->warning[i], words)) {
            return true;
        }
    }
    return false;
}

static void an_offset_is_found_within_its_uncertainty(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    double offset_pull2 = 0, pull2[5] = {0};
    for (int run = 0; run < RUNS; run++) {
        double source_deg = PRIOR_U_DEG * dice_normal(&d), sample_deg = PRIOR_U_DEG * dice_normal(&d);
        struct estimate estimate;
        make(run % GONIOMETRY_SETS, source_deg, sample_deg);
        goniometry_noise(&m, &d);
        assert_int_equal(estimate_fit(&m.input, &estimate, NULL), 0);
        assert_true(estimate.converged);
        double error = estimate.mirror_offset_deg - (source_deg / 2 - sample_deg);
        assert_true(estimate.u_mirror_offset_deg < PRIOR_U_DEG);
        offset_pull2 += pow(error / estimate.u_mirror_offset_deg, 2) / RUNS;
        for (int j = 0; j < 5; j++) {
            pull2[j] += pow((estimate.value[j] - m.value[j]) / total_u(&estimate, j), 2) / RUNS;
        }
    }
    print_message("# spread over u: offset %.2f, parameters %.2f %.2f %.2f %.2f %.2f\n", sqrt(offset_pull2),
                  sqrt(pull2[0]), sqrt(pull2[1]), sqrt(pull2[2]), sqrt(pull2[3]), sqrt(pull2[4]));
    assert_true(offset_pull2 > 0.45 && offset_pull2 < 1.75); /* 60 runs: 1 +- 0.18 */
    for (int j = 0; j < 5; j++) {
        assert_true(pull2[j] > 0.45 && pull2[j] < 1.75);
    }
}

/* chi-square of a fit at given angles, with nothing free beside the parameters, and the prior's share. */
static double chi2_at(double offset_deg) {
    struct goniometry shifted = m;
    struct estimate estimate;
    for (size_t i = 0; i < m.input.n; i++) { /* any zeros of that offset: here the sample's alone */
        shifted.theta_i_deg[i] += offset_deg;
        shifted.theta_v_deg[i] -= offset_deg;
    }
    shifted.input.theta_i_deg = shifted.theta_i_deg;
    shifted.input.theta_v_deg = shifted.theta_v_deg;
    shifted.input.beta = shifted.beta;
    shifted.input.u_ind = shifted.u;
    shifted.input.u_zero_source_deg = shifted.input.u_zero_sample_deg = 0;
    assert_int_equal(estimate_fit(&shifted.input, &estimate, NULL), 0);
    return estimate.chi2 + pow(offset_deg / PRIOR_U_DEG, 2);
}

static void it_is_the_minimum_of_chi_square_with_its_prior(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    struct estimate estimate;
    make(2, 0, 0.04);
    goniometry_noise(&m, &d);
    m.input.u_zero_source_deg = 0;
    assert_int_equal(estimate_fit(&m.input, &estimate, NULL), 0);
    const double h = estimate.u_mirror_offset_deg, at = estimate.mirror_offset_deg;
    const double low = chi2_at(at - h), middle = chi2_at(at), high = chi2_at(at + h);
    const double curvature = (low - 2 * middle + high) / (h * h);
    const double off = (low - high) / (2 * h) / curvature; /* of the parabola's minimum */
    print_message("# offset %.5f deg, u %.5f; chi-square %.3f at %.3f u from there, u by curvature %.5f\n",
                  at, h, estimate.chi2, off / h, sqrt(2 / curvature));
    assert_true(fabs(off) < 0.05 * h); /* each fit takes its weights from its own model */
    assert_float_equal(estimate.chi2, middle, 0.3);
    assert_float_equal(sqrt(2 / curvature) / h, 1, 0.03);
}

/* Where the points say nothing of it, the prior is what is known. */
static void the_prior_is_respected(void **state) {
    (void)state;
    struct estimate estimate;
    make(2, 0, 0.001);
    for (size_t i = 0; i < m.input.n; i++) {
        m.u[i] *= 100;
    }
    m.input.u_zero_source_deg = m.input.u_zero_sample_deg = 0.001;
    assert_int_equal(estimate_fit(&m.input, &estimate, NULL), 0);
    assert_true(fabs(estimate.mirror_offset_deg) < 1e-5);
    assert_float_equal(estimate.u_mirror_offset_deg / (0.001 * sqrt(1.25)), 1, 0.01);
    /* and where it contradicts them by far, that is said */
    make(0, 0, 0.1);
    m.input.u_zero_source_deg = m.input.u_zero_sample_deg = 0.01;
    assert_int_equal(estimate_fit(&m.input, &estimate, NULL), 0);
    assert_float_equal(estimate.mirror_offset_deg, -0.1, 0.01);
    assert_true(says(&estimate, "mirror direction is off"));
}

static void held_it_stays_a_common_part(void **state) {
    (void)state;
    struct estimate free_offset, held;
    make(0, 0.02, -0.02);
    assert_int_equal(estimate_fit(&m.input, &free_offset, NULL), 0);
    m.input.hold_offset = true;
    assert_int_equal(estimate_fit(&m.input, &held, NULL), 0);
    assert_true(held.mirror_offset_deg == 0 && held.u_mirror_offset_deg == 0);
    assert_float_equal(free_offset.mirror_offset_deg, 0.03, 0.005);
    print_message("# u(n): offset free %.2e, held %.2e; u(beta'): %.2e, %.2e\n", total_u(&free_offset, 4),
                  total_u(&held, 4), total_u(&free_offset, 3), total_u(&held, 3));
    assert_true(total_u(&free_offset, MATERIAL_N) < 0.5 * total_u(&held, MATERIAL_N));
    for (int j = 0; j < 5; j++) {
        assert_true(fabs(free_offset.value[j] - m.value[j]) < 0.5 * total_u(&free_offset, j));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_offset_is_found_within_its_uncertainty),
        cmocka_unit_test(it_is_the_minimum_of_chi_square_with_its_prior),
        cmocka_unit_test(the_prior_is_respected),
        cmocka_unit_test(held_it_stays_a_common_part),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
