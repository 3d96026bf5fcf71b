#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <limits.h>
#include <math.h>
#include <mpfr.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "proto/cosine.h"
#include "tests/support/seed.h"

/* Error in units of the last place of the true value. */
static double error_ulp(int32_t udeg) {
    mpfr_t x, pi;
    mpfr_inits2(300, x, pi, (mpfr_ptr)0);
    mpfr_const_pi(pi, MPFR_RNDN);
    mpfr_mul_si(x, pi, udeg, MPFR_RNDN);
    mpfr_div_ui(x, x, 180000000, MPFR_RNDN);
    mpfr_cos(x, x, MPFR_RNDN);
    double truth = mpfr_get_d(x, MPFR_RNDN);
    double ulp = nextafter(fabs(truth), INFINITY) - fabs(truth);
    mpfr_sub_d(x, x, cosine_udeg(udeg), MPFR_RNDN);
    double error = fabs(mpfr_get_d(x, MPFR_RNDN)) / ulp;
    mpfr_clears(x, pi, (mpfr_ptr)0);
    return error;
}

static void within_one_ulp(void **state) {
    (void)state;
    unsigned seed = (unsigned)test_seed((uint64_t)time(NULL));
    double worst = 0;
    for (int i = 0; i < 100000; i++) {
        int32_t udeg = (int32_t)(((int64_t)rand_r(&seed) << 16 ^ rand_r(&seed)) % 400000000) - 200000000;
        double error = error_ulp(udeg);
        if (error >= 1)
            fail_msg("cosine of %d udeg is off by %g ulp", udeg, error);
        worst = fmax(worst, error);
    }
    for (int32_t udeg = -90000000 + 250000; udeg < 90000000; udeg += 250000)
        worst = fmax(worst, error_ulp(udeg));
    for (int32_t near = -50; near <= 50; near++) {
        static const int32_t corner[] = {0, 45000000, 60000000, 90000000, 135000000, 180000000, 360000000};
        for (int i = 0; i < 7; i++)
            if (corner[i] + near != 90000000)
                worst = fmax(worst, error_ulp(corner[i] + near));
    }
    printf("# worst error %.3f ulp\n", worst);
    assert_true(worst < 1);
}

static void exact_where_it_can_be(void **state) {
    (void)state;
    assert_true(cosine_udeg(0) == 1);
    assert_true(cosine_udeg(90000000) == 0 && cosine_udeg(-90000000) == 0 && cosine_udeg(270000000) == 0);
    assert_true(cosine_udeg(180000000) == -1 && cosine_udeg(360000000) == 1);
    assert_true(cosine_udeg(INT32_MIN) >= -1 && cosine_udeg(INT32_MAX) <= 1);
    for (int32_t udeg = 1; udeg < 90000000; udeg += 1234567) {
        assert_true(cosine_udeg(udeg) == cosine_udeg(-udeg));
        assert_true(cosine_udeg(udeg) == -cosine_udeg(180000000 - udeg));
        assert_true(cosine_udeg(udeg) == cosine_udeg(360000000 + udeg));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(within_one_ulp),
                                       cmocka_unit_test(exact_where_it_can_be)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
