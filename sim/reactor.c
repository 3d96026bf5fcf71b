#include "sim/reactor.h"

#include <signal.h>
#include <stdlib.h>
#include <sys/timerfd.h>
#include <unistd.h>
#include <uv.h>

struct reactor {
    uv_loop_t loop;
    uv_signal_t term, interrupt;
};

struct reactor_watch {
    uv_poll_t poll;
    reactor_ready *ready;
    void *arg;
};

struct reactor_timer {
    int fd;
    struct reactor_watch *watch;
    reactor_fire *fire;
    void *arg;
};

static void on_signal(uv_signal_t *signal, int number) {
    (void)number;
    uv_stop(signal->loop);
}

int reactor_new(struct reactor **out, struct err *e) {
    struct reactor *r = calloc(1, sizeof *r);
    if (!r)
        return err_set(e, ERR_NOMEM, "no memory for the event loop");
    int rc = uv_loop_init(&r->loop);
    if (rc != 0) {
        free(r);
        return err_set(e, ERR_IO, "cannot start an event loop: %s", uv_strerror(rc));
    }
    uv_signal_init(&r->loop, &r->term);
    uv_signal_init(&r->loop, &r->interrupt);
    uv_signal_start(&r->term, on_signal, SIGTERM);
    uv_signal_start(&r->interrupt, on_signal, SIGINT);
    *out = r;
    return 0;
}

static void free_watch(uv_handle_t *handle) {
    free(handle->data);
}

int reactor_run(struct reactor *r, struct err *e) {
    int rc = uv_run(&r->loop, UV_RUN_DEFAULT);
    return rc < 0 ? err_set(e, ERR_IO, "the event loop ended: %s", uv_strerror(rc)) : 0;
}

static void on_poll(uv_poll_t *poll, int status, int events) {
    struct reactor_watch *w = poll->data;
    /* a descriptor in error is readable: the reader's own call tells what is wrong */
    int seen = status < 0 ? REACTOR_READ : 0;
    seen |= events & (UV_READABLE | UV_DISCONNECT) ? REACTOR_READ : 0;
    seen |= events & UV_WRITABLE ? REACTOR_WRITE : 0;
    w->ready(w->arg, seen);
}

struct reactor_watch *reactor_watch(struct reactor *r, int fd, int events, reactor_ready *ready, void *arg) {
    struct reactor_watch *w = calloc(1, sizeof *w);
    if (!w)
        return NULL;
    w->ready = ready;
    w->arg = arg;
    if (uv_poll_init(&r->loop, &w->poll, fd) != 0) {
        free(w);
        return NULL;
    }
    w->poll.data = w;
    reactor_watch_change(w, events);
    return w;
}

void reactor_watch_change(struct reactor_watch *w, int events) {
    int wanted = (events & REACTOR_READ ? UV_READABLE : 0) | (events & REACTOR_WRITE ? UV_WRITABLE : 0);
    if (wanted)
        uv_poll_start(&w->poll, wanted, on_poll);
    else
        uv_poll_stop(&w->poll);
}

void reactor_watch_end(struct reactor_watch *w) {
    if (!w)
        return;
    uv_poll_stop(&w->poll);
    uv_close((uv_handle_t *)&w->poll, free_watch);
}

static void on_timer(void *arg, int events) {
    (void)events;
    struct reactor_timer *t = arg;
    uint64_t times;
    if (read(t->fd, &times, sizeof times) == (ssize_t)sizeof times)
        t->fire(t->arg);
}

struct reactor_timer *reactor_timer(struct reactor *r, reactor_fire *fire, void *arg) {
    struct reactor_timer *t = calloc(1, sizeof *t);
    if (!t)
        return NULL;
    *t = (struct reactor_timer){
        .fd = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC), .fire = fire, .arg = arg};
    t->watch = t->fd < 0 ? NULL : reactor_watch(r, t->fd, REACTOR_READ, on_timer, t);
    if (!t->watch) {
        if (t->fd >= 0)
            close(t->fd);
        free(t);
        return NULL;
    }
    return t;
}

void reactor_timer_in(struct reactor_timer *t, int64_t delay_us) {
    if (delay_us < 1)
        delay_us = 1; /* zero would turn the timer off */
    struct itimerspec when = {
        .it_value = {.tv_sec = delay_us / 1000000, .tv_nsec = delay_us % 1000000 * 1000}};
    timerfd_settime(t->fd, 0, &when, NULL);
}

void reactor_timer_off(struct reactor_timer *t) {
    struct itimerspec never = {0};
    timerfd_settime(t->fd, 0, &never, NULL);
}

void reactor_timer_end(struct reactor_timer *t) {
    if (!t)
        return;
    reactor_watch_end(t->watch);
    close(t->fd);
    free(t);
}
