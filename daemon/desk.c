#include "daemon/desk.h"

#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

/* Snapshots are shared by count, so that fifty readers of one status cost no copy under the lock. */
struct shared_snapshot {
    struct desk_snapshot view;
    atomic_int users;
    char *text;
};

struct desk {
    pthread_mutex_t lock;
    int control_fd, campaign_fd;
    int64_t last_ticket, last_event, last_snapshot;
    int promised; /* orders whose outcome has not been taken */
    struct desk_order order[DESK_ORDERS];
    int first_order, n_orders;
    struct desk_outcome outcome[DESK_ORDERS];
    int first_outcome, n_outcomes;
    struct desk_event event[DESK_EVENTS]; /* oldest first */
    int n_events;
    struct shared_snapshot *snapshot;
};

static void ring(int fd) {
    uint64_t one = 1;
    /* A counter that is already full still reads as ready, so a failed write loses nothing. */
    ssize_t ignored = write(fd, &one, sizeof one);
    (void)ignored;
}

static void silence(int fd) {
    uint64_t count;
    ssize_t ignored = read(fd, &count, sizeof count);
    (void)ignored;
}

static struct shared_snapshot *snapshot_new(char *text, int64_t serial) {
    struct shared_snapshot *s = calloc(1, sizeof *s);
    if (!s)
        return NULL;
    s->text = text;
    s->view = (struct desk_snapshot){.json = text, .size = strlen(text), .serial = serial};
    atomic_init(&s->users, 1);
    return s;
}

int desk_new(struct desk **desk, struct err *e) {
    struct desk *d = calloc(1, sizeof *d);
    char *empty = strdup("{}");
    struct shared_snapshot *snapshot = empty ? snapshot_new(empty, 0) : NULL;
    if (!d || !snapshot) {
        free(d);
        free(empty);
        return err_set(e, ERR_NOMEM, "no memory for the desk");
    }
    d->snapshot = snapshot;
    pthread_mutex_init(&d->lock, NULL);
    d->control_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    d->campaign_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    int saved = errno;
    if (d->control_fd < 0 || d->campaign_fd < 0) {
        desk_free(d);
        return err_errno(e, ERR_IO, saved, "cannot make the desk's event descriptors");
    }
    *desk = d;
    return 0;
}

void desk_order_free(struct desk_order *order) {
    if (order->command != COMMAND_RUN)
        return;
    free(order->run.text);
    for (int i = 0; i < order->run.n_files; i++)
        free((char *)order->run.file[i].text);
    order->run.text = NULL;
    order->run.n_files = 0;
}

void desk_free(struct desk *d) {
    if (!d)
        return;
    for (int i = 0; i < d->n_orders; i++)
        desk_order_free(&d->order[(d->first_order + i) % DESK_ORDERS]);
    for (int i = 0; i < d->n_outcomes; i++)
        free(d->outcome[(d->first_outcome + i) % DESK_ORDERS].json);
    for (int i = 0; i < d->n_events; i++)
        free(d->event[i].json);
    desk_snapshot_put(&d->snapshot->view);
    if (d->control_fd >= 0)
        close(d->control_fd);
    if (d->campaign_fd >= 0)
        close(d->campaign_fd);
    pthread_mutex_destroy(&d->lock);
    free(d);
}

int desk_post(struct desk *d, const struct desk_order *order, int64_t *ticket, struct err *e) {
    pthread_mutex_lock(&d->lock);
    bool full = d->promised == DESK_ORDERS;
    if (!full) {
        struct desk_order *slot = &d->order[(d->first_order + d->n_orders++) % DESK_ORDERS];
        *slot = *order;
        slot->ticket = ++d->last_ticket;
        d->promised++;
        if (ticket)
            *ticket = slot->ticket;
    }
    pthread_mutex_unlock(&d->lock);
    if (full)
        return err_set(e, ERR_BUSY,
                       "%d orders are waiting for their outcome: wait for one and send this again",
                       DESK_ORDERS);
    ring(d->campaign_fd);
    return 0;
}

int desk_control_fd(const struct desk *d) {
    return d->control_fd;
}

int desk_campaign_fd(const struct desk *d) {
    return d->campaign_fd;
}

void desk_control_clear(struct desk *d) {
    silence(d->control_fd);
}

void desk_campaign_clear(struct desk *d) {
    silence(d->campaign_fd);
}

