/* What the axis driver makes of readings that a healthy om-az never gives. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "drivers/axis.h"
#include "proto/profile.h"
#include "proto/units.h"
#include "tests/support/fake_drive.h"

static struct fake_bench fake;
static struct axis *axis;
static struct axis_status status;
static struct err err;

static int setup(void **state) {
    (void)state;
    err_clear(&err);
    axis = NULL;
    return fake_bench_init(&fake);
}

static int teardown(void **state) {
    (void)state;
    axis_close(axis);
    return 0;
}

static void open_axis(void) {
    const struct axis_config config = fake_bench_axis(&fake, "source", 1);
    if (axis_open(&axis, &config, &fake.link, &fake.bench, &err))
        fail_msg("%s", err.text);
}

static int go(double deg) {
    int result = axis_begin_move(axis, udeg_from_deg(deg), &err);
    return result ? result : fake_bench_finish(&fake, axis, &err);
}

/* 4294.97 deg is a whole turn of a 32-bit count of microdegrees: it must not read as 0. */
static void a_reading_far_outside_does_not_wrap_into_the_limits(void **state) {
    (void)state;
    fake.bus.drive[0].from = fake.bus.drive[0].to = 429497;
    open_axis();
    axis_status(axis, &status);
    assert_true(status.position_udeg > udeg_from_deg(1000));
    assert_int_equal(go(10), -ERR_STATE);
    assert_non_null(strstr(err.text, "outside its limits"));
    assert_int_equal(fake.bus.drive[0].orders, 0);
}

/* A map whose status bits lie apart, each needing a frame of its own. */
static void every_scattered_register_is_read(void **state) {
    (void)state;
    for (int i = 0; i < 10; i++) {
        struct profile_reg *reg = &fake.profile.reg[fake.profile.n_regs];
        *reg = (struct profile_reg){.name = "extra", .addr = 0x10 + 3 * i, .type = PROFILE_U16};
        struct profile_bit *bit = &fake.profile.bit[fake.profile.n_bits++];
        *bit = (struct profile_bit){.name = "extra", .reg = fake.profile.n_regs++, .mask = 1, .is = 1};
    }
    open_axis();
    assert_int_equal(go(10), 0);
    axis_status(axis, &status);
    assert_int_equal(status.position_udeg, udeg_from_deg(10));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(a_reading_far_outside_does_not_wrap_into_the_limits),
        TEST(every_scattered_register_is_read),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
