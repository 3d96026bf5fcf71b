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

#include "drivers/clock.h"
#include "drivers/modbus_link.h"

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

void fake_bus_init(struct fake_bus *bus, struct clock *clock, struct modbus_link *link);
double fake_position(const struct fake_drive *d, int64_t now_us); /* steps */
void fake_disconnect(struct fake_bus *bus, int64_t until_us);

#endif
