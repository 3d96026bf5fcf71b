/* The joint fit finds what the instrument does not know of itself from all bands together: where it ends is the minimum of
 * chi-square with the priors, and with zeros and P drawn from them the parameters lie as far off as they state. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "fit/joint_fit.h"
#include "fit/joint_form.h"
#include "tests/support/goniometry.h"

#define SET 1
#define U_SAMPLE_DEG 0.02
#define U_SOURCE_DEG 0.02
#define U_P 0.03
#define BAND_STEP 9 /* every so many bands: nine in all */

static struct goniometry m; /* large */

/* Bands read at angles that are off, by polarised light. */
static void measure(double zero_source_deg, double zero_sample_deg, double polarisation, struct dice *d) {
    const struct reflectance_optics optics = {.kappa = 1, .q = 1, .polarisation = polarisation};
    double value[MATERIAL_PARAMETERS];
    goniometry_make(&m, goniometry_set[SET], 60, 5);
    goniometry_colour(&m, 0.05, 0.4);
    memcpy(value, m.value, sizeof value);
    for (size_t i = 0; i < m.input.n; i++) {
        struct reflectance_geometry g;
        double sum = 0, square = 0;
        int count = 0;
        assert_int_equal(reflectance_geometry(&g, m.theta_i_deg[i] + zero_source_deg - zero_sample_deg,
                                              m.theta_v_deg[i] + zero_sample_deg, NULL),
                         0);
        for (int b = 0; b < BANDS; b++) {
            const size_t at = i * BANDS + (size_t)b;
            m.band_beta[at] = NAN;
            if (b % BAND_STEP) {
                continue;
            }
            value[MATERIAL_S] = m.s_lambda[b];
            assert_int_equal(
                reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, &optics, &m.band_beta[at], NULL, NULL),
                0);
            m.band_u[at] = 0.003 * m.band_beta[at] + 2e-4;
            m.band_beta[at] += m.band_u[at] * dice_normal(d);
            sum += m.band_beta[at];
            square += m.band_u[at] * m.band_u[at];
            count++;
        }
        m.beta[i] = sum / count;
        m.u[i] = sqrt(square) / count;
    }
    m.input.mean_low_nm = 380;
    m.input.mean_high_nm = 780;
    m.input.u_zero_source_deg = U_SOURCE_DEG;
    m.input.u_zero_sample_deg = U_SAMPLE_DEG;
    m.input.u_polarisation = U_P;
}

struct work {
    struct problem p;
    struct joint_data d;
    struct joint_solution solution;
    struct estimate means;
    double model[GONIOMETRY_MAX * BANDS];
};

static double chi2_here(struct work *w) {
    double x[COORDINATES_MAX];
    memcpy(x, w->solution.x, sizeof x);
    assert_int_equal(joint_solve(&w->d, x, false, &w->solution, w->model, NULL), 0);
    return w->solution.chi2 + nuisance_chi2(&w->p);
}

static void move(struct work *w, int z, double by) {
    double step[NUISANCES_MAX] = {0};
    step[z] = by;
    assert_int_equal(nuisance_move(&w->p, step, NULL), 0);
}

/* To where joint_form_step sends it, from the estimate of the means on. */
static void settle(struct work *w, double u[NUISANCES_MAX]) {
    for (int i = 0; i < 5; i++) {
        struct joint_form form;
        double step[NUISANCES_MAX];
        assert_int_equal(joint_form_init(&form, &w->d, &w->solution, false, w->model, NULL), 0);
        joint_form_step(&form, &w->d, w->model, step);
        for (int z = 0; z < 2; z++) {
            u[z] = sqrt(form.inverse[(form.k + z) * (form.all + 1)]);
        }
        joint_form_free(&form);
        assert_int_equal(nuisance_move(&w->p, step, NULL), 0);
        chi2_here(w);
    }
}

