/* Commissioning on the simulated bench: a right profile passes, and each wrong one is found before it does harm. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "drivers/commission.h"
#include "proto/profile.h"
#include "proto/units.h"
#include "sim/sim.h"

#define DEG(x) ((int32_t)lround((x)*UDEG_PER_DEG))

static struct clock clock_;
static struct bench bench;
static struct sim_bench *sim;
static struct modbus_link link_;
static struct profile profile;
static struct axis *axis;
static struct commission c;
static struct err err;
static double highest_deg;

static int64_t always_soon(void *self) {
    (void)self;
    return clock_now_us(&clock_) / 10000 * 10000 + 10000;
}

static void look(void *self) {
    (void)self;
    double at = fabs(sim_bench_true_deg(sim, "source"));
    highest_deg = at > highest_deg ? at : highest_deg;
}

static int setup(void **state) {
    (void)state;
    struct err_list errors = {0};
    struct sim_config config;
    err_clear(&err);
    highest_deg = 0;
    axis = NULL;
    clock_init_virtual(&clock_);
    bench_init(&bench, &clock_);
    sim_config_default(&config);
    struct bench_service watch = {.name = "watch", .self = &highest_deg, .due_us = always_soon, .run = look};
    bench_add(&bench, &watch);
    return profile_load("om-az", &profile, &errors) || sim_bench_new(&sim, &config, &clock_, &err) ||
           sim_modbus_link(sim, &link_, &err);
}

static int teardown(void **state) {
    (void)state;
    axis_close(axis);
    modbus_link_close(&link_);
    sim_bench_free(sim);
    return 0;
}

/* A jog by other means than goniod: the raw frame of an absolute move. */
static void jog(double deg) {
    int32_t steps = (int32_t)lround(deg * 100);
    struct modbus_request rq = {.unit = 1, .function = 16, .addr = 0x58, .count = 16};
    const int32_t items[] = {0, 1, steps, 2000, 4000, 4000, 1000, 1};
    for (int i = 0; i < 8; i++) {
        rq.regs[2 * i] = (uint16_t)((uint32_t)items[i] >> 16);
        rq.regs[2 * i + 1] = (uint16_t)items[i];
    }
    assert_int_equal(modbus_link_transact(&link_, &rq, &err), 0);
    for (int i = 0; i < 20; i++) { /* and its watchdog fed */
        bench_wait(&bench, clock_now_us(&clock_) + US_PER_S / 4, NULL, NULL, NULL);
        rq = (struct modbus_request){.unit = 1, .function = 3, .addr = 0x7E, .count = 2};
        assert_int_equal(modbus_link_transact(&link_, &rq, &err), 0);
    }
    highest_deg = 0;
}

static void open_axis(void) {
    struct axis_config config = {.name = "source",
                                 .kind = AXIS_MOTOR,
                                 .profile = &profile,
                                 .unit = 1,
                                 .direction = 1,
                                 .low_udeg = DEG(-70),
                                 .high_udeg = DEG(140)};
    if (axis_open(&axis, &config, &link_, &bench, &err))
        fail_msg("%s", err.text);
    commission_begin(&c, axis, &bench);
}

/* Says yes to everything except, if no_to is not NULL, to the first question that holds it. */
static void converse(const char *no_to) {
    for (int i = 0; i < 20 && !c.over; i++) {
        bool no = no_to && strstr(c.question, no_to);
        if (commission_answer(&c, i == 0 ? "" : no ? "no" : "yes", NULL, &err))
            fail_msg("%s", err.text);
    }
    assert_true(c.over);
    assert_string_equal(c.question, "");
}

static void a_right_profile_passes_and_ends_where_it_began(void **state) {
    (void)state;
    jog(12.34);
    open_axis();
    converse(NULL);
    assert_true(c.passed && c.position_confirmed);
    struct axis_status s;
    axis_status(axis, &s);
    assert_true(s.valid);
    assert_int_equal(s.position_udeg, DEG(12.34));
    assert_true(highest_deg < 12.34 + 3 * COMMISSION_MOVE_DEG + 0.1);
}

static void at_zero_the_words_are_told_apart_by_turning_it(void **state) {
    (void)state;
    open_axis();
    for (int i = 0; i < 4 && !strstr(c.question, "order of the words"); i++)
        assert_int_equal(commission_answer(&c, i ? "yes" : "", NULL, &err), 0);
    assert_non_null(strstr(c.question, "order of the words"));
    assert_int_equal(commission_answer(&c, "yes", NULL, &err), 0);
    assert_non_null(strstr(c.text, "It has not turned."));
    jog(5);
    assert_int_equal(commission_answer(&c, "yes", NULL, &err), 0);
    assert_non_null(strstr(c.question, "5.000 deg"));
}

