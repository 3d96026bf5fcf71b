/* The axis driver on the simulated bench, in virtual time: what no fake of one drive can show. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/stage.h"
#include "proto/profile.h"
#include "proto/units.h"
#include "sim/sim_bench.h"

#define DEG(x) ((int32_t)lround((x)*UDEG_PER_DEG))

static const char *const ROLES[] = {"source", "sample", "holder"};
static struct clock clock_;
static struct bench bench;
static struct sim_bench *sim;
static struct sim_config sim_config;
static struct modbus_link link_;
static struct profile profile;
static struct stage stage;
static struct stage_reading reading;
static struct err err;

static int setup(void **state) {
    (void)state;
    struct err_list errors = {0};
    err_clear(&err);
    clock_init_virtual(&clock_);
    bench_init(&bench, &clock_);
    sim_config_default(&sim_config);
    stage = (struct stage){.bench = &bench};
    return profile_load("om-az", &profile, &errors);
}

static void start_sim(void) {
    if (sim_bench_new(&sim, &sim_config, &clock_, &err) || sim_modbus_link(sim, &link_, &err))
        fail_msg("%s", err.text);
}

static int open_axis(int i, bool valid) {
    struct axis_config c = {.kind = AXIS_MOTOR,
                            .profile = &profile,
                            .unit = i + 1,
                            .direction = sim_config.axis[i].direction,
                            .zero_udeg = DEG(sim_config.axis[i].zero_deg),
                            .low_udeg = i == 2 ? DEG(-5) : DEG(-90),
                            .high_udeg = i == 2 ? DEG(185) : DEG(150),
                            .position_valid = valid};
    snprintf(c.name, sizeof c.name, "%s", ROLES[i]);
    return axis_open(&stage.axis[i], &c, &link_, &bench, &err);
}

static void start(void) {
    start_sim();
    for (int i = 0; i < STAGE_AXES; i++)
        if (open_axis(i, true))
            fail_msg("%s", err.text);
}

static int teardown(void **state) {
    (void)state;
    for (int i = 0; i < STAGE_AXES; i++)
        axis_close(stage.axis[i]);
    modbus_link_close(&link_);
    sim_bench_free(sim);
    return 0;
}

static int move(double source, double sample, double holder) {
    struct stage_target t = {.used = {true, true, true}, .udeg = {DEG(source), DEG(sample), DEG(holder)}};
    err_clear(&err);
    return stage_move(&stage, &t, NULL, &reading, &err);
}

static void pass(int64_t us) {
    assert_int_equal(bench_wait(&bench, clock_now_us(&clock_) + us, NULL, NULL, NULL), BENCH_UNTIL);
}

static struct axis_status status(int i) {
    struct axis_status s;
    axis_status(stage.axis[i], &s);
    return s;
}

static void three_axes_on_one_bus_arrive_together(void **state) {
    (void)state;
    start();
    int64_t before = clock_now_us(&clock_);
    assert_int_equal(move(80, 40, 90), 0);
    assert_in_range(clock_now_us(&clock_) - before, 5 * US_PER_S,
                    5400000); /* 90 deg at 20 deg/s, and ramps */
    for (int i = 0; i < STAGE_AXES; i++)
        assert_true(fabs(sim_bench_true_deg(sim, ROLES[i]) - deg_from_udeg(reading.udeg[i])) < 0.06);
}

/* The readback knows nothing of the gear's play: only the approach keeps the table where it says it is. */
static void lost_motion_does_not_show_from_either_side(void **state) {
    (void)state;
    for (int r = 0; r < SIM_AXES; r++) {
        sim_config.axis[r].u_repeat_deg = sim_config.axis[r].u_zero_deg = 0;
        sim_config.axis[r].lost_motion_deg = 0.05;
    }
    start();
    double at[3];
    static const double FROM[] = {0, 60, 30.02};
    for (int k = 0; k < 3; k++) {
        assert_int_equal(move(FROM[k], 0, 0), 0);
        assert_int_equal(move(30, 0, 0), 0);
        assert_int_equal(reading.udeg[0], DEG(30));
        at[k] = sim_bench_true_deg(sim, "source");
    }
    assert_true(fabs(at[1] - at[0]) < 1e-6 && fabs(at[2] - at[0]) < 1e-6);
    profile.backlash_deg = 0; /* and that the bench does have play to be hidden */
    assert_int_equal(move(60, 0, 0), 0);
    assert_int_equal(move(30, 0, 0), 0);
    assert_true(fabs(sim_bench_true_deg(sim, "source") - at[0]) > 0.04);
}

