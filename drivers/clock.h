/*
 * clock.h — the one clock of a goniod: real (CLOCK_MONOTONIC) or virtual.
 *
 * `now` is the stamp of the last event of a seam (a reply, a completion, the end of a wait); it does not run
 * on between events. Microseconds since the clock was made. Nothing else in goniod reads a clock or sleeps.
 * UTC is written down, never decided by.
 *
 * Virtual time moves only through clock_advance, which only bench_wait calls. A virtual clock's UTC is a
 * fixed epoch plus its time, so that a simulated session has the same bytes every time.
 * Threads    one: the campaign thread. Other threads read published snapshots.
 * Checked    tests/unit/test_clock.c
 */
#ifndef DRIVERS_CLOCK_H
#define DRIVERS_CLOCK_H

#include <stdbool.h>
#include <stdint.h>

#define CLOCK_NEVER INT64_MAX
#define CLOCK_VIRTUAL_EPOCH_S 1767225600LL /* 2026-01-01T00:00:00Z */

struct clock {
    bool is_virtual;
    int64_t now_us;
    int64_t start_us;     /* CLOCK_MONOTONIC at now_us == 0 (real) */
    int64_t utc_start_us; /* UTC at now_us == 0 */
};

void clock_init_real(struct clock *c);
void clock_init_virtual(struct clock *c);
int64_t clock_now_us(const struct clock *c);
int64_t clock_utc_us(const struct clock *c); /* microseconds since 1970, for writing down */
/* An event of a seam has just happened: a real clock reads the time; a virtual one stays. Returns now. */
int64_t clock_stamp(struct clock *c);
/* bench_wait only, virtual only; never backwards. */
void clock_advance(struct clock *c, int64_t to_us);
/* The silence a bus needs between two frames: at most 50 ms, real clock sleeps, virtual does nothing. */
void clock_gap(struct clock *c, int64_t gap_us);

#endif
