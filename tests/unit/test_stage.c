#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "drivers/stage.h"
#include "proto/profile.h"
#include "proto/units.h"
#include "tests/support/fake_drive.h"

#define DEG(x) ((int32_t)((x)*UDEG_PER_DEG))

static struct fake_bench fake;
static struct stage stage;
static struct stage_reading reading;
static struct err err;

static int setup(void **state) {
    (void)state;
    static const char *const NAMES[] = {"source", "sample", "holder"};
    err_clear(&err);
    stage = (struct stage){.bench = &fake.bench};
    if (fake_bench_init(&fake))
        return -1;
    for (int i = 0; i < STAGE_AXES; i++) {
        struct axis_config c = fake_bench_axis(&fake, NAMES[i], i + 1);
        if (axis_open(&stage.axis[i], &c, &fake.link, &fake.bench, &err))
            return -1;
    }
    return 0;
}

static int teardown(void **state) {
    (void)state;
    for (int i = 0; i < STAGE_AXES; i++)
        axis_close(stage.axis[i]);
    return 0;
}

static struct stage_target to(double source, double sample) {
    return (struct stage_target){.used = {true, true}, .udeg = {DEG(source), DEG(sample)}};
}

static int move(double source, double sample) {
    struct stage_target t = to(source, sample);
    err_clear(&err);
    return stage_move(&stage, &t, NULL, &reading, &err);
}

static void axes_move_at_the_same_time(void **state) {
    (void)state;
    int64_t before = clock_now_us(&fake.clock);
    assert_int_equal(move(40, 40), 0);
    int64_t took = clock_now_us(&fake.clock) - before;
    assert_in_range(took, 2 * US_PER_S, 2400000); /* 40 deg at 20 deg/s, once */
    assert_int_equal(reading.udeg[STAGE_SOURCE], DEG(40));
    assert_int_equal(reading.udeg[STAGE_SAMPLE], DEG(40));
    assert_int_equal(fake.bus.drive[STAGE_HOLDER].orders, 0);
    assert_true(reading.settled_us <=
                clock_now_us(&fake.clock)); /* with the holder, which stood all the time */
    assert_true(reading.read_us <= clock_now_us(&fake.clock));
}

static void nothing_starts_when_one_target_is_out_of_reach(void **state) {
    (void)state;
    assert_int_equal(move(40, 150), -ERR_RANGE);
    assert_non_null(strstr(err.text, "sample"));
    assert_int_equal(fake.bus.drive[0].orders + fake.bus.drive[1].orders, 0);
}

/* forbidden: source 50..60 while sample is in 20..30 */
static void add_zone(void) {
    stage.zone[stage.n_zones++] = (struct keep_out){
        .used = {true, true}, .low_udeg = {DEG(50), DEG(20)}, .high_udeg = {DEG(60), DEG(30)}};
}

static int path(double s0, double m0, double s1, double m1) {
    int32_t from[STAGE_AXES] = {DEG(s0), DEG(m0), 0};
    struct stage_target t = to(s1, m1);
    err_clear(&err);
    return stage_check_path(&stage, from, &t, &err);
}

static void keep_out_zones_guard_target_and_way(void **state) {
    (void)state;
    add_zone();
    assert_int_equal(path(0, 0, 55, 25), -ERR_RANGE);   /* ends in it */
    assert_int_equal(path(0, 25, 100, 25), -ERR_RANGE); /* passes it */
    assert_non_null(strstr(err.text, "keep-out zone"));
    assert_int_equal(path(40, 0, 70, 40), -ERR_RANGE); /* could pass it if one axis is late */
    assert_int_equal(path(40, 0, 70, 10), 0);          /* beside it */
    assert_int_equal(path(0, 0, 0, 40), 0);
    assert_int_equal(path(0, 0, 49.8, 25), 0);
    assert_int_equal(path(0, 0, 49.95, 25), -ERR_RANGE); /* the approach overshoots by 0.1 */
    assert_int_equal(path(55, 25, 55, 25), 0);           /* no move is no way */
    stage.zone[0].used[STAGE_SAMPLE] = false;
    assert_int_equal(path(0, 0, 55, 60), -ERR_RANGE); /* forbidden wherever the sample stands */
}

