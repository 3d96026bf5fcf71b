#include "tests/support/fake_drive.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "proto/units.h"

#define INPOS_LAG_US 20000

static double position(const struct fake_drive *d, int64_t now_us) {
    double at = d->to;
    if (now_us < d->start_us)
        at = d->from;
    else if (now_us < d->end_us)
        at = d->from + (d->to - d->from) * (double)(now_us - d->start_us) / (double)(d->end_us - d->start_us);
    if (!isnan(d->stuck_at) && (d->from - d->stuck_at) * (at - d->stuck_at) < 0)
        at = d->stuck_at;
    return round(at);
}

static bool moving(const struct fake_drive *d, int64_t now_us) {
    return now_us >= d->start_us && now_us < d->end_us;
}

static uint32_t status(const struct fake_drive *d, int64_t now_us) {
    bool moves = moving(d, now_us), ahead = now_us < d->start_us;
    uint32_t s = moves ? 0x2000 : 0;
    if (!moves && (now_us >= d->end_us + INPOS_LAG_US || ahead))
        s |= 0x4000;
    if (!moves && !ahead && !d->alarm && !(d->command & 0x20))
        s |= 0x20;
    if (position(d, now_us) == 0)
        s |= 0x10;
    return s | (d->alarm ? 0x80 : 0);
}

static void start(struct fake_drive *d, int64_t now_us, double to, double speed) {
    d->from = position(d, now_us);
    d->to = to - d->short_by;
    d->short_by = 0;
    d->start_us = now_us + 2000;
    d->end_us = d->start_us + (int64_t)(fabs(d->to - d->from) / speed * 1e6);
}

static void halt(struct fake_drive *d, int64_t now_us) {
    d->from = d->to = position(d, now_us);
    d->start_us = d->end_us = now_us;
}

static int32_t item(const uint16_t *regs) {
    return (int32_t)((uint32_t)regs[0] << 16 | regs[1]);
}

static void put(uint16_t *regs, int64_t value) {
    regs[0] = (uint16_t)((uint32_t)value >> 16);
    regs[1] = (uint16_t)value;
}

static void command(struct fake_drive *d, int64_t now_us, uint16_t now) {
    uint16_t rising = now & (uint16_t)~d->command;
    d->command = now;
    if (rising & 0x20) {
        d->stops++;
        halt(d, now_us);
    }
    if ((rising & 0x10) && !(now & 0x20) && !d->alarm)
        start(d, now_us, 0, 2000);
}

static void take(struct fake_drive *d, int64_t now_us, const struct modbus_request *rq) {
    if (rq->addr == 0x58 && rq->count == 16 && item(rq->regs + 14) == 1) {
        d->orders++;
        if (d->ignore_orders > 0)
            d->ignore_orders--;
        else if (!d->alarm && !(d->command & 0x20))
            start(d, now_us, item(rq->regs + 4), item(rq->regs + 6));
    } else if (rq->addr == 0x7C) {
        command(d, now_us, rq->regs[1]);
    } else if (rq->addr == 0x180) {
        if (d->reset_word == 0 && item(rq->regs) == 1)
            d->alarm = 0;
        d->reset_word = item(rq->regs);
    }
}

static void give(struct fake_drive *d, int64_t now_us, struct modbus_request *rq) {
    uint16_t image[0x100] = {0};
    put(image + 0x7E, status(d, now_us));
    put(image + 0x80, d->alarm);
    put(image + 0xC6, (int64_t)position(d, now_us));
    put(image + 0xCC, (int64_t)position(d, now_us));
    memcpy(rq->regs, image + rq->addr, sizeof *rq->regs * rq->count);
    if (rq->addr != 0x7E)
        return;
    d->polls++;
    if (d->last_poll_us && now_us - d->last_poll_us > d->longest_gap_us)
        d->longest_gap_us = now_us - d->last_poll_us;
    d->last_poll_us = now_us;
}

