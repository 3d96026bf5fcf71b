/* The axis driver in real time against goniosim's buses, TCP and RTU: the time a step takes, how fast a stop is out,
 * and a simulator that hangs or dies in the middle of a move. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>

#include "drivers/stage.h"
#include "proto/profile.h"
#include "proto/units.h"
#include "tests/support/kept.h"
#include "tests/support/sim_process.h"

#define DEG(x) ((int32_t)lround((x)*UDEG_PER_DEG))
#define STEPS 2

static struct sim_process sim;
static struct clock clock_;
static struct bench bench;
static struct modbus_link link_;
static struct profile profile;
static struct stage stage;
static struct stage_reading reading;
static struct err err;

#define BENCH "modbus: [\"tcp:0\", rtu]\nlamp: {warm_up_min: 0}\n"

static int start(const char *yaml) {
    struct err_list errors = {0};
    err_clear(&err);
    stage = (struct stage){.bench = &bench};
    return profile_load("om-az", &profile, &errors) || !sim_process_start(&sim, yaml);
}

static int setup(void **state) {
    (void)state;
    return start(BENCH SIM_PROCESS_PATIENT_AXES);
}

static int teardown(void **state) {
    (void)state;
    for (int i = 0; i < STAGE_AXES; i++)
        axis_close(stage.axis[i]);
    modbus_link_close(&link_);
    sim_process_stop(&sim, SIGTERM);
    return 0;
}

static void open_stage(int bus) {
    static const char *const ROLES[] = {"source", "sample", "holder"};
    struct modbus_link_config config = {.target = sim.modbus[bus],
                                        .baud = profile.link.baud,
                                        .parity = 'N',
                                        .data_bits = 8,
                                        .stop_bits = 1,
                                        .response_ms = profile.link.response_ms,
                                        .gap_ms = profile.link.gap_ms,
                                        .quarantine_ms = profile.link.quarantine_ms};
    clock_init_real(&clock_);
    bench_init(&bench, &clock_);
    if (modbus_link_open(&link_, &config, &clock_, &err))
        fail_msg("%s", err.text);
    for (int i = 0; i < STAGE_AXES; i++) {
        struct axis_config c = {.kind = AXIS_MOTOR,
                                .profile = &profile,
                                .unit = i + 1,
                                .direction = 1,
                                .low_udeg = DEG(-90),
                                .high_udeg = DEG(185),
                                .position_valid = true};
        snprintf(c.name, sizeof c.name, "%s", ROLES[i]);
        for (int tries = 0; axis_open(&stage.axis[i], &c, &link_, &bench, &err); tries++) {
            if (tries == KEPT_TRIES || err.code != ERR_TIMEOUT) /* else the machine stood still */
                fail_msg("%s", err.text);
            err_clear(&err);
            bench_wait(&bench, clock_stamp(&clock_) + US_PER_S, NULL, NULL, NULL);
        }
    }
}

static int move(double source, double sample) {
    struct stage_target t = {.used = {true, true}, .udeg = {DEG(source), DEG(sample)}};
    err_clear(&err);
    return stage_move(&stage, &t, NULL, &reading, &err);
}

/* Motion, settle and two polls, and a tenth on top. */
static void steps_on(int bus) {
    open_stage(bus);
    assert_int_equal(move(1, 1), 0);
    const double allowed_s = 2 * sqrt(5.0 / 40) + 0.1 + 2 * 0.05;
    int64_t took_us;
    int tries = 0, at = 1;
    do {
        int64_t before = clock_stamp(&clock_);
        for (int i = 0; i < STEPS; i++) {
            assert_int_equal(move(at += 5, 1), 0);
            assert_int_equal(reading.udeg[0], DEG(at));
        }
        took_us = (clock_stamp(&clock_) - before) / STEPS;
    } while (!kept(&tries, link_.name, took_us, (int64_t)(1.10e6 * allowed_s)));
    for (int i = 0; i < STAGE_AXES; i++) {
        struct axis_status s;
        axis_status(stage.axis[i], &s);
        assert_int_equal(s.alarm, 0);
    }
}

static void steps_over_tcp(void **state) {
    (void)state;
    steps_on(0);
}

