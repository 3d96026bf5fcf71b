#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "sim/az_registers.h"
#include "sim/sim.h"

#define MS 1000LL

struct rig {
    struct clock clock;
    struct sim_config config;
    struct sim_bench *bench;
    struct modbus_link link;
};

static void rig_new(struct rig *r, void (*change)(struct sim_config *)) {
    struct err e = {0};
    clock_init_virtual(&r->clock);
    sim_config_default(&r->config);
    if (change)
        change(&r->config);
    assert_int_equal(sim_bench_new(&r->bench, &r->config, &r->clock, &e), 0);
    assert_int_equal(sim_modbus_link(r->bench, &r->link, &e), 0);
}

static void rig_free(struct rig *r) {
    modbus_link_close(&r->link);
    sim_bench_free(r->bench);
}

static int read32(struct rig *r, int unit, int addr, int32_t *value) {
    struct modbus_request rq = {.unit = unit, .function = 3, .addr = addr, .count = 2};
    int rc = modbus_link_transact(&r->link, &rq, NULL);
    *value = (int32_t)((uint32_t)rq.regs[0] << 16 | rq.regs[1]);
    return rc;
}

static int32_t get(struct rig *r, int addr) {
    int32_t v;
    assert_int_equal(read32(r, 1, addr, &v), 0);
    return v;
}

static int write32(struct rig *r, int addr, int n, const int32_t *value, int *exception) {
    struct modbus_request rq = {.unit = 1, .function = 16, .addr = addr, .count = 2 * n};
    for (int i = 0; i < n; i++) {
        rq.regs[2 * i] = (uint16_t)((uint32_t)value[i] >> 16);
        rq.regs[2 * i + 1] = (uint16_t)value[i];
    }
    int rc = modbus_link_transact(&r->link, &rq, NULL);
    *exception = rq.exception;
    return rc;
}

static void put(struct rig *r, int addr, int32_t value) {
    int exception;
    assert_int_equal(write32(r, addr, 1, &value, &exception), 0);
}

/* The direct data operation as stage-modbus.md 1.2 prints it: one FC16 of 16 registers. */
static int order(struct rig *r, int type, int32_t target, int32_t speed, int32_t accel) {
    int32_t data[8] = {0, type, target, speed, accel, accel, 1000, 1};
    int exception;
    write32(r, 0x58, 8, data, &exception);
    return exception;
}

static void wait_ms(struct rig *r, int64_t ms) {
    for (int64_t i = 0; i < ms; i += 100) { /* as a host that polls: the drive's watchdog is fed */
        clock_advance(&r->clock, clock_now_us(&r->clock) + (ms - i < 100 ? ms - i : 100) * MS);
        get(r, 0x7E);
    }
}

#define MOVE 0x2000
#define IN_POS 0x4000
#define READY 0x20
#define ALARM 0x80

static void test_a_move_is_seen_late_and_arrives(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, NULL);
    assert_int_equal(order(&r, 1, 1000, 2000, 4000), 0);
    assert_int_equal(get(&r, 0x7E) & (MOVE | IN_POS), IN_POS); /* the first poll still shows the old state */
    clock_advance(&r.clock, 1999);
    assert_int_equal(get(&r, 0x7E) & MOVE, 0);
    clock_advance(&r.clock, 2000);
    assert_int_equal(get(&r, 0x7E) & (MOVE | IN_POS | READY), MOVE);
    /* 10 deg at 20 deg/s and 40 deg/s^2: ramps of 0.5 s cover 5 deg each: 1 s in all, plus the 2 ms of the
     * start */
    clock_advance(&r.clock, 502 * MS);
    assert_int_equal(get(&r, 0xCC), 500);
    assert_int_equal(get(&r, 0xD0), 2000);
    clock_advance(&r.clock, 1002 * MS);
    assert_int_equal(get(&r, 0xCC), 1000);
    assert_int_equal(get(&r, 0x7E) & (MOVE | IN_POS),
                     0); /* the profile has ended, the feedback still settles */
    wait_ms(&r, 100);
    assert_int_equal(get(&r, 0x7E) & (MOVE | IN_POS | READY), IN_POS | READY);
    assert_int_equal(get(&r, 0xC6), 1000);
    rig_free(&r);
}