static void it_ends_at_the_minimum_with_the_priors(void **state) {
    (void)state;
    static struct work w;
    struct dice d = {31};
    double u[NUISANCES_MAX];
    measure(0.025, -0.03, 0.04, &d);
    assert_int_equal(estimate_fit(&m.input, &w.means, NULL), 0);
    assert_int_equal(problem_init(&w.p, &m.input, NULL), 0);
    assert_int_equal(w.p.nuisance.m, 2);
    w.p.optics.q = w.means.q;
    assert_int_equal(nuisance_take(&w.p, &w.means, NULL), 0);
    assert_int_equal(problem_evaluate(&w.p, w.means.value, NULL), 0);
    assert_int_equal(problem_reweigh(&w.p, w.means.value, NULL), 0);
    assert_int_equal(joint_data_init(&w.d, &w.p, NULL), 0);
    coordinates_from_value(w.p.model, w.means.value, w.solution.x);
    chi2_here(&w);
    settle(&w, u);
    for (int z = 0; z < 2; z++) {
        const double middle = chi2_here(&w);
        move(&w, z, u[z]);
        const double above = chi2_here(&w);
        move(&w, z, -2 * u[z]);
        const double below = chi2_here(&w);
        move(&w, z, u[z]);
        /* With the other nuisance held the minimum is as sharp as that one leaves it. */
        const double curvature = (above + below - 2 * middle) / 2, off = (below - above) / 4 / curvature;
        print_message("# nuisance %d at %.5f (u %.5f): the minimum %.3f u from there, curvature %.3f\n", z,
                      w.p.nuisance.of[z].at, u[z], off, curvature);
        assert_true(fabs(off) < 0.02 && curvature >= 0.99);
    }
    assert_true(fabs(w.p.nuisance.of[0].at - (0.0125 + 0.03)) < 4 * u[0]);
    assert_true(fabs(w.p.nuisance.of[1].at - 0.04) < 4 * u[1]);
    joint_data_free(&w.d);
    problem_free(&w.p);
}

#define DRAWS 40
static void parameters_lie_as_far_off_as_they_state(void **state) {
    (void)state;
    struct dice d = {32};
    double square[MATERIAL_N + 1] = {0}, offset2 = 0, p2 = 0;
    int misfits = 0;
    for (int draw = 0; draw < DRAWS; draw++) {
        struct estimate means;
        struct joint joint;
        const double source = U_SOURCE_DEG * dice_normal(&d), sample = U_SAMPLE_DEG * dice_normal(&d);
        const double polarisation = U_P * dice_normal(&d);
        measure(source, sample, polarisation, &d);
        assert_int_equal(estimate_fit(&m.input, &means, NULL), 0);
        assert_int_equal(joint_fit(&m.input, &means, false, &joint, NULL), 0);
        assert_true(joint.converged);
        misfits += joint.misfit;
        for (int p = MATERIAL_SIGMA; p <= MATERIAL_N; p++) {
            square[p] += pow((joint.value[p] - m.value[p]) / joint_u(&joint, p, -1), 2) / DRAWS;
        }
        offset2 += pow((joint.mirror_offset_deg - (source / 2 - sample)) / joint.u_mirror_offset_deg, 2);
        p2 += pow((joint.polarisation - polarisation) / joint.u_polarisation, 2);
        assert_true(joint.u_mirror_offset_deg < 0.8 * U_SAMPLE_DEG && joint.u_polarisation < 0.8 * U_P);
        joint_free(&joint);
    }
    print_message("# the same of the mirror offset %.2f, of P %.2f\n", offset2 / DRAWS, p2 / DRAWS);
    assert_true(offset2 / DRAWS > 0.35 && offset2 / DRAWS < 2.05 && p2 / DRAWS > 0.35 && p2 / DRAWS < 2.05);
    print_message("# mean squares of %d pulls: sigma %.2f, gamma %.2f, beta' %.2f, n %.2f\n", DRAWS,
                  square[MATERIAL_SIGMA], square[MATERIAL_GAMMA], square[MATERIAL_BETA_PRIME],
                  square[MATERIAL_N]);
    for (int p = MATERIAL_SIGMA; p <= MATERIAL_N;
         p++) { /* chi-square of 40 degrees over 40: 1e-4 at each end */
        assert_true(square[p] > 0.35 && square[p] < 2.05);
    }
    assert_true(misfits <= 2);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(it_ends_at_the_minimum_with_the_priors),
        cmocka_unit_test(parameters_lie_as_far_off_as_they_state),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
