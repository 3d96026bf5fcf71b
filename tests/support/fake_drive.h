/*
 * fake_drive.h — a bus with AZ drives on it that misbehave to order: orders ignored, motors stuck, links
 * down.
 *
 * In process, on the clock of the test. Motion is uniform (no ramps). What the simulated bench does well is
 * tested against the simulated bench; this is for what a healthy drive never does.
 */
#ifndef TESTS_SUPPORT_FAKE_DRIVE_H
#define TESTS_SUPPORT_FAKE_DRIVE_H

#include <stdbool.h>
#include <stdint.h>

#include "drivers/axis.h"
#include "drivers/bench.h"
#include "drivers/modbus_link.h"
#include "proto/profile.h"

#define FAKE_UNITS 3
#define FAKE_WRITES 256

struct fake_drive {
    double from, to; /* steps */
    int64_t start_us, end_us;
    int alarm;
    uint16_t command;
    bool mute;         /* answers nothing */
    int ignore_orders; /* so many moves are taken without effect */
    double stuck_at;   /* steps; the motor goes no further. NAN = free */
    double short_by;   /* steps; the next move ends so far from its target, once */
    int64_t reset_word;
    int orders, stops, polls;
    int64_t last_poll_us, longest_gap_us;
};

struct fake_write {
    int64_t us;
    int unit, addr, count;
    uint16_t regs[16];
    bool urgent;
};

struct fake_bus {
    struct clock *clock;
    struct fake_drive drive[FAKE_UNITS]; /* unit 1 .. */
    struct modbus_link_state state;
    int lose_replies; /* so many exchanges happen, but their reply is lost */
    int lose_write_replies;
    int connects;
    int64_t quarantine_us;
    struct fake_write write[FAKE_WRITES];
    int n_writes;
};

void fake_disconnect(struct fake_bus *bus, int64_t until_us);

struct fake_bench { /* the bus, and what an axis on it needs */
    struct clock clock;
    struct bench bench;
    struct fake_bus bus;
    struct modbus_link link;
    struct profile profile; /* om-az */
};

int fake_bench_init(struct fake_bench *f); /* at 1 s of virtual time */
struct axis_config fake_bench_axis(const struct fake_bench *f, const char *name,
                                   int unit); /* -70 .. 140 deg */
/* Until it is no longer busy, for a minute at most; how its order ended. */
int fake_bench_finish(struct fake_bench *f, struct axis *axis, struct err *e);

#endif
