/*
 * bench.h — the one place where the campaign waits, and all that is served while it waits.
 *
 * bench_wait(bench, until, done) serves, in due order: axis polls, USB completions, commands, scripted
 * faults, the status snapshot. Each is a service: when it wants to run, what it runs, and which descriptors
 * wake it. With a real clock bench_wait polls the descriptors until the earliest due time; with a virtual
 * clock it moves time there, but only while no service has real work outstanding (a write, a fit) and the
 * bench is not frozen (paused, or held for a person).
 *
 * Promises   A service's run() is called at or after its due time, or when a descriptor of it is ready;
 *            services due at the same time run in the order they were added, then those a descriptor woke.
 *            A service may add or remove services, itself too. Re-entrant use (bench_wait inside run()) is a
 *            bug and asserts. run() returns within 100 ms. A service due at until_us or before runs before
 *            the wait ends. A cancel raised without a descriptor is noticed within BENCH_CANCEL_MS.
 * Checked    tests/unit/test_bench.c
 */
#ifndef DRIVERS_BENCH_H
#define DRIVERS_BENCH_H

#include <poll.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#include "drivers/clock.h"
#include "proto/err.h"

#define BENCH_SERVICES 24
#define BENCH_CANCEL_MS 50

struct bench_service {
    const char *name;
    void *self;
    int64_t (*due_us)(void *self); /* next time run() is wanted; CLOCK_NEVER = only on a descriptor */
    void (*run)(void *self);
    bool (*outstanding)(void *self);                            /* or NULL: never */
    int (*descriptors)(void *self, struct pollfd *fd, int max); /* how many it filled in; or NULL: none */
    int64_t ready_us; /* bench's own: when a descriptor was seen ready and run() not called yet */
};

/* Raised by anyone (also another thread or a signal handler); an argument of every call that waits. */
struct cancel {
    atomic_bool raised;
};

struct bench {
    struct clock *clock;
    struct bench_service service[BENCH_SERVICES];
    int n_services;
    bool frozen;    /* virtual time stands still until a descriptor wakes something that thaws it */
    bool waiting;   /* guards against re-entry */
    unsigned turns; /* bench's own */
};

enum bench_result { BENCH_DONE = 0, BENCH_UNTIL = 1 };

void bench_init(struct bench *b, struct clock *clock);
int bench_add(struct bench *b, const struct bench_service *service); /* -ERR_RANGE when full */
void bench_remove(struct bench *b, void *self);

/*
 * Waits until done(arg) is true (BENCH_DONE), the clock reaches until_us (BENCH_UNTIL) or cancel is raised
 * (-ERR_CANCELLED). done may be NULL (wait for time only), cancel may be NULL. done is tested after every
 * service run and once before the first wait.
 *
 * -ERR_STATE is our own mistake, returned rather than hanging or spinning: nothing is left that could end
 * the wait (no due time, no descriptor), or services stay due without ever letting time go on.
 */
int bench_wait(struct bench *b, int64_t until_us, bool (*done)(void *), void *arg,
               const struct cancel *cancel);

#endif
