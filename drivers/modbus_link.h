/*
 * modbus_link.h — one bus of Modbus units: a request out, its reply back, each bounded by the response time.
 *
 * A link is RTU or TCP over libmodbus, or a simulated bus in process; record, fault and replay are links
 * around a link. One owner thread. The link owns recovery (stage-modbus.md 4.3): after any error but an
 * exception it is suspect: RTU keeps silent for quarantine_ms and drains, TCP closes and reconnects with a
 * back-off of 0.5, 1, 2 .. 10 s; meanwhile a request returns -ERR_BUSY or -ERR_LINK at once. An urgent
 * request (a stop order) is sent even in quarantine. On RTU a reply counts only when no byte waited before
 * the request and none arrives within gap_ms after it (50 ms for two seconds after a lost reply, which may
 * still come). A request is never repeated by the link.
 *
 * Errors     -ERR_TIMEOUT no reply; -ERR_LINK not connected; -ERR_BUSY in quarantine; -ERR_DEVICE the unit
 *            answered with an exception (request->exception says which); -ERR_IO anything else. In each case
 *            regs are unspecified.
 * Checked    tests/unit/test_modbus_link.c, tests/wire/
 */
#ifndef DRIVERS_MODBUS_LINK_H
#define DRIVERS_MODBUS_LINK_H

#include <stdbool.h>
#include <stdint.h>

#include "drivers/clock.h"
#include "proto/err.h"

#define MODBUS_REGS_MAX 125

struct modbus_request {
    int unit;
    int function; /* 3 read (4: input registers), 6 write one, 16 write */
    int addr;     /* PDU address, counted from 0 */
    int count;    /* registers */
    uint16_t regs[MODBUS_REGS_MAX];
    bool urgent;
    int exception; /* out: Modbus exception code, 0 = none */
};

struct modbus_link_state {
    bool connected;
    int64_t ready_us;      /* the earliest time at which a normal request will be sent */
    int64_t last_reply_us; /* CLOCK_NEVER negated (INT64_MIN) before the first */
    int failures;          /* consecutive */
};

struct modbus_link_ops {
    int (*transact)(void *self, struct modbus_request *rq, struct err *e);
    void (*state)(void *self, struct modbus_link_state *state);
    void (*close)(void *self);
};

struct modbus_link {
    const struct modbus_link_ops *ops;
    void *self;
    char name[96]; /* as in the config: rtu:PATH, tcp:HOST:PORT, sim:NAME */
};

struct modbus_link_config {
    const char *target; /* rtu:PATH or tcp:HOST:PORT */
    int baud;
    char parity; /* N, E, O */
    int data_bits, stop_bits;
    int response_ms, byte_ms, gap_ms, quarantine_ms;
};

static inline int modbus_link_transact(struct modbus_link *link, struct modbus_request *rq, struct err *e) {
    return link->ops->transact(link->self, rq, e);
}

static inline void modbus_link_state(struct modbus_link *link, struct modbus_link_state *state) {
    link->ops->state(link->self, state);
}

static inline void modbus_link_close(struct modbus_link *link) {
    link->ops->close(link->self);
}

/* libmodbus over RTU or TCP. RTU takes an exclusive lock of the tty (-ERR_BUSY names who may hold it). */
int modbus_link_open(struct modbus_link *link, const struct modbus_link_config *config, struct clock *clock,
                     struct err *e);

/* A decorator that shows every finished transaction to seen() (the recording), then hands it on. Closing it
 * closes inner. result is the return of the transaction. */
typedef void modbus_link_seen(void *arg, int64_t sent_us, int64_t done_us, const struct modbus_request *sent,
                              const struct modbus_request *reply, int result);
int modbus_link_record(struct modbus_link *link, const struct modbus_link *inner, struct clock *clock,
                       modbus_link_seen *seen, void *arg, struct err *e);

#endif
