#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "proto/bands.h"
#include "proto/units.h"

static void microdegrees_round_to_nearest(void **state) {
    (void)state;
    assert_int_equal(udeg_from_deg(0.1), 100000);
    assert_int_equal(udeg_from_deg(-80.0000005), -80000001); /* half away from zero */
    assert_int_equal(udeg_from_deg(1999.9999994), 1999999999);
    for (int32_t udeg = -180000000; udeg <= 180000000; udeg += 7654321)
        assert_int_equal(udeg_from_deg(deg_from_udeg(udeg)), udeg);
}

static void degrees_and_radians(void **state) {
    (void)state;
    assert_true(fabs(rad_from_deg(180) - M_PI) < 1e-15);
    assert_true(fabs(deg_from_rad(M_PI_2) - 90) < 1e-13);
}

static void bands_run_from_380_to_780_nm(void **state) {
    (void)state;
    assert_int_equal(band_nm(0), 380);
    assert_int_equal(band_nm(BANDS - 1), 780);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(microdegrees_round_to_nearest),
        cmocka_unit_test(degrees_and_radians),
        cmocka_unit_test(bands_run_from_380_to_780_nm),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