/* The drive counts the other way: the zero is still where it was aligned, reached upwards in the axis' own angle. */
static void the_table_stands_where_it_reads_whichever_way_the_drive_counts(void **state) {
    (void)state;
    for (int r = 0; r < SIM_AXES; r++) {
        sim_config.axis[r].u_repeat_deg = sim_config.axis[r].u_zero_deg = 0;
        sim_config.axis[r].direction = r == STAGE_HOLDER ? 1 : -1;
        sim_config.axis[r].zero_deg = 12.3;
    }
    start();
    static const double FROM[] = {0, 60, 30.02, 29.98};
    for (size_t k = 0; k < sizeof FROM / sizeof *FROM; k++) {
        assert_int_equal(move(FROM[k], FROM[k], FROM[k]), 0);
        assert_int_equal(move(30, 30, 30), 0);
        for (int i = 0; i < STAGE_AXES; i++) {
            double off_deg = sim_bench_true_deg(sim, ROLES[i]) - deg_from_udeg(reading.udeg[i]);
            if (reading.udeg[i] != DEG(30) || fabs(off_deg) > 1e-6)
                fail_msg("%s from %g deg: reads %.4f deg, off by %.4f deg", ROLES[i], FROM[k],
                         deg_from_udeg(reading.udeg[i]), off_deg);
        }
    }
}

static void a_sweep_takes_little_more_than_its_motion(void **state) {
    (void)state;
    start();
    assert_int_equal(move(-60, 0, 0), 0);
    int64_t before = clock_now_us(&clock_), model = 0;
    for (int deg = -55; deg <= 60; deg += 5) {
        assert_int_equal(move(deg, 0, 0), 0);
        model += axis_move_time_us(&profile, DEG(5));
    }
    int64_t took = clock_now_us(&clock_) - before, n = 24;
    int64_t motion = n * 707107; /* 2 sqrt(5 deg / 40 deg/s^2) */
    assert_true(took <= 1.10 * (double)(motion + n * (100000 + 2 * 50000)));
    assert_true(took > motion + n * 100000);
    assert_true(llabs(took - model) < model / 50); /* what the plan promises */
    print_message("# %.3f s a step of 5 deg, motion %.3f s, model %.3f s\n", took * 1e-6 / n,
                  motion * 1e-6 / n, model * 1e-6 / n);
}

static void a_limit_switch_ends_the_move_with_its_alarm(void **state) {
    (void)state;
    sim_config.axis[0].switch_low_deg = -100;
    sim_config.axis[0].switch_high_deg = 50;
    start();
    assert_int_equal(move(100, 20, 0), -ERR_DEVICE);
    assert_non_null(strstr(err.text, "axis source: alarm 66h"));
    assert_non_null(strstr(err.text, "limit switch"));
    assert_true(stage_standstill(&stage));
    assert_int_equal(status(0).phase, AXIS_FAULT);
    assert_int_equal(axis_reset_alarm(stage.axis[0], &err), 0);
    pass(US_PER_S);
    assert_int_equal(status(0).alarm, 0);
    assert_int_equal(move(0, 20, 0), 0);
}

