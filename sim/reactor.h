/*
 * reactor.h — the loop of goniosim: descriptors, timers of microseconds, and an end on SIGTERM or SIGINT.
 *
 * A watch calls ready(arg, events) while its descriptor can be read or written as asked for; a timer calls
 * fire(arg) once, at or after its time. Both belong to the caller until ended; ending one inside its own or
 * another's call is allowed. A reactor lives as long as its process. Times are CLOCK_MONOTONIC through timerfd, so that a frame is not late by the
 * loop's milliseconds. One thread. Wraps libuv.
 * Errors     -ERR_IO with errno's reason.
 * Checked    tests/wire/
 */
#ifndef SIM_REACTOR_H
#define SIM_REACTOR_H

#include <stdint.h>

#include "proto/err.h"

enum { REACTOR_READ = 1, REACTOR_WRITE = 2 };

struct reactor;
struct reactor_watch;
struct reactor_timer;

typedef void reactor_ready(void *arg, int events);
typedef void reactor_fire(void *arg);

int reactor_new(struct reactor **r, struct err *e);
int reactor_run(struct reactor *r, struct err *e);

struct reactor_watch *reactor_watch(struct reactor *r, int fd, int events, reactor_ready *ready, void *arg);
void reactor_watch_change(struct reactor_watch *w, int events); /* 0: pauses it */
void reactor_watch_end(struct reactor_watch *w); /* does not close the descriptor; NULL is fine */

struct reactor_timer *reactor_timer(struct reactor *r, reactor_fire *fire, void *arg);
void reactor_timer_in(struct reactor_timer *t, int64_t delay_us); /* replaces an earlier time */
void reactor_timer_off(struct reactor_timer *t);
void reactor_timer_end(struct reactor_timer *t);

#endif
