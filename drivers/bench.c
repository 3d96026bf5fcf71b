#include "drivers/bench.h"

#include <assert.h>
#include <string.h>
#include <time.h>

#define DESCRIPTORS_MAX 64
#define GO_ON 2                 /* a turn of the loop that did not end the wait */
#define VIRTUAL_TURNS_A_POLL 16 /* there a poll takes as long as a turn; whoever waits for one gets it */
#define STUCK_RUNS 100000       /* runs at one virtual instant: far above any burst of real services */

struct wait {
    struct bench *bench;
    int64_t until_us;
    bool (*done)(void *);
    void *arg;
    const struct cancel *cancel;
    int runs_here; /* runs since virtual time last moved or a descriptor was ready */
};

static int64_t earlier(int64_t a, int64_t b) {
    return a < b ? a : b;
}

void bench_init(struct bench *b, struct clock *clock) {
    memset(b, 0, sizeof *b);
    b->clock = clock;
}

int bench_add(struct bench *b, const struct bench_service *service) {
    if (b->n_services == BENCH_SERVICES)
        return -ERR_RANGE;
    struct bench_service *added = &b->service[b->n_services++];
    *added = *service;
    added->ready_us = CLOCK_NEVER;
    return 0;
}

void bench_remove(struct bench *b, void *self) {
    int kept = 0;
    for (int i = 0; i < b->n_services; i++)
        if (b->service[i].self != self)
            b->service[kept++] = b->service[i];
    b->n_services = kept;
}

/* The service to run next. At equal times what is due goes before what a descriptor woke, so that a busy
 * descriptor cannot hold up an axis poll. */
static struct bench_service *next_service(struct bench *b, int64_t *when_us) {
    struct bench_service *next = NULL;
    bool woken = false;
    *when_us = CLOCK_NEVER;
    for (int i = 0; i < b->n_services; i++) {
        struct bench_service *s = &b->service[i];
        int64_t due = s->due_us(s->self);
        bool ready = s->ready_us < due;
        int64_t when = ready ? s->ready_us : due;
        if (when < *when_us || (next && when == *when_us && woken && !ready)) {
            next = s;
            woken = ready;
            *when_us = when;
        }
    }
    return next;
}

static void run_service(struct wait *w, struct bench_service *s) {
    s->ready_us = CLOCK_NEVER;
    w->runs_here++;
    s->run(s->self);
}

static bool outstanding(const struct bench *b) {
    for (int i = 0; i < b->n_services; i++)
        if (b->service[i].outstanding && b->service[i].outstanding(b->service[i].self))
            return true;
    return false;
}

static int gather(struct bench *b, struct pollfd *fd, int owner[DESCRIPTORS_MAX]) {
    int n = 0;
    for (int i = 0; i < b->n_services; i++) {
        struct bench_service *s = &b->service[i];
        int added = s->descriptors ? s->descriptors(s->self, fd + n, DESCRIPTORS_MAX - n) : 0;
        for (int k = 0; k < added; k++)
            owner[n++] = i;
    }
    return n;
}

/* Sleeps in poll for at most timeout_us (CLOCK_NEVER: as long as it takes) and marks the services that a
 * descriptor woke. False if nothing could ever wake it. */
static bool poll_descriptors(struct wait *w, int64_t timeout_us) {
    struct bench *b = w->bench;
    struct pollfd fd[DESCRIPTORS_MAX];
    int owner[DESCRIPTORS_MAX];
    int n = gather(b, fd, owner);
    if (n == 0 && timeout_us == CLOCK_NEVER && (b->clock->is_virtual || !w->cancel))
        return false;
    if (n == 0 && timeout_us == 0)
        return true;
    if (w->cancel && timeout_us > BENCH_CANCEL_MS * 1000)
        timeout_us = BENCH_CANCEL_MS * 1000;
    struct timespec t = {.tv_sec = timeout_us / 1000000, .tv_nsec = timeout_us % 1000000 * 1000};
    int ready = ppoll(fd, n, timeout_us == CLOCK_NEVER ? NULL : &t, NULL);
    int64_t now = clock_stamp(b->clock);
    for (int i = 0; ready > 0 && i < n; i++)
        if (fd[i].revents) {
            struct bench_service *s = &b->service[owner[i]];
            s->ready_us = earlier(s->ready_us, now);
            w->runs_here = 0;
        }
    return true;
}

/* Nothing is due: lets time pass until something is, or a descriptor is ready. */
static bool pass_time(struct wait *w, int64_t next_us, bool busy) {
    struct bench *b = w->bench;
    int64_t to = earlier(next_us, w->until_us);
    if (!b->clock->is_virtual)
        return poll_descriptors(w, to == CLOCK_NEVER ? CLOCK_NEVER : to - clock_now_us(b->clock));
    if (to == CLOCK_NEVER || b->frozen || busy)
        return poll_descriptors(w, CLOCK_NEVER);
    clock_advance(b->clock, to);
    w->runs_here = 0;
    return true;
}

/* One turn of the loop: GO_ON, or the result of the wait. */
static int turn(struct wait *w) {
    struct bench *b = w->bench;
    /* Asked before `done`: work that ends just after `done` has missed it must not let virtual time go on. */
    bool busy = b->clock->is_virtual && outstanding(b);
    if (w->cancel && atomic_load(&w->cancel->raised))
        return -ERR_CANCELLED;
    if (w->done && w->done(w->arg))
        return BENCH_DONE;
    if (!b->clock->is_virtual || b->turns++ % VIRTUAL_TURNS_A_POLL == 0)
        poll_descriptors(w, 0);
    int64_t when, now = clock_stamp(b->clock);
    struct bench_service *next = next_service(b, &when);
    if (next && when <= now && when <= w->until_us) {
        run_service(w, next);
        return b->clock->is_virtual && w->runs_here > STUCK_RUNS ? -ERR_STATE : GO_ON;
    }
    if (now >= w->until_us)
        return BENCH_UNTIL;
    return pass_time(w, when, busy) ? GO_ON : -ERR_STATE;
}

int bench_wait(struct bench *b, int64_t until_us, bool (*done)(void *), void *arg,
               const struct cancel *cancel) {
    assert(!b->waiting);
    struct wait w = {.bench = b, .done = done, .arg = arg, .cancel = cancel};
    int64_t now = clock_stamp(b->clock);
    w.until_us = until_us > now ? until_us : now;
    b->waiting = true;
    int result;
    do
        result = turn(&w);
    while (result == GO_ON);
    b->waiting = false;
    return result;
}