static void test_a_short_move_is_a_triangle(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, NULL);
    order(&r, 1, -100, 2000, 4000); /* 1 deg: v = sqrt(a d) = 632 step/s, T = 2 sqrt(d/a) = 316.2 ms */
    clock_advance(&r.clock, (2 + 158) * MS);
    assert_int_equal(get(&r, 0xCC), -50);
    clock_advance(&r.clock, (2 + 316) * MS);
    assert_true(get(&r, 0x7E) & MOVE);
    clock_advance(&r.clock, (2 + 317) * MS);
    assert_false(get(&r, 0x7E) & MOVE);
    assert_int_equal(get(&r, 0xCC), -100);
    rig_free(&r);
}

static void test_stop_is_a_level(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, NULL);
    order(&r, 1, 9000, 2000, 4000);
    wait_ms(&r, 1000);
    int32_t before = get(&r, 0xCC);
    put(&r, 0x7C, 0x20);
    wait_ms(&r, 1000);
    int32_t stopped = get(&r, 0xCC);
    assert_int_equal(stopped - before, 500); /* v^2 / 2a = 2000^2 / 8000 */
    assert_false(get(&r, 0x7E) & (MOVE | READY));
    assert_int_equal(order(&r, 1, 0, 2000, 4000), 0); /* taken without a word, and nothing moves */
    wait_ms(&r, 500);
    assert_int_equal(get(&r, 0xCC), stopped);
    put(&r, 0x7C, 0);
    wait_ms(&r, 500);
    assert_int_equal(get(&r, 0xCC), stopped);
    assert_true(get(&r, 0x7E) & READY);
    rig_free(&r);
}

static void test_an_order_under_way_is_replaced(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, NULL);
    order(&r, 1, 9000, 2000, 4000);
    wait_ms(&r, 1000);
    order(&r, 1, -300, 2000, 4000); /* it must brake before it turns round */
    wait_ms(&r, 300);
    assert_true(get(&r, 0xCC) > 1500);
    wait_ms(&r, 4000);
    assert_int_equal(get(&r, 0xCC), -300);
    assert_true(get(&r, 0x7E) & IN_POS);
    rig_free(&r);
}

/* What a host may write, and no drive can do: answered, and nothing turns. */
static void test_absurd_orders_turn_nothing(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, NULL);
    assert_int_equal(order(&r, 1, 1000, INT32_MIN, 2000), 4);
    assert_int_equal(order(&r, 1, 1000, 2000, INT32_MIN), 4);
    assert_int_equal(order(&r, 1, 1000, 2000, 2000), 0);
    wait_ms(&r, 3000);
    assert_int_equal(order(&r, 2, INT32_MAX, 2000, 2000), 0); /* past the end of 32 bits */
    assert_int_equal(get(&r, 0x80), 0x70);
    put(&r, 0x66, INT32_MIN);
    wait_ms(&r, 100);
    assert_int_equal(get(&r, 0xCC), 1000);
    rig_free(&r);
}

static void no_coordinates(struct sim_config *c) {
    c->axis[0].no_coordinates = true;
}

static void test_no_absolute_move_without_coordinates(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, no_coordinates);
    assert_int_equal(get(&r, 0x178), 0);
    order(&r, 1, 500, 2000, 4000);
    assert_int_equal(get(&r, 0x80), 0x4A);
    assert_int_equal(get(&r, 0x7E) & (ALARM | READY | MOVE), ALARM);
    put(&r, 0x180, 1);
    assert_int_equal(get(&r, 0x80), 0);
    assert_int_equal(get(&r, 0x82), 0x4A); /* the history keeps it */
    put(&r, 0x180, 1);                     /* an edge: 1 again does nothing, 0 then 1 does */
    order(&r, 1, 500, 2000, 4000);
    put(&r, 0x180, 1);
    assert_int_equal(get(&r, 0x80), 0x4A);
    put(&r, 0x180, 0);
    put(&r, 0x180, 1);
    put(&r, 0x7C, 0x10); /* ZHOME */
    put(&r, 0x7C, 0);
    wait_ms(&r, 100);
    assert_int_equal(get(&r, 0x178), 0x1C);
    assert_true(get(&r, 0x7E) & 0x10);
    order(&r, 1, 500, 2000, 4000);
    wait_ms(&r, 2000);
    assert_int_equal(get(&r, 0xCC), 500);
    rig_free(&r);
}

static void switches(struct sim_config *c) {
    c->axis[0].switch_low_deg = -20;
    c->axis[0].switch_high_deg = 30;
}

