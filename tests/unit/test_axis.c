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

#define DEG(x) ((int32_t)((x)*UDEG_PER_DEG))

static struct fake_bench fake;
static struct axis *axis;
static struct axis_config config;
static struct axis_status status;
static struct err err;

static int setup(void **state) {
    (void)state;
    err_clear(&err);
    axis = NULL;
    config = fake_bench_axis(&fake, "source", 1);
    return fake_bench_init(&fake);
}

static int teardown(void **state) {
    (void)state;
    axis_close(axis);
    return 0;
}

static void open_axis(void) {
    if (axis_open(&axis, &config, &fake.link, &fake.bench, &err))
        fail_msg("%s", err.text);
}

static void look(void) {
    axis_status(axis, &status);
}

static int finish(void) {
    int result = fake_bench_finish(&fake, axis, &err);
    look();
    return result;
}

static int go(double deg) {
    err_clear(&err);
    int result = axis_begin_move(axis, DEG(deg), &err);
    return result ? result : finish();
}

static void pass(int64_t us) {
    assert_int_equal(bench_wait(&fake.bench, clock_now_us(&fake.clock) + us, NULL, NULL, NULL), BENCH_UNTIL);
    look();
}

static const struct fake_write *last_order(void) {
    for (int i = fake.bus.n_writes - 1; i >= 0; i--)
        if (fake.bus.write[i].addr == 0x58)
            return &fake.bus.write[i];
    fail_msg("no move was ordered");
    return NULL;
}

static int32_t ordered_steps(const struct fake_write *w) {
    return (int32_t)((uint32_t)w->regs[4] << 16 | w->regs[5]);
}

static void a_move_arrives_and_settles(void **state) {
    (void)state;
    open_axis();
    assert_int_equal(go(30), 0);
    assert_int_equal(status.phase, AXIS_IDLE);
    assert_int_equal(status.position_udeg, DEG(30));
    assert_true(status.settled_us <= clock_now_us(&fake.clock));
    assert_int_equal(fake.bus.drive[0].orders, 1);
    assert_int_equal(ordered_steps(last_order()), 3000);
    /* 1.5 s of uniform motion, in position 20 ms later, then settled for the settle time */
    int64_t took = status.settled_us - status.move_start_us;
    assert_in_range(took, 1500000 + 20000 + 100000, 1500000 + 250000);
}

/* Old IN-POS right after the trigger must not count as arrival. */
static void arrival_needs_acceptance(void **state) {
    (void)state;
    open_axis();
    assert_int_equal(axis_begin_move(axis, DEG(10), &err), 0);
    for (int i = 0; i < 100 && fake.bus.drive[0].orders == 0; i++)
        pass(1000);
    pass(1000);
    assert_true(axis_busy(axis));
    assert_int_equal(status.phase, AXIS_MOVING);
    assert_int_equal(finish(), 0);
}

static void every_position_is_reached_from_below(void **state) {
    (void)state;
    open_axis();
    go(30);
    int before = fake.bus.drive[0].orders;
    assert_int_equal(go(20), 0);
    assert_int_equal(fake.bus.drive[0].orders - before, 2);
    assert_int_equal(ordered_steps(last_order()), 2000);
    int second = fake.bus.n_writes - 1;
    while (fake.bus.write[second].addr != 0x58 || ordered_steps(&fake.bus.write[second]) == 2000)
        second--;
    assert_int_equal(ordered_steps(&fake.bus.write[second]), 1990); /* backlash_deg below */
    assert_false(status.other_side);
    before = fake.bus.drive[0].orders;
    assert_int_equal(go(20.05), 0); /* a short way onward needs no second leg */
    assert_int_equal(fake.bus.drive[0].orders - before, 1);
}

static void at_the_limit_it_comes_from_the_other_side_and_says_so(void **state) {
    (void)state;
    config.low_udeg = 0;
    open_axis();
    go(10);
    assert_int_equal(go(0), 0);
    assert_true(status.other_side);
    assert_int_equal(status.position_udeg, 0);
    assert_int_equal(go(5), 0);
    assert_false(status.other_side);
}

static void standing_there_already_costs_nothing(void **state) {
    (void)state;
    open_axis();
    go(30);
    int before = fake.bus.drive[0].orders;
    int64_t settled = status.settled_us, now = clock_now_us(&fake.clock);
    assert_int_equal(go(30), 0);
    assert_true(clock_now_us(&fake.clock) == now);
    assert_int_equal(fake.bus.drive[0].orders, before);
    assert_true(status.settled_us == settled);
}

