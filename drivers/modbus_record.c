#include <stdlib.h>

#include "drivers/modbus_link.h"

struct recorder {
    struct modbus_link inner;
    struct clock *clock;
    modbus_link_seen *seen;
    void *arg;
};

static int transact(void *self, struct modbus_request *rq, struct err *e) {
    struct recorder *r = self;
    struct modbus_request sent = *rq;
    int64_t sent_us = clock_stamp(r->clock);
    int result = modbus_link_transact(&r->inner, rq, e);
    r->seen(r->arg, sent_us, clock_now_us(r->clock), &sent, rq, result);
    return result;
}

static void state(void *self, struct modbus_link_state *state) {
    modbus_link_state(&((struct recorder *)self)->inner, state);
}

static void close_recorder(void *self) {
    struct recorder *r = self;
    modbus_link_close(&r->inner);
    free(r);
}

static const struct modbus_link_ops OPS = {.transact = transact, .state = state, .close = close_recorder};

int modbus_link_record(struct modbus_link *link, const struct modbus_link *inner, struct clock *clock,
                       modbus_link_seen *seen, void *arg, struct err *e) {
    struct recorder *r = malloc(sizeof *r);
    if (!r)
        return err_set(e, ERR_NOMEM, "no memory to record the link %s", inner->name);
    *r = (struct recorder){.inner = *inner, .clock = clock, .seen = seen, .arg = arg};
    *link = *inner; /* the name */
    link->ops = &OPS;
    link->self = r;
    return 0;
}
