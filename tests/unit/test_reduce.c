#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/support/flat_bench.h"

static void a_ratio_by_hand(void **state) {
    (void)state;
    struct fixture f;
    start(&f, FLAT);
    begin(&f);
    give_flat(&f, EXPOSURE_DARK, 100, 0, 0);
    give_flat(&f, EXPOSURE_REFERENCE, 40100, 0, 1);
    give_sample(&f, 10100, 45, 0, 1);
    const struct point *p = last_point(&f);
    /* 0.9 * (10100 - 100) / (40100 - 100), K = 1 */
    near(p->beta[BAND_550], 0.225, 1e-14);
    near(p->mean, 0.225, 1e-14);
    assert_true(p->provisional && p->supersedes == 0 && p->bracket == 1);
    assert_int_equal(p->theta_i_udeg, 45000000);
    near(p->tau_us, 10e6, 1e-12);
    for (int band = 0; band < BANDS; band++)
        assert_true(p->present[band]);
    /* certificate: 0.018 at k = 2 of 0.9 is 1 % */
    near(common(p, "certificate")->sensitivity[10], 0.225 * 0.01, 1e-12);
    near(common(p, "certificate")->mean, 0.225 * 0.01, 1e-12);
    finish(&f);
}

static void noise_by_hand(void **state) {
    (void)state;
    struct fixture f;
    start(&f, FLAT);
    f.setup.calibration.read_noise_counts = 30;
    f.setup.calibration.electrons_per_count = 2;
    begin(&f);
    give_flat(&f, EXPOSURE_DARK, 0, 0, 0);
    give_flat(&f, EXPOSURE_REFERENCE, 40000, 0, 1);
    give_sample(&f, 10000, 45, 0, 1);
    const struct point *p = last_point(&f);
    /* 39 pixels 0.25 nm apart below a triangle of 5 nm: sum w^2 / (sum w)^2 = (2 * sum_1^19 k^2 + 400) / 400^2 */
    double squares = 400;
    for (int k = 1; k < 20; k++)
        squares += 2.0 * k * k;
    double share = squares / (400.0 * 400.0), electric2 = 900.0 / (10 * 2);
    double factor = 0.225 / 10000;
    near(p->u_ind[40], factor * sqrt((900 + 10000 / 2.0) / 2 * share + electric2), 1e-12);
    near(common(p, "reference/2")->sensitivity[40],
         -0.225 / 40000 * sqrt((900 + 20000.0) / 2 * share + electric2), 1e-12);
    /* The dark is under both: -1 on the sample, + beta/beta_ref on the reference. */
    near(common(p, "dark/1")->sensitivity[40],
         (-factor + 0.225 / 40000) * sqrt(900.0 / 2 * share + electric2), 1e-12);
    double neighbours = 0;
    for (int k = 1; k < 20; k++)
        neighbours += k * (20.0 - k);
    near(p->cov_next[40], factor * factor * (5900.0 / 2 * neighbours / 160000 + electric2), 1e-12);
    /* 61 bands of the mean: all covariances between neighbours, the electric dark in all of them. */
    double mean2 = (61 * 2950 * share + 2 * 60 * 2950 * neighbours / 160000) / (61 * 61) + electric2;
    near(p->mean_u_ind, factor * sqrt(mean2), 1e-12);
    finish(&f);
}

static void scale_and_linearity(void **state) {
    (void)state;
    struct fixture f;
    start(&f, FLAT);
    struct calibration *c = &f.setup.calibration;
    c->saturation = 50000;
    c->nonlinearity[0] = 1;
    c->nonlinearity[1] = -1e-6;
    c->nonlinearity_order = 1;
    c->nonlinearity_used = true;
    f.setup.without_dark = true;
    begin(&f);
    give_flat(&f, EXPOSURE_REFERENCE, 40000, 0, 1);
    give_sample(&f, 10000, 45, 0, 1);
    double s = 10000 * 65535.0 / 50000, r = 4 * s;
    near(last_point(&f)->beta[7], 0.9 * (s / (1 - 1e-6 * s)) / (r / (1 - 1e-6 * r)), 1e-13);
    assert_int_equal(last_point(&f)->n_common, 2); /* certificate, reference: no dark was taken */
    finish(&f);
}