static void limits_and_unknown_positions_refuse(void **state) {
    (void)state;
    config.position_valid = false;
    open_axis();
    assert_int_equal(axis_begin_move(axis, DEG(141), &err), -ERR_RANGE);
    assert_non_null(strstr(err.text, "140"));
    assert_int_equal(go(10), -ERR_STATE);
    assert_non_null(strstr(err.text, "home"));
    assert_int_equal(fake.bus.drive[0].orders, 0);
    err_clear(&err);
    assert_int_equal(axis_begin_home(axis, &err), 0);
    assert_int_equal(finish(), 0);
    assert_true(status.valid);
    assert_int_equal(go(10), 0);
}

static void direction_and_zero_shift_the_scale(void **state) {
    (void)state;
    config.direction = -1;
    config.zero_udeg = DEG(5);
    open_axis();
    assert_int_equal(go(20), 0);
    assert_int_equal(ordered_steps(last_order()), -2500); /* user = direction * raw - zero */
    assert_int_equal(status.position_udeg, DEG(20));
}

static void a_new_order_while_busy_is_refused(void **state) {
    (void)state;
    open_axis();
    assert_int_equal(axis_begin_move(axis, DEG(10), &err), 0);
    assert_int_equal(axis_begin_move(axis, DEG(20), &err), -ERR_BUSY);
    assert_int_equal(finish(), 0);
    assert_int_equal(status.position_udeg, DEG(10));
}

static void an_ignored_order_is_sent_again(void **state) {
    (void)state;
    open_axis();
    fake.bus.drive[0].ignore_orders = 1;
    assert_int_equal(go(10), 0);
    assert_int_equal(fake.bus.drive[0].orders, 2);
    fake.bus.drive[0].ignore_orders = 9;
    assert_int_equal(go(20), -ERR_DEVICE);
    assert_non_null(strstr(err.text, "does not take"));
    assert_int_equal(status.phase, AXIS_FAULT);
}

static void a_lost_reply_is_settled_by_reading(void **state) {
    (void)state;
    open_axis();
    go(5);
    fake.bus.lose_write_replies = 1; /* the drive has taken the order */
    assert_int_equal(go(15), 0);
    assert_int_equal(fake.bus.drive[0].orders, 2);
    fake.bus.lose_write_replies = 1;
    fake.bus.drive[0].ignore_orders = 1; /* it has not */
    assert_int_equal(go(25), 0);
    assert_int_equal(fake.bus.drive[0].orders, 4);
}

static void a_miss_is_retried_with_the_whole_approach(void **state) {
    (void)state;
    open_axis();
    fake.bus.drive[0].short_by = 20;
    assert_int_equal(go(10), 0);
    assert_int_equal(status.retries, 1);
    assert_int_equal(fake.bus.drive[0].orders, 3);
    assert_int_equal(status.position_udeg, DEG(10));
}

static void a_stuck_motor_is_a_fault_and_is_stopped(void **state) {
    (void)state;
    open_axis();
    fake.bus.drive[0].stuck_at = 500;
    int64_t before = clock_now_us(&fake.clock);
    assert_int_equal(go(30), -ERR_DEVICE);
    assert_non_null(strstr(err.text, "does not move any further"));
    assert_true(clock_now_us(&fake.clock) - before < 3 * US_PER_S);
    assert_int_equal(fake.bus.drive[0].stops, 1);
    assert_true(status.stop_confirmed);
    assert_int_equal(status.phase, AXIS_FAULT);
    fake.bus.drive[0].stuck_at = __builtin_nan("");
    assert_int_equal(go(30), 0);
    assert_int_equal(status.phase, AXIS_IDLE);
}

static void an_alarm_ends_the_move_with_code_text_and_position(void **state) {
    (void)state;
    open_axis();
    assert_int_equal(axis_begin_move(axis, DEG(60), &err), 0);
    pass(US_PER_S);
    fake.bus.drive[0].alarm = 0x30;
    assert_int_equal(finish(), -ERR_DEVICE);
    assert_non_null(strstr(err.text, "30h"));
    assert_non_null(strstr(err.text, "overload"));
    assert_non_null(strstr(err.text, "deg"));
    assert_int_equal(status.alarm, 0x30);
    assert_int_equal(go(10), -ERR_DEVICE);
    err_clear(&err);
    assert_int_equal(axis_reset_alarm(axis, &err), 0);
    assert_int_equal(finish(), 0);
    assert_int_equal(status.alarm, 0);
    assert_true(status.valid);
    assert_int_equal(go(10), 0);
}

static void alarm_4a_revokes_the_position(void **state) {
    (void)state;
    open_axis();
    fake.bus.drive[0].alarm = 0x4A;
    pass(US_PER_S);
    assert_false(status.valid);
    axis_reset_alarm(axis, &err);
    assert_int_equal(finish(), 0);
    assert_int_equal(go(10), -ERR_STATE);
}