static void at_zero_the_words_are_told_apart_by_the_limits_of_the_drive(void **state) {
    (void)state;
    /* 0388h, 038Ah: soft limits of 80 and -80 deg, high word first */
    struct modbus_request rq = {
        .unit = 1, .function = 16, .addr = 0x388, .count = 4, .regs = {0, 8000, 0xffff, 0xe0c0}};
    assert_int_equal(modbus_link_transact(&link_, &rq, &err), 0);
    for (int low_first = 0; low_first < 2; low_first++) {
        profile.low_word_first = low_first;
        open_axis();
        for (int i = 0; i < 2; i++)
            assert_int_equal(commission_answer(&c, i ? "yes" : "", NULL, &err), 0);
        assert_non_null(strstr(low_first ? c.text : c.question, low_first ? "order.word" : "0.000 deg"));
        assert_int_equal(c.over, low_first);
        axis_close(axis);
        axis = NULL;
    }
}

/* 5 * 65536 steps: 3277 deg as they are, and next to zero with the words swapped. */
static void limits_far_away_do_not_tell_the_words_apart(void **state) {
    (void)state;
    struct modbus_request rq = {
        .unit = 1, .function = 16, .addr = 0x388, .count = 4, .regs = {5, 0, 0xfffb, 0}};
    assert_int_equal(modbus_link_transact(&link_, &rq, &err), 0);
    open_axis();
    for (int i = 0; i < 2; i++)
        assert_int_equal(commission_answer(&c, i ? "yes" : "", NULL, &err), 0);
    assert_false(c.over);
    assert_non_null(strstr(c.question, "order of the words"));
}

static void a_wrong_word_order_is_found_before_anything_moves(void **state) {
    (void)state;
    jog(12.34);
    profile.low_word_first = 1;
    open_axis();
    converse(NULL);
    assert_false(c.passed);
    assert_non_null(strstr(c.text, "order.word"));
    assert_true(highest_deg < 12.5);
}

static void wrong_status_bits_are_found_at_rest(void **state) {
    (void)state;
    profile.bit[profile.bit_moving].mask = profile.bit[profile.bit_moving].is = 0x4000;
    open_axis();
    converse(NULL);
    assert_false(c.passed);
    assert_non_null(strstr(c.text, "status.moving"));
}

static void a_stop_that_does_not_stop_is_found(void **state) {
    (void)state;
    jog(12.34);
    profile.seq[PROFILE_STOP].step[0].mask = 0x0001;
    open_axis();
    converse(NULL);
    assert_false(c.passed);
    assert_non_null(strstr(c.text, "seq.stop"));
}

static void a_no_ends_it_with_what_to_change(void **state) {
    (void)state;
    static const char *const CASES[][2] = {
        {"where it stands", "zero_deg"},
        {"Is the way clear", "Nothing was moved"},
        {"Did the table turn by", "steps_per_deg"},
        {"angles", "direction: -1"},
        {"no soft limits", "limit switches"},
    };
    jog(12.34);
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        open_axis();
        converse(CASES[i][0]);
        assert_false(c.passed);
        if (!strstr(c.text, CASES[i][1]))
            fail_msg("no to '%s' gives '%s'", CASES[i][0], c.text);
        axis_close(axis);
        axis = NULL;
    }
}

static void an_alarm_has_to_go_first(void **state) {
    (void)state;
    jog(12.34);
    bench_wait(&bench, clock_now_us(&clock_) + 3 * US_PER_S, NULL, NULL,
               NULL); /* nobody feeds the watchdog */
    open_axis();
    converse(NULL);
    assert_false(c.passed);
    assert_non_null(strstr(c.text, "85h"));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(a_right_profile_passes_and_ends_where_it_began),
        TEST(at_zero_the_words_are_told_apart_by_turning_it),
        TEST(at_zero_the_words_are_told_apart_by_the_limits_of_the_drive),
        TEST(limits_far_away_do_not_tell_the_words_apart),
        TEST(a_wrong_word_order_is_found_before_anything_moves),
        TEST(wrong_status_bits_are_found_at_rest),
        TEST(a_stop_that_does_not_stop_is_found),
        TEST(a_no_ends_it_with_what_to_change),
        TEST(an_alarm_has_to_go_first),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