static void filling_and_time_by_hand(void **state) {
    (void)state;
    for (int beam_in_view = 0; beam_in_view < 2; beam_in_view++) {
        struct fixture f;
        struct exposure x;
        start(&f, FLAT);
        f.setup.beam_in_view = beam_in_view;
        f.setup.without_dark = true;
        begin(&f);
        give_flat(&f, EXPOSURE_REFERENCE, 40000, 0, 1);
        flat_exposure(&f, &x, EXPOSURE_SAMPLE, 10000);
        x.bracket = 1;
        x.exposure_us = 400000;
        x.theta_i_udeg = 60000000;
        x.theta_v_udeg = -30000000;
        x.mirrored = true;
        x.source_udeg = -30000000;
        x.sample_udeg = 30000000;
        assert_int_equal(give(&f, &x), 0);
        double k = beam_in_view ? 1 / cos(M_PI / 6) : cos(M_PI / 4) / 0.5;
        near(last_point(&f)->beta[3], 0.9 * 0.25 * k / 4, 1e-14);
        assert_int_equal(last_point(&f)->theta_i_udeg, 60000000);
        assert_int_equal(last_point(&f)->theta_v_udeg, -30000000);
        finish(&f);
    }
}

static void weak_or_uncertified_bands_are_missing(void **state) {
    (void)state;
    struct fixture f;
    struct exposure x;
    start(&f, "# geometry: 45:0\n# k: 1\nlambda_nm,beta,u\n500,0.9,0.009\n900,0.9,0.009\n");
    f.setup.without_dark = true;
    f.setup.calibration.read_noise_counts = 30;
    begin(&f);
    flat_exposure(&f, &x, EXPOSURE_REFERENCE, 40000);
    for (int p = 0; p < 2 * PIXELS; p++)
        if (p % PIXELS > (600 - 340) * 4)
            x.counts[p] = OFFSET + 20;
    x.opens = 1;
    x.control = true;
    assert_int_equal(give(&f, &x), 0);
    give_sample(&f, 10000, 45, 0, 1);
    const struct point *p = last_point(&f);
    for (int band = 0; band < BANDS; band++) {
        bool expected = band_nm(band) >= 500 && band_nm(band) <= 600;
        assert_int_equal(p->present[band], expected);
        assert_int_equal(isnan(p->beta[band]), !expected);
    }
    assert_true(isnan(p->mean) && isnan(p->mean_u_ind) && isnan(p->common[0].mean));
    assert_true(p->cov_next[(600 - 380) / 5] == 0 && p->cov_next[(595 - 380) / 5] > 0);
    finish(&f);
}

static void stated_parts_by_hand(void **state) {
    (void)state;
    struct fixture f;
    start(&f,
          "# geometry: 8:di\n# k: 1\n# correlation_nm: 5\nlambda_nm,beta,u\n300,0.9,0.009\n900,0.9,0.009\n");
    f.setup.without_dark = true;
    f.setup.angular_u_rel = 0.03;
    f.setup.stray_light_rel = 1e-3;
    f.setup.linearity_rel = 2e-3;
    f.setup.bench_stray_beta = 1e-4;
    begin(&f);
    give_flat(&f, EXPOSURE_REFERENCE, 40000, 0, 1);
    give_sample(&f, 10000, 45, 0, 1);
    const struct point *p = last_point(&f);
    near(common(p, "angular/45000000/0")->mean, 0.225 * 0.03, 1e-12);
    assert_true(fabs(common(p, "stray")->mean) < 1e-15); /* flat spectra: the same share of both */
    near(common(p, "linearity")->mean, 0.225 * 2e-3 * (10000 - 40000) / 65535, 1e-12);
    near(common(p, "bench_stray")->mean, 1e-4 * (1 - 0.225 / 0.9), 1e-12);
    double sum = 0;
    for (int i = 0; i < 61; i++)
        for (int j = 0; j < 61; j++)
            sum += exp(-abs(i - j));
    near(common(p, "certificate")->mean, 0.225 * 0.01 * sqrt(sum) / 61, 1e-12);
    near(common(p, "certificate")->sensitivity[3], 0.225 * 0.01, 1e-12);
    finish(&f);
}

static void the_peak_of_a_raw_scan(void **state) {
    (void)state;
    struct fixture f;
    struct exposure x;
    start(&f, FLAT);
    f.setup.calibration.saturation = 61000;
    flat_exposure(&f, &x, EXPOSURE_SAMPLE, 30000);
    x.counts[15] = 65000; /* not an active pixel */
    near(reduce_peak(&f.setup.calibration, x.counts), 0.5, 1e-13);
    certificate_free(&f.certificate);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_ratio_by_hand),
        cmocka_unit_test(noise_by_hand),
        cmocka_unit_test(scale_and_linearity),
        cmocka_unit_test(filling_and_time_by_hand),
        cmocka_unit_test(weak_or_uncertified_bands_are_missing),
        cmocka_unit_test(stated_parts_by_hand),
        cmocka_unit_test(the_peak_of_a_raw_scan),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
