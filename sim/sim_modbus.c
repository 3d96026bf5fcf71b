#include <stdlib.h>

#include "sim/sim_bench.h"

/* Silence after a missing reply, as the om-az bus keeps it: stage-modbus.md 3. */
#define QUARANTINE_US 300000

struct sim_modbus {
    struct sim_bench *bench;
    int64_t ready_us, last_reply_us;
    int failures;
};

static size_t encode(const struct modbus_request *rq, uint8_t *pdu) {
    pdu[0] = (uint8_t)rq->function;
    pdu[1] = (uint8_t)(rq->addr >> 8);
    pdu[2] = (uint8_t)rq->addr;
    pdu[3] = (uint8_t)(rq->count >> 8);
    pdu[4] = (uint8_t)rq->count;
    if (rq->function == 3)
        return 5;
    int at = rq->function == 6 ? 3 : 6;
    pdu[5] = (uint8_t)(2 * rq->count);
    for (int i = 0; i < rq->count; i++) {
        pdu[at + 2 * i] = (uint8_t)(rq->regs[i] >> 8);
        pdu[at + 2 * i + 1] = (uint8_t)rq->regs[i];
    }
    return (size_t)(at + 2 * rq->count);
}

static int failed(struct sim_modbus *s, int64_t now_us, const struct modbus_request *rq, struct err *e) {
    s->failures++;
    s->ready_us = now_us + QUARANTINE_US;
    return err_set(e, ERR_TIMEOUT, "unit %d of the simulated bus does not answer", rq->unit);
}

static int transact(void *self, struct modbus_request *rq, struct err *e) {
    struct sim_modbus *s = self;
    int64_t now_us = clock_stamp(s->bench->clock);
    uint8_t pdu[AZ_PDU_MAX + 16], reply[AZ_PDU_MAX] = {0};
    rq->exception = 0;
    if (now_us < s->ready_us && !rq->urgent)
        return err_set(e, ERR_BUSY, "the simulated bus is in quarantine after a missing reply");
    if (rq->count < 1 || rq->count > 123 || (rq->function != 3 && rq->function != 6 && rq->function != 16))
        return err_set(e, ERR_RANGE, "function %d with %d registers is no request of this link", rq->function,
                       rq->count);
    size_t n = sim_bench_bus(s->bench, now_us, rq->unit, pdu, encode(rq, pdu), reply);
    if (n == 0)
        return failed(s, now_us, rq, e);
    s->failures = 0;
    s->last_reply_us = now_us;
    if (reply[0] & 0x80) {
        rq->exception = reply[1];
        return err_set(e, ERR_DEVICE, "unit %d answered function %d at 0x%04X with exception %d", rq->unit,
                       rq->function, (unsigned)rq->addr, reply[1]);
    }
    for (int i = 0; rq->function == 3 && i < rq->count; i++)
        rq->regs[i] = (uint16_t)(reply[2 + 2 * i] << 8 | reply[3 + 2 * i]);
    return 0;
}

static void state(void *self, struct modbus_link_state *state) {
    const struct sim_modbus *s = self;
    *state = (struct modbus_link_state){.connected = true,
                                        .ready_us = s->ready_us,
                                        .last_reply_us = s->last_reply_us,
                                        .failures = s->failures};
}

static const struct modbus_link_ops OPS = {.transact = transact, .state = state, .close = free};

int sim_modbus_link(struct sim_bench *bench, struct modbus_link *link, struct err *e) {
    struct sim_modbus *s = calloc(1, sizeof *s);
    if (!s)
        return err_set(e, ERR_NOMEM, "no memory for the simulated bus");
    *s = (struct sim_modbus){.bench = bench, .ready_us = INT64_MIN, .last_reply_us = INT64_MIN};
    *link = (struct modbus_link){.ops = &OPS, .self = s, .name = "sim:modbus"};
    return 0;
}