static void steps_over_rtu(void **state) {
    (void)state;
    steps_on(1);
}

/* Moves two axes a short while to the side given and stops them. */
static int64_t stop_in_a_move(int side) {
    for (int i = 0; i < 2; i++) {
        err_clear(&err);
        assert_int_equal(axis_begin_move(stage.axis[i], DEG(side < 0 ? -85 : 150), &err), 0);
    }
    bench_wait(&bench, clock_stamp(&clock_) + 700000, NULL, NULL, NULL);
    int64_t before = clock_stamp(&clock_);
    stage_order_stop(&stage);
    int64_t took_us = clock_stamp(&clock_) - before;
    assert_int_equal(bench_wait(&bench, clock_stamp(&clock_) + 20 * US_PER_S, stage_standstill, &stage, NULL),
                     BENCH_DONE);
    return took_us;
}

static void stop_orders_on(int bus) {
    open_stage(bus);
    int tries = 0, side = 1;
    while (!kept(&tries, "three stop orders", stop_in_a_move(side), 250000))
        side = -side;
}

static void stop_orders_are_out_at_once_over_tcp(void **state) {
    (void)state;
    stop_orders_on(0);
}

static void stop_orders_are_out_at_once_over_rtu(void **state) {
    (void)state;
    stop_orders_on(1);
}

static bool connected_and_standing(void *arg) {
    struct axis_status s;
    axis_status(arg, &s);
    return s.connected && s.stop_confirmed && axis_stands(arg);
}

static bool lost(void *arg) {
    struct axis_status s;
    axis_status(arg, &s);
    return !s.connected;
}

/* The process stands still: its clock goes on, its drives' watchdogs bite, its replies are late. */
static void a_simulator_that_hangs_in_a_move(void **state) {
    (void)state;
    open_stage(0);
    assert_int_equal(axis_begin_move(stage.axis[0], DEG(150), &err), 0);
    bench_wait(&bench, clock_stamp(&clock_) + 600000, NULL, NULL, NULL);
    kill(sim.pid, SIGSTOP);
    int64_t hung_us = clock_stamp(&clock_);
    assert_int_equal(bench_wait(&bench, clock_stamp(&clock_) + 60 * US_PER_S, lost, stage.axis[0], NULL),
                     BENCH_DONE);
    assert_int_equal(axis_result(stage.axis[0], &err), -ERR_LINK);
    int64_t took_us;
    int tries = 0;
    do {
        int64_t before = clock_stamp(&clock_);
        axis_order_stop(stage.axis[0]);
        took_us = clock_stamp(&clock_) - before;
    } while (!kept(&tries, "a stop order to nobody", took_us, profile.link.response_ms * US_PER_MS + 350000));
    struct axis_status s;
    axis_status(stage.axis[0], &s);
    assert_false(s.stop_confirmed);
    bench_wait(&bench, hung_us + (SIM_PROCESS_WATCHDOG_MS + 500) * US_PER_MS, NULL, NULL, NULL);
    kill(sim.pid, SIGCONT);
    assert_int_equal(
        bench_wait(&bench, clock_stamp(&clock_) + 60 * US_PER_S, connected_and_standing, stage.axis[0], NULL),
        BENCH_DONE);
}

static void a_simulator_that_dies_in_a_move(void **state) {
    (void)state;
    open_stage(1);
    assert_int_equal(axis_begin_move(stage.axis[0], DEG(150), &err), 0);
    bench_wait(&bench, clock_stamp(&clock_) + 600000, NULL, NULL, NULL);
    sim_process_stop(&sim, SIGKILL);
    assert_int_equal(bench_wait(&bench, clock_stamp(&clock_) + 60 * US_PER_S, lost, stage.axis[0], NULL),
                     BENCH_DONE);
    assert_int_equal(axis_result(stage.axis[0], &err), -ERR_LINK);
    assert_non_null(strstr(err.text, "during a move"));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(steps_over_tcp),
        TEST(steps_over_rtu),
        TEST(stop_orders_are_out_at_once_over_tcp),
        TEST(stop_orders_are_out_at_once_over_rtu),
        TEST(a_simulator_that_hangs_in_a_move),
        TEST(a_simulator_that_dies_in_a_move),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