static void test_limits_stop_with_their_alarm(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, switches);
    order(&r, 1, 4000, 2000, 4000);
    wait_ms(&r, 3000);
    assert_int_equal(get(&r, 0x80), 0x66);
    assert_int_equal(get(&r, 0xCC), 3000);
    put(&r, 0x180, 1);
    put(&r, 0x388, 3100);
    put(&r, 0x38A, -1000);
    order(&r, 1, -1500, 2000, 4000);
    wait_ms(&r, 200);
    assert_int_equal(get(&r, 0x80), 0); /* not before the limit is reached */
    wait_ms(&r, 4000);
    assert_int_equal(get(&r, 0x80), 0x67);
    assert_int_equal(get(&r, 0xCC), -1000);
    rig_free(&r);
}

static void test_a_silent_bus_trips_the_watchdog(void **state) {
    (void)state;
    struct rig r;
    int32_t v;
    rig_new(&r, NULL);
    order(&r, 1, 9000, 2000, 4000);
    for (int i = 0; i < 10; i++) { /* any unit's traffic feeds it */
        clock_advance(&r.clock, clock_now_us(&r.clock) + 900 * MS);
        assert_int_equal(read32(&r, 2, 0x80, &v), 0);
    }
    assert_int_equal(get(&r, 0x80), 0);
    order(&r, 1, 0, 2000, 4000);
    clock_advance(&r.clock, clock_now_us(&r.clock) + 1500 * MS);
    assert_int_equal(get(&r, 0x80), 0x85);
    /* it drove for 1 s (0.5 s ramp, 500 steps; 0.498 s plateau, 996), then braked over 500 */
    assert_int_equal(get(&r, 0xCC), 9000 - 500 - 996 - 500);
    rig_free(&r);
}

static void test_exceptions(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, NULL);
    struct modbus_request rq = {.unit = 1, .function = 3, .addr = 5000, .count = 1};
    assert_int_equal(modbus_link_transact(&r.link, &rq, NULL), -ERR_DEVICE);
    assert_int_equal(rq.exception, 2);
    rq = (struct modbus_request){.unit = 1, .function = 6, .addr = 0xCC, .count = 1};
    assert_int_equal(modbus_link_transact(&r.link, &rq, NULL), -ERR_DEVICE); /* a position is not written */
    assert_int_equal(rq.exception, 2);
    assert_int_equal(order(&r, 1, 100, 4000001, 4000), 4);
    assert_int_equal(order(&r, 1, 100, 2000, 0), 4);
    assert_int_equal(get(&r, 0x7E) & MOVE, 0);
    rig_free(&r);
}

static size_t ask(struct az_unit *u, const void *pdu, size_t n, uint8_t *reply) {
    return az_reply(u, 0, pdu, n, reply);
}

static void test_pdus(void **state) {
    (void)state;
    static struct az_unit u;
    uint8_t reply[AZ_PDU_MAX];
    az_init(&u, &(struct az_config){.unit = 1, .home_speed = 2000, .home_accel = 4000, .at_steps = -1000}, 1,
            0, 0);
    assert_int_equal(ask(&u, "\x03\x00\xcc\x00\x02", 5, reply), 6);
    assert_memory_equal(reply, "\x03\x04\xff\xff\xfc\x18", 6);
    assert_int_equal(ask(&u, "\x03\x00\xcc\x00\x7e", 5, reply), 2); /* 126 registers */
    assert_memory_equal(reply, "\x83\x03", 2);
    assert_int_equal(ask(&u, "\x10\x00\x7c\x00\x02\x03\x00\x00\x00", 9, reply),
                     2); /* byte count against count */
    assert_memory_equal(reply, "\x90\x03", 2);
    assert_int_equal(ask(&u, "\x08\x00\x00\x12\x34", 5, reply), 5);
    assert_memory_equal(reply, "\x08\x00\x00\x12\x34", 5);
    assert_int_equal(ask(&u, "\x08\x00\x01\x12\x34", 5, reply), 2);
    assert_memory_equal(reply, "\x88\x01", 2);
    assert_int_equal(ask(&u, "\x04\x00\xcc\x00\x02", 5, reply), 2);
    assert_memory_equal(reply, "\x84\x01", 2);
    assert_int_equal(ask(&u, "\x06\x00\x7d\x00\x20", 5, reply), 5);
    assert_memory_equal(reply, "\x06\x00\x7d\x00\x20", 5);
    assert_int_equal(ask(&u, "\x17\x00\x7e\x00\x02\x00\x7c\x00\x02\x04\x00\x00\x00\x00", 14, reply), 6);
    assert_memory_equal(reply, "\x17\x04\x00\x00\x40\x20", 6); /* STOP dropped: IN-POS and READY */
}