static void a_refused_way_starts_nothing(void **state) {
    (void)state;
    add_zone();
    assert_int_equal(move(40, 25), 0);
    int before = fake.bus.drive[0].orders;
    assert_int_equal(move(100, 25), -ERR_RANGE);
    assert_int_equal(fake.bus.drive[0].orders, before);
}

static void one_fault_stops_the_other_axis(void **state) {
    (void)state;
    fake.bus.drive[0].stuck_at = 300;
    assert_int_equal(move(100, 100), -ERR_DEVICE);
    assert_non_null(strstr(err.text, "source"));
    assert_int_equal(fake.bus.drive[1].stops, 1);
    assert_true(stage_standstill(&stage));
}

static struct cancel cancel;

static int64_t soon(void *self) {
    (void)self;
    return 2 * US_PER_S;
}

static void raise_cancel(void *self) {
    (void)self;
    atomic_store(&cancel.raised, true);
}

static void a_cancel_stops_all_axes(void **state) {
    (void)state;
    struct bench_service s = {.name = "abort", .self = &cancel, .due_us = soon, .run = raise_cancel};
    struct stage_target t = to(100, 100);
    bench_add(&fake.bench, &s);
    assert_int_equal(stage_move(&stage, &t, &cancel, &reading, &err), -ERR_CANCELLED);
    bench_remove(&fake.bench, &cancel);
    assert_int_equal(fake.bus.drive[0].stops, 1);
    assert_int_equal(fake.bus.drive[1].stops, 1);
    assert_int_equal(
        bench_wait(&fake.bench, clock_now_us(&fake.clock) + US_PER_S, stage_standstill, &stage, NULL),
        BENCH_DONE);
    atomic_store(&cancel.raised, false);
}

static void stop_orders_go_to_answering_axes_first(void **state) {
    (void)state;
    fake.bus.drive[0].mute = true;
    bench_wait(&fake.bench, clock_now_us(&fake.clock) + 5 * US_PER_S, NULL, NULL, NULL);
    int before = fake.bus.n_writes;
    stage_order_stop(&stage);
    assert_int_equal(fake.bus.write[before].unit, 2);
    assert_int_equal(fake.bus.write[before + 1].unit, 3);
    assert_false(stage_standstill(&stage));
    bench_wait(&fake.bench, clock_now_us(&fake.clock) + US_PER_S, NULL, NULL, NULL);
    assert_false(stage_standstill(&stage)); /* the mute one has not been seen to stand */
    fake.bus.drive[0].mute = false;
    assert_int_equal(
        bench_wait(&fake.bench, clock_now_us(&fake.clock) + 15 * US_PER_S, stage_standstill, &stage, NULL),
        BENCH_DONE);
    assert_int_equal(fake.bus.drive[0].stops, 1);
}

static void homing_one_axis(void **state) {
    (void)state;
    move(30, 30);
    assert_int_equal(stage_home(&stage, STAGE_SOURCE, NULL, &err), 0);
    stage_read(&stage, &reading);
    assert_int_equal(reading.udeg[STAGE_SOURCE], 0);
    assert_int_equal(reading.udeg[STAGE_SAMPLE], DEG(30));
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(axes_move_at_the_same_time),
        TEST(nothing_starts_when_one_target_is_out_of_reach),
        TEST(keep_out_zones_guard_target_and_way),
        TEST(a_refused_way_starts_nothing),
        TEST(one_fault_stops_the_other_axis),
        TEST(a_cancel_stops_all_axes),
        TEST(stop_orders_go_to_answering_axes_first),
        TEST(homing_one_axis),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