bool desk_take_order(struct desk *d, struct desk_order *order) {
    pthread_mutex_lock(&d->lock);
    bool any = d->n_orders > 0;
    if (any) {
        *order = d->order[d->first_order];
        d->first_order = (d->first_order + 1) % DESK_ORDERS;
        d->n_orders--;
    }
    pthread_mutex_unlock(&d->lock);
    return any;
}

void desk_finish(struct desk *d, int64_t ticket, int code, const char *text, char *json) {
    struct desk_outcome o = {.ticket = ticket, .code = abs(code), .json = json};
    if (text)
        strncpy(o.text, text, sizeof o.text - 1);
    pthread_mutex_lock(&d->lock);
    d->outcome[(d->first_outcome + d->n_outcomes++) % DESK_ORDERS] = o;
    pthread_mutex_unlock(&d->lock);
    ring(d->control_fd);
}

bool desk_take_outcome(struct desk *d, struct desk_outcome *outcome) {
    pthread_mutex_lock(&d->lock);
    bool any = d->n_outcomes > 0;
    if (any) {
        *outcome = d->outcome[d->first_outcome];
        d->first_outcome = (d->first_outcome + 1) % DESK_ORDERS;
        d->n_outcomes--;
        d->promised--;
    }
    pthread_mutex_unlock(&d->lock);
    return any;
}

void desk_publish(struct desk *d, char *json) {
    struct shared_snapshot *fresh = json ? snapshot_new(json, 0) : NULL;
    if (!fresh) {
        free(json);
        return;
    }
    pthread_mutex_lock(&d->lock);
    struct shared_snapshot *old = d->snapshot;
    fresh->view.serial = ++d->last_snapshot;
    d->snapshot = fresh;
    pthread_mutex_unlock(&d->lock);
    desk_snapshot_put(&old->view);
    ring(d->control_fd);
}

const struct desk_snapshot *desk_snapshot_get(struct desk *d) {
    pthread_mutex_lock(&d->lock);
    struct shared_snapshot *s = d->snapshot;
    atomic_fetch_add(&s->users, 1);
    pthread_mutex_unlock(&d->lock);
    return &s->view;
}

void desk_snapshot_put(const struct desk_snapshot *snapshot) {
    struct shared_snapshot *s = (struct shared_snapshot *)snapshot;
    if (atomic_fetch_sub(&s->users, 1) == 1) {
        free(s->text);
        free(s);
    }
}

/* Which event makes room: the older one of a kind that coalesces, else the oldest when all places are taken.
 */
static int event_to_drop(const struct desk *d, const char *kind, bool coalesce) {
    for (int i = 0; coalesce && i < d->n_events; i++)
        if (d->event[i].coalesce && !strcmp(d->event[i].kind, kind))
            return i;
    return d->n_events == DESK_EVENTS ? 0 : -1;
}

void desk_event_post(struct desk *d, const char *kind, bool coalesce, char *json) {
    struct desk_event event = {.json = json, .coalesce = coalesce};
    if (!json)
        return;
    strncpy(event.kind, kind, sizeof event.kind - 1);
    pthread_mutex_lock(&d->lock);
    int drop = event_to_drop(d, event.kind, coalesce);
    char *dropped = NULL;
    if (drop >= 0) {
        dropped = d->event[drop].json;
        memmove(&d->event[drop], &d->event[drop + 1], (d->n_events - drop - 1) * sizeof event);
        d->n_events--;
    }
    event.serial = ++d->last_event;
    d->event[d->n_events++] = event;
    pthread_mutex_unlock(&d->lock);
    free(dropped);
    ring(d->control_fd);
}

int desk_events_after(struct desk *d, int64_t after, struct desk_event *events, int max) {
    int n = 0;
    pthread_mutex_lock(&d->lock);
    for (int i = 0; i < d->n_events && n < max; i++) {
        if (d->event[i].serial <= after)
            continue;
        events[n] = d->event[i];
        events[n].json = strdup(d->event[i].json);
        if (events[n].json)
            n++;
    }
    pthread_mutex_unlock(&d->lock);
    return n;
}

void desk_event_free(struct desk_event *event) {
    free(event->json);
    event->json = NULL;
}

int64_t desk_last_event(struct desk *d) {
    pthread_mutex_lock(&d->lock);
    int64_t last = d->last_event;
    pthread_mutex_unlock(&d->lock);
    return last;
}