static void mute(struct sim_config *c) {
    c->axis[1].mute = true;
}

static void test_a_mute_unit_times_out(void **state) {
    (void)state;
    struct rig r;
    int32_t v;
    rig_new(&r, mute);
    assert_int_equal(read32(&r, 2, 0x80, &v), -ERR_TIMEOUT);
    assert_int_equal(read32(&r, 1, 0x80, &v), -ERR_BUSY); /* quarantine */
    clock_advance(&r.clock, 300 * MS);
    assert_int_equal(read32(&r, 1, 0x80, &v), 0);
    assert_int_equal(read32(&r, 9, 0x80, &v), -ERR_TIMEOUT); /* no such unit */
    rig_free(&r);
}

static double arrive(struct rig *r, int32_t from, int32_t to) {
    order(r, 1, from, 9000, 90000);
    wait_ms(r, 3000);
    order(r, 1, to, 9000, 90000);
    wait_ms(r, 3000);
    return sim_bench_true_deg(r->bench, "source");
}

static void exact_zero(struct sim_config *c) {
    c->axis[0].u_zero_deg = 0;
}

static void gear_only(struct sim_config *c) {
    exact_zero(c);
    c->axis[0].u_repeat_deg = 0;
}

static void test_lost_motion_by_direction(void **state) {
    (void)state;
    struct rig r;
    rig_new(&r, gear_only);
    assert_true(fabs(arrive(&r, 0, 1000) - 10.0) < 1e-9);
    assert_true(fabs(arrive(&r, 2000, 1000) - 10.033) <
                1e-9); /* from above the gear lags by its lost motion */
    assert_true(fabs(arrive(&r, 990, 1000) - 10.0) < 1e-9);
    assert_true(fabs(arrive(&r, 1003, 1001) - 10.03) < 1e-9); /* inside the play the table has not moved */
    rig_free(&r);
}

static void test_repeatability_by_visit(void **state) {
    (void)state;
    double seen[2][40], sum = 0, square = 0;
    for (int run = 0; run < 2; run++) {
        struct rig r;
        rig_new(&r, exact_zero);
        if (run == 1)
            arrive(&r, -4000, -3000); /* other journeys before it change nothing */
        for (int i = 0; i < 40; i++)
            seen[run][i] = arrive(&r, 0, 1000) - 10;
        rig_free(&r);
    }
    assert_memory_equal(seen[0], seen[1], sizeof seen[0]);
    for (int i = 0; i < 40; i++) {
        sum += seen[0][i];
        square += seen[0][i] * seen[0][i];
    }
    assert_true(fabs(sum / 40) < 4 * 0.002 / sqrt(40));
    assert_true(square / 40 > 0.002 * 0.002 * 0.5 && square / 40 < 0.002 * 0.002 * 1.8);
}

static void test_zeros_differ_by_seed(void **state) {
    (void)state;
    double seen[3];
    for (int i = 0; i < 3; i++) {
        struct rig r;
        rig_new(&r, NULL);
        sim_bench_free(r.bench);
        modbus_link_close(&r.link);
        r.config.seed = i == 2 ? 1 : (uint64_t)i + 1;
        assert_int_equal(sim_bench_new(&r.bench, &r.config, &r.clock, NULL), 0);
        seen[i] = sim_bench_true_deg(r.bench, "sample");
        sim_bench_free(r.bench);
    }
    assert_true(seen[0] != 0 && fabs(seen[0]) < 0.05 && seen[0] != seen[1]);
    assert_true(seen[0] == seen[2]);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_move_is_seen_late_and_arrives),
        cmocka_unit_test(test_a_short_move_is_a_triangle),
        cmocka_unit_test(test_stop_is_a_level),
        cmocka_unit_test(test_an_order_under_way_is_replaced),
        cmocka_unit_test(test_absurd_orders_turn_nothing),
        cmocka_unit_test(test_no_absolute_move_without_coordinates),
        cmocka_unit_test(test_limits_stop_with_their_alarm),
        cmocka_unit_test(test_a_silent_bus_trips_the_watchdog),
        cmocka_unit_test(test_exceptions),
        cmocka_unit_test(test_pdus),
        cmocka_unit_test(test_a_mute_unit_times_out),
        cmocka_unit_test(test_lost_motion_by_direction),
        cmocka_unit_test(test_repeatability_by_visit),
        cmocka_unit_test(test_zeros_differ_by_seed),
    };
    return cmocka_run_group_tests_name("sim_axis", tests, NULL, NULL);
}
