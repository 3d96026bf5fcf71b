#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "fit/dice.h"
#include "fit/estimate.h"
#include "fit/reflectance.h"
#include "tests/support/goniometry.h"
#include "tests/support/seed.h"

#define SEED 63
#define RUNS 24

static struct goniometry m;

struct tally { /* over the runs of one case, by parameter */
    int refused, claimed[5], at_bound[5], unknown[5];
    int wrong_limit[5], beyond_2u[5];
    double worst[5]; /* error of a claim, in its u */
};

/* Sampled at theta_i from low to high by 10 deg, theta_v from first by step. */
static void sample(const double *value, double low_deg, double high_deg, double first_deg, double step_deg) {
    const struct reflectance_optics optics = {.kappa = 1, .q = 1};
    goniometry_make(&m, value, 60, 5);
    m.input.n = 0;
    for (double i_deg = low_deg; i_deg <= high_deg; i_deg += 10) {
        for (double v_deg = first_deg; v_deg <= 80; v_deg += step_deg) {
            size_t at = m.input.n++;
            struct reflectance_geometry g;
            m.theta_i_deg[at] = i_deg;
            m.theta_v_deg[at] = v_deg;
            assert_int_equal(reflectance_geometry(&g, i_deg, v_deg, NULL), 0);
            reflectance_eval(REFLECTANCE_COMPOSITE, 1, &g, value, &optics, &m.truth[at], NULL, NULL);
        }
    }
}

static void count(struct tally *t, const struct estimate *estimate, const double *truth) {
    t->refused += !estimate->converged;
    for (int j = 0; j < 5 && estimate->converged; j++) {
        double error = estimate->value[j] - truth[j];
        double u = sqrt(estimate->statistical[j][j] + estimate->common[j][j]);
        if (estimate->not_identifiable[j]) {
            const struct material_gap *gap = &estimate->gap[j];
            assert_true(strlen(gap->why) > 20 && gap->has_next);
            assert_true(fabs(gap->next_theta_v_deg) <= 80 && gap->next_theta_i_deg <= 60);
            t->unknown[j]++;
        } else if (estimate->at_bound[j]) {
            bool from_low = estimate->limit_95[j] > estimate->value[j];
            t->wrong_limit[j] +=
                from_low ? truth[j] > estimate->limit_95[j] : truth[j] < estimate->limit_95[j];
            t->at_bound[j]++;
        } else {
            assert_true(u > 0);
            t->worst[j] = fmax(t->worst[j], fabs(error) / u);
            t->beyond_2u[j] += fabs(error) > 2 * u;
            t->claimed[j]++;
        }
    }
}

/* Whatever is claimed is right within its u, whatever is not is said with its reason and its remedy. */
static struct tally run(const double *truth, struct dice *d) {
    struct tally t = {0};
    for (int k = 0; k < RUNS; k++) {
        struct estimate estimate;
        struct err e = {0};
        goniometry_noise(&m, d);
        if (estimate_fit(&m.input, &estimate, &e)) {
            fail_msg("%s", e.text);
        }
        count(&t, &estimate, truth);
    }
    for (int j = 0; j < 5; j++) {
        print_message("# %d: claimed %d (worst %.1f u, beyond 2 u %d), at bound %d (limit wrong %d), not "
                      "identifiable %d, "
                      "refused %d\n",
                      j, t.claimed[j], t.worst[j], t.beyond_2u[j], t.at_bound[j], t.wrong_limit[j],
                      t.unknown[j], t.refused);
        assert_true(t.worst[j] < 4);
        assert_true(t.beyond_2u[j] <= 3 + t.claimed[j] * 0.15); /* 5 %; one seed in 1,000 has more */
    }
    return t;
}

static void incidence_to_30_deg(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    for (int set = 0; set < GONIOMETRY_SETS; set++) {
        sample(goniometry_set[set], 10, 30, -80, 5);
        struct tally t = run(goniometry_set[set], &d);
        assert_true(t.claimed[MATERIAL_SIGMA] + t.claimed[MATERIAL_GAMMA] > 0.9 * 2 * RUNS);
    }
}

static void incidence_to_10_deg_cannot_tell_n(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    sample(goniometry_set[3], 5, 15, -80, 5);
    struct tally t = run(goniometry_set[3], &d);
    assert_true(t.claimed[MATERIAL_N] == 0 && t.claimed[MATERIAL_BETA_PRIME] == 0);
}

static void one_incidence(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    sample(goniometry_set[0], 40, 40, -80, 5);
    run(goniometry_set[0], &d);
    sample(goniometry_set[3], 40, 40, -80, 5);
    run(goniometry_set[3], &d);
}

/* Half widths of 0.6 deg of viewing angle between samples every 5 deg, none in the mirror direction. */
static void a_lobe_between_the_samples(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    const double sharp[MATERIAL_PARAMETERS] = {0.2, 0.3, 0.005, 100, 1.5};
    sample(sharp, 10, 60, -77.5, 5);
    struct tally t = run(sharp, &d);
    assert_true(t.claimed[MATERIAL_GAMMA] + t.claimed[MATERIAL_N] + t.claimed[MATERIAL_BETA_PRIME] == 0);
    assert_int_equal(t.wrong_limit[MATERIAL_BETA_PRIME],
                     0); /* no limit of what none of the points could see */
}

/* Only the mirror direction itself sees it: its height is known, its width is not. */
static void a_lobe_that_one_sample_sees(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    const double sharp[MATERIAL_PARAMETERS] = {0.2, 0.3, 0.005, 100, 1.5};
    sample(sharp, 10, 60, -80, 5);
    struct tally t = run(sharp, &d);
    assert_int_equal(t.claimed[MATERIAL_GAMMA], 0);
    assert_int_equal(t.wrong_limit[MATERIAL_GAMMA], 0);
}

static void sigma_at_both_ends(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    const double rough[MATERIAL_PARAMETERS] = {0.5, 1.2, 0.2, 4, 1.6},
                 smooth[MATERIAL_PARAMETERS] = {0.2, 0.02, 0.07, 7.6, 1.7};
    sample(rough, 10, 60, -80, 5); /* beyond its bound 1 */
    struct tally t = run(rough, &d);
    assert_true(t.at_bound[MATERIAL_SIGMA] + t.unknown[MATERIAL_SIGMA] > 0.5 * RUNS);
    sample(smooth, 10, 60, -80, 5);
    run(smooth, &d);
}

static void no_lobe_at_all(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    const double matte[MATERIAL_PARAMETERS] = {0.6, 0.4, 0.1, 0, 1.5};
    sample(matte, 10, 60, -80, 5);
    struct tally t = run(matte, &d);
    assert_true(t.claimed[MATERIAL_N] <= 1);
    assert_true(t.claimed[MATERIAL_SIGMA] > 0.8 * (RUNS - t.refused));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(incidence_to_30_deg),
        cmocka_unit_test(incidence_to_10_deg_cannot_tell_n),
        cmocka_unit_test(one_incidence),
        cmocka_unit_test(a_lobe_between_the_samples),
        cmocka_unit_test(a_lobe_that_one_sample_sees),
        cmocka_unit_test(sigma_at_both_ends),
        cmocka_unit_test(no_lobe_at_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
