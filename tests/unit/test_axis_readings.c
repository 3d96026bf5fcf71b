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

static struct clock clock_;
static struct bench bench;
static struct fake_bus bus;
static struct modbus_link link_;
static struct profile profile;
static struct axis *axis;
static struct axis_status status;
static struct err err;

static int setup(void **state) {
    (void)state;
    struct err_list errors = {0};
    clock_init_virtual(&clock_);
    clock_advance(&clock_, 1000000);
    bench_init(&bench, &clock_);
    fake_bus_init(&bus, &clock_, &link_);
    err_clear(&err);
    axis = NULL;
    return profile_load("om-az", &profile, &errors);
}

static int teardown(void **state) {
    (void)state;
    axis_close(axis);
    return 0;
}

static void open_axis(void) {
    const struct axis_config config = {.name = "source",
                                       .kind = AXIS_MOTOR,
                                       .profile = &profile,
                                       .unit = 1,
                                       .direction = 1,
                                       .low_udeg = udeg_from_deg(-70),
                                       .high_udeg = udeg_from_deg(140),
                                       .position_valid = true};
    if (axis_open(&axis, &config, &link_, &bench, &err))
        fail_msg("%s", err.text);
}

static bool over(void *arg) {
    return !axis_busy(arg);
}

static int go(double deg) {
    int result = axis_begin_move(axis, udeg_from_deg(deg), &err);
    if (result)
        return result;
    assert_int_equal(bench_wait(&bench, clock_now_us(&clock_) + 60 * US_PER_S, over, axis, NULL), BENCH_DONE);
    return axis_result(axis, &err);
}

/* 4294.97 deg is a whole turn of a 32-bit count of microdegrees: it must not read as 0. */
static void a_reading_far_outside_does_not_wrap_into_the_limits(void **state) {
    (void)state;
    bus.drive[0].from = bus.drive[0].to = 429497;
    open_axis();
    axis_status(axis, &status);
    assert_true(status.position_udeg > udeg_from_deg(1000));
    assert_int_equal(go(10), -ERR_STATE);
    assert_non_null(strstr(err.text, "outside its limits"));
    assert_int_equal(bus.drive[0].orders, 0);
}

/* A map whose status bits lie apart, each needing a frame of its own. */
static void every_scattered_register_is_read(void **state) {
    (void)state;
    for (int i = 0; i < 10; i++) {
        struct profile_reg *reg = &profile.reg[profile.n_regs];
        *reg = (struct profile_reg){.name = "extra", .addr = 0x10 + 3 * i, .type = PROFILE_U16};
        struct profile_bit *bit = &profile.bit[profile.n_bits++];
        *bit = (struct profile_bit){.name = "extra", .reg = profile.n_regs++, .mask = 1, .is = 1};
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
