#include "drivers/clock.h"

#include <assert.h>
#include <time.h>

#define GAP_MAX_US 50000 /* clock.h: a longer silence is a wait and belongs into bench_wait */

static int64_t read_us(clockid_t id) {
    struct timespec t;
    clock_gettime(id, &t);
    return t.tv_sec * 1000000LL + t.tv_nsec / 1000;
}

void clock_init_real(struct clock *c) {
    *c = (struct clock){.start_us = read_us(CLOCK_MONOTONIC), .utc_start_us = read_us(CLOCK_REALTIME)};
}

void clock_init_virtual(struct clock *c) {
    *c = (struct clock){.is_virtual = true, .utc_start_us = CLOCK_VIRTUAL_EPOCH_S * 1000000LL};
}

int64_t clock_now_us(const struct clock *c) {
    return c->now_us;
}

int64_t clock_utc_us(const struct clock *c) {
    return c->utc_start_us + c->now_us;
}

int64_t clock_stamp(struct clock *c) {
    if (!c->is_virtual)
        c->now_us = read_us(CLOCK_MONOTONIC) - c->start_us;
    return c->now_us;
}

void clock_advance(struct clock *c, int64_t to_us) {
    assert(c->is_virtual && to_us >= c->now_us && to_us < CLOCK_NEVER);
    c->now_us = to_us;
}

void clock_gap(struct clock *c, int64_t gap_us) {
    assert(gap_us <= GAP_MAX_US);
    if (c->is_virtual || gap_us <= 0)
        return;
    struct timespec left = {.tv_nsec = gap_us * 1000};
    while (clock_nanosleep(CLOCK_MONOTONIC, 0, &left, &left) != 0)
        continue; /* a signal does not shorten the silence the bus needs */
}
