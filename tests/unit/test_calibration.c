#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "proto/calibration.h"

static void wavelengths_are_a_cubic(void **state) {
    (void)state;
    struct calibration c = {.wavelength = {340, 0.38, -1.2e-5, -2e-9}};
    assert_true(calibration_lambda_nm(&c, 0) == 340);
    double p = 1000;
    assert_true(fabs(calibration_lambda_nm(&c, 1000) - (340 + 0.38 * p - 1.2e-5 * p * p - 2e-9 * p * p * p)) <
                1e-10);
}

static void a_sound_polynomial_is_used(void **state) {
    (void)state;
    struct calibration c = {.nonlinearity = {0.9, 4e-6, -1e-11}, .nonlinearity_order = 2};
    calibration_judge_nonlinearity(&c);
    assert_true(c.nonlinearity_used);
}

static void an_absurd_polynomial_is_not(void **state) {
    (void)state;
    const struct calibration wrong[] = {
        {.nonlinearity = {0}, .nonlinearity_order = 7},         /* not programmed */
        {.nonlinearity = {NAN, 1e-6}, .nonlinearity_order = 1}, /* no number */
        {.nonlinearity = {1, INFINITY}, .nonlinearity_order = 1},
        {.nonlinearity = {1.6}, .nonlinearity_order = 0},      /* P(0) */
        {.nonlinearity = {1, -2e-5}, .nonlinearity_order = 1}, /* zero at 50,000 counts */
        {.nonlinearity = {1}, .nonlinearity_order = 8},        /* more than there is room for */
        {.nonlinearity = {1}, .nonlinearity_order = -1},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        struct calibration c = wrong[i];
        c.nonlinearity_used = true;
        calibration_judge_nonlinearity(&c);
        assert_false(c.nonlinearity_used);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(wavelengths_are_a_cubic),
        cmocka_unit_test(a_sound_polynomial_is_used),
        cmocka_unit_test(an_absurd_polynomial_is_not),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