static void a_unit_without_coordinates_has_to_be_homed(void **state) {
    (void)state;
    sim_config.axis[0].no_coordinates = true;
    start_sim();
    assert_int_equal(open_axis(0, true), 0); /* the record is wrong: somebody changed the motor */
    struct stage_target t = {.used = {true}, .udeg = {DEG(30)}};
    assert_int_equal(stage_move(&stage, &t, NULL, &reading, &err), -ERR_DEVICE);
    assert_non_null(strstr(err.text, "4Ah"));
    assert_false(status(0).valid);
    axis_reset_alarm(stage.axis[0], &err);
    pass(US_PER_S);
    err_clear(&err);
    assert_int_equal(stage_move(&stage, &t, NULL, &reading, &err), -ERR_STATE);
    err_clear(&err);
    int homed = stage_home(&stage, STAGE_SOURCE, NULL, &err);
    if (homed)
        fail_msg("%s", err.text);
    assert_true(status(0).valid);
    assert_int_equal(stage_move(&stage, &t, NULL, &reading, &err), 0);
}

static void watchdogs_stay_fed_through_a_long_wait(void **state) {
    (void)state;
    start();
    pass(60 * US_PER_S);
    for (int i = 0; i < STAGE_AXES; i++)
        assert_int_equal(status(i).alarm, 0);
    assert_int_equal(move(30, 10, 0), 0);
    bench.n_services = 0; /* and that they would have bitten */
    pass(2 * US_PER_S);
    struct modbus_request rq = {.unit = 1, .function = 3, .addr = 0x80, .count = 2};
    assert_int_equal(modbus_link_transact(&link_, &rq, &err), 0);
    assert_int_equal(rq.regs[1], 0x85);
}

static void a_mute_unit_fails_by_name_and_the_others_go_on(void **state) {
    (void)state;
    start();
    sim->unit[1].config.mute = true;
    pass(10 * US_PER_S);
    assert_false(status(1).connected);
    assert_true(status(0).connected && status(2).connected);
    assert_int_equal(move(20, 20, 0), -ERR_LINK);
    assert_non_null(strstr(err.text, "sample"));
    struct stage_target t = {.used = {true}, .udeg = {DEG(25)}};
    err_clear(&err);
    assert_int_equal(stage_move(&stage, &t, NULL, &reading, &err), 0);
    for (int i = 0; i < STAGE_AXES; i += 2)
        assert_int_equal(status(i).alarm, 0);
}

static void a_unit_that_falls_silent_in_a_move_ends_it(void **state) {
    (void)state;
    start();
    assert_int_equal(axis_begin_move(stage.axis[0], DEG(140), &err), 0);
    pass(2 * US_PER_S);
    sim->unit[0].config.mute = true;
    pass(6 * US_PER_S);
    assert_int_equal(axis_result(stage.axis[0], &err), -ERR_LINK);
    assert_false(status(0).stop_confirmed);
    sim->unit[0].config.mute = false;
    pass(12 * US_PER_S);
    assert_true(status(0).stop_confirmed && status(0).connected);
}

static void a_stop_order_halts_all_axes_within_their_ramps(void **state) {
    (void)state;
    start();
    for (int i = 0; i < 2; i++)
        assert_int_equal(axis_begin_move(stage.axis[i], DEG(130), &err), 0);
    pass(2 * US_PER_S);
    int64_t before = clock_now_us(&clock_);
    stage_order_stop(&stage);
    assert_int_equal(bench_wait(&bench, before + 5 * US_PER_S, stage_standstill, &stage, NULL), BENCH_DONE);
    assert_true(clock_now_us(&clock_) - before < US_PER_S); /* 20 deg/s at 40 deg/s^2: half a second */
    assert_int_equal(move(0, 0, 0), 0);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(three_axes_on_one_bus_arrive_together),
        TEST(lost_motion_does_not_show_from_either_side),
        TEST(the_table_stands_where_it_reads_whichever_way_the_drive_counts),
        TEST(a_sweep_takes_little_more_than_its_motion),
        TEST(a_limit_switch_ends_the_move_with_its_alarm),
        TEST(a_unit_without_coordinates_has_to_be_homed),
        TEST(watchdogs_stay_fed_through_a_long_wait),
        TEST(a_mute_unit_fails_by_name_and_the_others_go_on),
        TEST(a_unit_that_falls_silent_in_a_move_ends_it),
        TEST(a_stop_order_halts_all_axes_within_their_ramps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