static void a_stop_ends_the_order_at_once(void **state) {
    (void)state;
    open_axis();
    assert_int_equal(axis_begin_move(axis, DEG(60), &err), 0);
    pass(US_PER_S);
    axis_order_stop(axis);
    assert_int_equal(fake.bus.drive[0].stops, 1);
    assert_true(fake.bus.write[fake.bus.n_writes - 1].urgent);
    look();
    assert_false(status.stop_confirmed);
    assert_int_equal(finish(), -ERR_CANCELLED);
    assert_true(status.stop_confirmed && axis_stands(axis));
    assert_int_equal(fake.bus.drive[0].command, 0); /* not left latched */
    assert_int_equal(go(10), 0);
}

static void a_stop_while_disconnected_is_sent_at_the_reconnect(void **state) {
    (void)state;
    open_axis();
    assert_int_equal(axis_begin_move(axis, DEG(130), &err), 0);
    pass(US_PER_S);
    fake_disconnect(&fake.bus, clock_now_us(&fake.clock) + 2 * US_PER_S);
    pass(US_PER_S);
    assert_false(status.connected || status.valid || status.stop_confirmed);
    int connects = fake.bus.connects;
    axis_order_stop(axis);
    assert_int_equal(fake.bus.connects, connects + 1); /* one attempt, at once */
    look();
    assert_false(status.stop_confirmed);
    assert_int_equal(fake.bus.drive[0].stops, 0);
    pass(1500000);
    assert_int_equal(fake.bus.drive[0].stops, 1);
    assert_true(status.stop_confirmed && status.connected);
}

static void a_link_lost_in_a_move_ends_it_and_stops_once(void **state) {
    (void)state;
    open_axis();
    assert_int_equal(axis_begin_move(axis, DEG(130), &err), 0);
    pass(US_PER_S);
    fake_disconnect(&fake.bus, clock_now_us(&fake.clock) + 3 * US_PER_S);
    pass(US_PER_S);
    assert_int_equal(axis_result(axis, &err), -ERR_LINK);
    assert_non_null(strstr(err.text, "during a move"));
    pass(4 * US_PER_S);
    assert_int_equal(fake.bus.drive[0].stops, 1);
    assert_true(status.connected && status.stop_confirmed);
    assert_int_equal(status.phase, AXIS_FAULT);
    assert_int_equal(fake.bus.drive[0].orders, 1); /* nothing resumes by itself */
    assert_int_equal(go(20), 0);
}

static void one_lost_reply_does_not_end_a_move(void **state) {
    (void)state;
    open_axis();
    assert_int_equal(axis_begin_move(axis, DEG(60), &err), 0);
    pass(US_PER_S);
    fake.bus.lose_replies = 2;
    assert_int_equal(finish(), 0);
    assert_int_equal(status.position_udeg, DEG(60));
}

static void a_mute_unit_is_told_apart_and_does_not_starve_the_other(void **state) {
    (void)state;
    open_axis();
    struct axis *sample;
    struct axis_config second = config;
    strcpy(second.name, "sample");
    second.unit = 2;
    assert_int_equal(axis_open(&sample, &second, &fake.link, &fake.bench, &err), 0);
    fake.bus.drive[0].mute = true;
    pass(20 * US_PER_S);
    assert_false(status.connected);
    fake.bus.drive[1].longest_gap_us = 0;
    pass(20 * US_PER_S);
    assert_true(fake.bus.drive[1].longest_gap_us <= 600000); /* quarantine plus a poll interval */
    assert_int_equal(axis_begin_move(axis, DEG(1), &err), -ERR_LINK);
    fake.bus.drive[0].mute = false;
    pass(12 * US_PER_S);
    assert_true(status.connected);
    axis_close(sample);
}

static void polls_feed_the_watchdog(void **state) {
    (void)state;
    open_axis();
    pass(10 * US_PER_S);
    assert_in_range(fake.bus.drive[0].longest_gap_us, 1, 250000);
    assert_in_range(fake.bus.drive[0].polls, 40, 60);
}

static void a_hand_that_turns_the_axis_unsettles_it(void **state) {
    (void)state;
    open_axis();
    go(30);
    pass(US_PER_S);
    int64_t settled = status.settled_us, turned_us = clock_now_us(&fake.clock);
    fake.bus.drive[0].from = fake.bus.drive[0].to = 3100;
    pass(260000);
    assert_true(status.settled_us == CLOCK_NEVER);
    pass(US_PER_S);
    assert_int_equal(status.position_udeg, DEG(31));
    assert_true(status.settled_us > turned_us && status.settled_us != settled);
    assert_int_equal(go(30), 0);
    assert_int_equal(status.position_udeg, DEG(30));
}