static void note_write(struct fake_bus *bus, int64_t now_us, const struct modbus_request *rq) {
    struct fake_write *w = &bus->write[bus->n_writes % FAKE_WRITES];
    *w = (struct fake_write){now_us, rq->unit, rq->addr, rq->count, {0}, rq->urgent};
    memcpy(w->regs, rq->regs, sizeof w->regs);
    bus->n_writes++;
}

static int transact(void *self, struct modbus_request *rq, struct err *e) {
    struct fake_bus *bus = self;
    int64_t now_us = clock_stamp(bus->clock);
    if (!bus->state.connected) {
        if (now_us < bus->state.ready_us && !rq->urgent)
            return err_set(e, ERR_LINK, "not connected");
        bus->connects++;
        if (now_us < bus->state.ready_us)
            return err_set(e, ERR_LINK, "still nobody there");
        bus->state.connected = true;
    }
    if (now_us < bus->state.ready_us && !rq->urgent)
        return err_set(e, ERR_BUSY, "quarantine");
    struct fake_drive *d = &bus->drive[rq->unit - 1];
    bool write = rq->function != 3;
    if (write && !d->mute) {
        note_write(bus, now_us, rq);
        take(d, now_us, rq);
    }
    int *lose = write && bus->lose_write_replies > 0 ? &bus->lose_write_replies : &bus->lose_replies;
    if (d->mute || *lose > 0) {
        *lose -= *lose > 0;
        bus->state.failures++;
        bus->state.ready_us = now_us + bus->quarantine_us;
        return err_set(e, ERR_TIMEOUT, "no reply");
    }
    if (!write)
        give(d, now_us, rq);
    bus->state.failures = 0;
    return 0;
}

static void read_state(void *self, struct modbus_link_state *state) {
    *state = ((struct fake_bus *)self)->state;
}

static void close_bus(void *self) {
    (void)self;
}

static void init_bus(struct fake_bus *bus, struct clock *clock, struct modbus_link *link) {
    static const struct modbus_link_ops OPS = {.transact = transact, .state = read_state, .close = close_bus};
    memset(bus, 0, sizeof *bus);
    bus->clock = clock;
    bus->state.connected = true;
    bus->state.ready_us = INT64_MIN;
    bus->quarantine_us = 300000;
    for (int i = 0; i < FAKE_UNITS; i++) {
        bus->drive[i].stuck_at = NAN;
        bus->drive[i].start_us = bus->drive[i].end_us = -1000000;
    }
    *link = (struct modbus_link){.ops = &OPS, .self = bus, .name = "fake"};
}

void fake_disconnect(struct fake_bus *bus, int64_t until_us) {
    bus->state.connected = false;
    bus->state.ready_us = until_us;
}

int fake_bench_init(struct fake_bench *f) {
    struct err_list errors = {0};
    clock_init_virtual(&f->clock);
    clock_advance(&f->clock, US_PER_S);
    bench_init(&f->bench, &f->clock);
    init_bus(&f->bus, &f->clock, &f->link);
    return profile_load("om-az", &f->profile, &errors);
}

struct axis_config fake_bench_axis(const struct fake_bench *f, const char *name, int unit) {
    struct axis_config config = {.kind = AXIS_MOTOR,
                                 .profile = &f->profile,
                                 .unit = unit,
                                 .direction = 1,
                                 .low_udeg = udeg_from_deg(-70),
                                 .high_udeg = udeg_from_deg(140),
                                 .position_valid = true};
    snprintf(config.name, sizeof config.name, "%s", name);
    return config;
}

static bool over(void *axis) {
    return !axis_busy(axis);
}

int fake_bench_finish(struct fake_bench *f, struct axis *axis, struct err *e) {
    int64_t until_us = clock_now_us(&f->clock) + 60 * US_PER_S;
    assert_int_equal(bench_wait(&f->bench, until_us, over, axis, NULL), BENCH_DONE);
    err_clear(e);
    return axis_result(axis, e);
}