static void an_axis_nobody_moves_settles_where_it_stands(void **state) {
    (void)state;
    open_axis();
    look();
    assert_true(status.settled_us == CLOCK_NEVER);
    pass(US_PER_S);
    assert_true(status.settled_us < clock_now_us(&fake.clock));
    int orders = fake.bus.drive[0].orders;
    assert_int_equal(go(0), 0); /* from which side it came there is not known */
    assert_int_equal(fake.bus.drive[0].orders, orders + 2);
}

static void a_missing_unit_and_an_alarm_are_said_at_opening(void **state) {
    (void)state;
    fake.bus.drive[0].mute = true;
    assert_int_equal(axis_open(&axis, &config, &fake.link, &fake.bench, &err), -ERR_TIMEOUT);
    assert_non_null(strstr(err.text, "unit number"));
    assert_null(axis);
    err_clear(&err);
    fake.bus.drive[0].mute = false;
    fake.bus.drive[0].alarm = 0x85;
    open_axis();
    look();
    assert_int_equal(status.phase, AXIS_FAULT);
    assert_non_null(strstr(status.alarm_text, "watchdog"));
}

static void manual_and_fixed_axes(void **state) {
    (void)state;
    config.kind = AXIS_MANUAL;
    config.profile = NULL;
    open_axis();
    look();
    assert_true(status.read_us == INT64_MIN);
    assert_int_equal(axis_begin_move(axis, DEG(30), &err), 0);
    look();
    assert_int_equal(status.phase, AXIS_WAITING_PERSON);
    assert_true(axis_busy(axis));
    axis_confirm(axis, DEG(30));
    assert_int_equal(finish(), 0);
    assert_int_equal(status.position_udeg, DEG(30));
    assert_int_equal(go(30), 0);
    assert_int_equal(axis_begin_home(axis, &err), -ERR_STATE);
    assert_int_equal(axis_begin_move(axis, DEG(40), &err), 0);
    axis_order_stop(axis);
    assert_int_equal(finish(), -ERR_CANCELLED);
    axis_close(axis);
    config.kind = AXIS_FIXED;
    config.fixed_udeg = DEG(45);
    open_axis();
    err_clear(&err);
    assert_int_equal(go(45), 0);
    assert_int_equal(axis_begin_move(axis, DEG(44), &err), -ERR_RANGE);
    assert_true(axis_stands(axis));
}

static void the_time_model_is_the_drivers(void **state) {
    (void)state;
    /* 20 deg/s, 40 deg/s^2: 5 deg is a triangle of 2 sqrt(5/40) s, 40 deg a trapezoid of 2.5 s */
    int64_t settle = 150000;
    assert_int_equal(axis_move_time_us(&fake.profile, DEG(5)), 707107 + settle);
    assert_int_equal(axis_move_time_us(&fake.profile, DEG(40)), 2500000 + settle);
    assert_int_equal(axis_move_time_us(&fake.profile, 0), 0);
    assert_true(axis_move_time_us(&fake.profile, DEG(-5)) >
                axis_move_time_us(&fake.profile, DEG(5)) + 100000);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(a_move_arrives_and_settles),
        TEST(arrival_needs_acceptance),
        TEST(every_position_is_reached_from_below),
        TEST(at_the_limit_it_comes_from_the_other_side_and_says_so),
        TEST(standing_there_already_costs_nothing),
        TEST(limits_and_unknown_positions_refuse),
        TEST(direction_and_zero_shift_the_scale),
        TEST(a_new_order_while_busy_is_refused),
        TEST(an_ignored_order_is_sent_again),
        TEST(a_lost_reply_is_settled_by_reading),
        TEST(a_miss_is_retried_with_the_whole_approach),
        TEST(a_stuck_motor_is_a_fault_and_is_stopped),
        TEST(an_alarm_ends_the_move_with_code_text_and_position),
        TEST(alarm_4a_revokes_the_position),
        TEST(a_stop_ends_the_order_at_once),
        TEST(a_stop_while_disconnected_is_sent_at_the_reconnect),
        TEST(a_link_lost_in_a_move_ends_it_and_stops_once),
        TEST(one_lost_reply_does_not_end_a_move),
        TEST(a_mute_unit_is_told_apart_and_does_not_starve_the_other),
        TEST(polls_feed_the_watchdog),
        TEST(a_hand_that_turns_the_axis_unsettles_it),
        TEST(an_axis_nobody_moves_settles_where_it_stands),
        TEST(a_missing_unit_and_an_alarm_are_said_at_opening),
        TEST(manual_and_fixed_axes),
        TEST(the_time_model_is_the_drivers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
