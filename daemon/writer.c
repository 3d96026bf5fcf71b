#include "daemon/writer_private.h"

#include <assert.h>
#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "proto/units.h"

#define EXCHANGE_AGE_REAL_US US_PER_S             /* design 4.5 */
#define EXCHANGE_AGE_VIRTUAL_US (1000 * US_PER_S) /* the same second of the disk's time */
#define EXCHANGES_AT_ONCE 64

struct file {
    struct session *session; /* writer thread only */
    bool in_transaction;     /* writer thread only */
    bool used;               /* campaign thread only */
    int64_t dirty_us; /* campaign thread: stamp of the oldest record not committed; CLOCK_NEVER = none */
};

struct writer {
    struct bench *bench;
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t more;
    struct record *first, **last;
    atomic_size_t waiting_bytes;
    atomic_int_least64_t done_ticket;
    atomic_int failed;
    struct err failure; /* under lock */
    int64_t last_ticket;
    int asleep; /* campaign thread: exchanges pushed since the writer was last woken */
    int done_fd;
    struct file file[WRITER_FILES];
};

/* ---- the writer thread ---- */

static void fail(struct writer *w, const struct err *e) {
    pthread_mutex_lock(&w->lock);
    if (!w->failure.code)
        w->failure = *e;
    pthread_mutex_unlock(&w->lock);
    atomic_store(&w->failed, 1);
    for (int i = 0; i < WRITER_FILES; i++) {
        if (w->file[i].in_transaction)
            session_rollback(w->file[i].session);
        w->file[i].in_transaction = false;
    }
}

static int write_in_transaction(struct file *f, struct record *r, struct err *e) {
    if (!f->in_transaction) {
        int result = session_begin(f->session, e);
        if (result < 0)
            return result;
        f->in_transaction = true;
    }
    return writer_row(f->session, r, e);
}

static int commit(struct file *f, struct err *e) {
    if (!f->in_transaction)
        return 0;
    int result = session_commit(f->session, e);
    if (result == 0)
        f->in_transaction = false;
    return result;
}

static int close_file(struct file *f, bool failed, struct err *e) {
    if (!f->session)
        return 0;
    if (failed && f->in_transaction)
        session_rollback(f->session);
    int result = failed ? 0 : commit(f, e);
    struct err ignored = {0};
    int closed = session_close(f->session, result < 0 || failed ? &ignored : e);
    f->session = NULL;
    f->in_transaction = false;
    return failed ? 0 : result < 0 ? result : closed;
}

static void execute(struct writer *w, struct record *r) {
    struct file *f = &w->file[r->file];
    struct err e = {0};
    bool failed = atomic_load(&w->failed);
    int result = 0;
    if (r->kind == RECORD_CLOSE)
        result = close_file(f, failed, &e);
    else if (failed)
        return;
    else if (r->kind == RECORD_CREATE)
        result = session_create(&f->session, r->bytes, &e);
    else if (r->kind == RECORD_OPEN)
        result = session_open(&f->session, r->bytes, false, &e);
    else if (r->kind == RECORD_COMMIT)
        result = commit(f, &e);
    else
        result = write_in_transaction(f, r, &e);
    if (result < 0)
        fail(w, &e);
}

/* All that waits, in its order. */
static struct record *take_records(struct writer *w) {
    pthread_mutex_lock(&w->lock);
    while (!w->first)
        pthread_cond_wait(&w->more, &w->lock);
    struct record *first = w->first;
    w->first = NULL;
    w->last = &w->first;
    pthread_mutex_unlock(&w->lock);
    return first;
}

static void finish(struct writer *w, struct record *r) {
    size_t waited = atomic_fetch_sub(&w->waiting_bytes, r->size);
    bool makes_room = waited >= WRITER_BYTES_MAX && waited - r->size < WRITER_BYTES_MAX;
    if (r->ticket)
        atomic_store(&w->done_ticket, r->ticket);
    if (r->ticket || makes_room) {
        uint64_t one = 1;
        ssize_t ignored = write(w->done_fd, &one, sizeof one);
        (void)ignored;
    }
    free(r);
}

static void *writer_thread(void *arg) {
    struct writer *w = arg;
    for (bool going = true; going;) {
        for (struct record *next, *r = take_records(w); r; r = next) {
            next = r->next;
            if (r->kind == RECORD_STOP)
                going = false;
            else
                execute(w, r);
            finish(w, r);
        }
    }
    return NULL;
}

/* ---- the bench service ---- */

static int64_t exchange_age_us(const struct writer *w) {
    return w->bench->clock->is_virtual ? EXCHANGE_AGE_VIRTUAL_US : EXCHANGE_AGE_REAL_US;
}

static int64_t due_us(void *self) {
    struct writer *w = self;
    int64_t due = CLOCK_NEVER;
    for (int i = 0; i < WRITER_FILES; i++)
        if (w->file[i].dirty_us != CLOCK_NEVER && w->file[i].dirty_us + exchange_age_us(w) < due)
            due = w->file[i].dirty_us + exchange_age_us(w);
    return due;
}

static void run(void *self) {
    struct writer *w = self;
    uint64_t count;
    ssize_t ignored = read(w->done_fd, &count, sizeof count);
    (void)ignored;
    int64_t now = clock_now_us(w->bench->clock);
    for (int i = 0; i < WRITER_FILES; i++)
        if (w->file[i].dirty_us != CLOCK_NEVER && w->file[i].dirty_us + exchange_age_us(w) <= now)
            writer_commit(w, i);
}

bool writer_idle(void *self) {
    const struct writer *w = self;
    return writer_durable(w, w->last_ticket);
}

static bool outstanding(void *self) {
    return !writer_idle(self) || !writer_has_room(self);
}

static int descriptors(void *self, struct pollfd *fd, int max) {
    struct writer *w = self;
    if (max < 1)
        return 0;
    fd[0] = (struct pollfd){.fd = w->done_fd, .events = POLLIN};
    return 1;
}

/* ---- the campaign's side ---- */

int writer_start(struct writer **writer, struct bench *bench, struct err *e) {
    struct writer *w = calloc(1, sizeof *w);
    if (!w)
        return err_set(e, ERR_NOMEM, "no memory for the writer");
    w->bench = bench;
    w->last = &w->first;
    pthread_mutex_init(&w->lock, NULL);
    pthread_cond_init(&w->more, NULL);
    for (int i = 0; i < WRITER_FILES; i++)
        w->file[i].dirty_us = CLOCK_NEVER;
    w->done_fd = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    int saved = errno;
    if (w->done_fd < 0) {
        free(w);
        return err_errno(e, ERR_IO, saved, "cannot make the writer's event descriptor");
    }
    saved = pthread_create(&w->thread, NULL, writer_thread, w);
    if (saved) {
        close(w->done_fd);
        free(w);
        return err_errno(e, ERR_IO, saved, "cannot start the writer thread");
    }
    struct bench_service service = {.name = "writer",
                                    .self = w,
                                    .due_us = due_us,
                                    .run = run,
                                    .outstanding = outstanding,
                                    .descriptors = descriptors};
    bench_add(bench, &service);
    *writer = w;
    return 0;
}

/* A copy of the object and the bytes in one piece with the record; NULL when memory is out, which is a
 * failure of the writer like any other. */
static struct record *record_new(struct writer *w, enum record_kind kind, int file, const void *object,
                                 size_t object_size, size_t bytes_size) {
    size_t aligned = (object_size + 15) & ~(size_t)15;
    struct record *r = malloc(sizeof *r + aligned + bytes_size);
    if (!r) {
        struct err e = {0};
        err_set(&e, ERR_NOMEM, "no memory for what has to be written");
        pthread_mutex_lock(&w->lock);
        if (!w->failure.code)
            w->failure = e;
        pthread_mutex_unlock(&w->lock);
        atomic_store(&w->failed, 1);
        return NULL;
    }
    *r = (struct record){.kind = kind, .file = file, .size = sizeof *r + aligned + bytes_size};
    r->object = r + 1;
    r->bytes = (char *)r->object + aligned;
    if (object_size)
        memcpy(r->object, object, object_size);
    return r;
}

/* To wake a thread costs more than an exchange to write: a commit follows within its age anyway. */
static bool wakes(struct writer *w, const struct record *r) {
    if (r->kind == RECORD_EXCHANGE && ++w->asleep < EXCHANGES_AT_ONCE)
        return false;
    w->asleep = 0;
    return true;
}

static void push(struct writer *w, struct record *r) {
    if (!r)
        return;
    bool wake = wakes(w, r);
    atomic_fetch_add(&w->waiting_bytes, r->size);
    struct file *f = &w->file[r->file];
    bool row = r->kind >= RECORD_TEXT && r->kind <= RECORD_EXCHANGE;
    if (row && f->dirty_us == CLOCK_NEVER)
        f->dirty_us = clock_now_us(w->bench->clock);
    pthread_mutex_lock(&w->lock);
    *w->last = r;
    w->last = &r->next;
    if (wake)
        pthread_cond_signal(&w->more);
    pthread_mutex_unlock(&w->lock);
}

static int64_t push_ticket(struct writer *w, enum record_kind kind, int file) {
    struct record *r = record_new(w, kind, file, NULL, 0, 0);
    if (!r)
        return 0;
    r->ticket = ++w->last_ticket;
    w->file[file].dirty_us = CLOCK_NEVER;
    push(w, r);
    return w->last_ticket;
}

static struct record *record_text(struct writer *w, enum record_kind kind, int file, const char *key,
                                  const char *text) {
    struct record *r = record_new(w, kind, file, NULL, 0, strlen(text) + 1);
    if (!r)
        return NULL;
    memcpy(r->bytes, text, strlen(text) + 1);
    strncpy(r->key, key, sizeof r->key - 1);
    return r;
}

static int begin_file(struct writer *w, enum record_kind kind, const char *path, int *file, struct err *e) {
    for (int i = 0; i < WRITER_FILES; i++) {
        if (w->file[i].used)
            continue;
        w->file[i].used = true;
        *file = i;
        push(w, record_text(w, kind, i, "", path));
        return 0;
    }
    return err_set(e, ERR_RANGE, "more than %d sessions at once: split the job", WRITER_FILES);
}

int writer_create(struct writer *w, const char *path, int *file, struct err *e) {
    return begin_file(w, RECORD_CREATE, path, file, e);
}

int writer_open(struct writer *w, const char *path, int *file, struct err *e) {
    return begin_file(w, RECORD_OPEN, path, file, e);
}

int64_t writer_close(struct writer *w, int file) {
    return push_ticket(w, RECORD_CLOSE, file);
}

void writer_stop(struct writer *w) {
    if (!w)
        return;
    for (int i = 0; i < WRITER_FILES; i++)
        if (w->file[i].used)
            writer_close(w, i);
    struct record *stop = record_new(w, RECORD_STOP, 0, NULL, 0, 0);
    assert(stop);
    push(w, stop);
    pthread_join(w->thread, NULL);
    bench_remove(w->bench, w);
    close(w->done_fd);
    pthread_mutex_destroy(&w->lock);
    pthread_cond_destroy(&w->more);
    free(w);
}

void writer_text(struct writer *w, int file, const char *key, const char *text) {
    push(w, record_text(w, RECORD_TEXT, file, key, text));
}

void writer_event(struct writer *w, int file, int64_t now_us, const char *kind, const char *json) {
    struct record *r = record_text(w, RECORD_EVENT, file, kind, json);
    if (r)
        r->us = now_us;
    push(w, r);
}

void writer_calibration(struct writer *w, int file, const struct calibration *c) {
    push(w, record_new(w, RECORD_CALIBRATION, file, c, sizeof *c, 0));
}

void writer_exposure(struct writer *w, int file, const struct exposure *x) {
    size_t size = (size_t)x->n_scans * x->pixels * sizeof *x->counts;
    struct record *r = record_new(w, RECORD_EXPOSURE, file, x, sizeof *x, size);
    if (!r)
        return;
    memcpy(r->bytes, x->counts, size);
    r->id = x->id;
    push(w, r);
}

static void push_object(struct writer *w, enum record_kind kind, int file, const void *object, size_t size,
                        int64_t us, int64_t id) {
    struct record *r = record_new(w, kind, file, object, size, 0);
    if (r) {
        r->us = us;
        r->id = id;
    }
    push(w, r);
}

void writer_point(struct writer *w, int file, const struct point *p) {
    push_object(w, RECORD_POINT, file, p, sizeof *p, 0, p->id);
}

void writer_bracket(struct writer *w, int file, const struct bracket *b) {
    push_object(w, RECORD_BRACKET, file, b, sizeof *b, 0, 0);
}

void writer_linearity(struct writer *w, int file, const struct linearity *l) {
    push_object(w, RECORD_LINEARITY, file, l, sizeof *l, 0, 0);
}

void writer_estimate(struct writer *w, int file, int64_t now_us, int64_t last_point_id,
                     const struct estimate *m) {
    push_object(w, RECORD_ESTIMATE, file, m, sizeof *m, now_us, last_point_id);
}

void writer_slopes(struct writer *w, int file, const struct point_slope *slope, size_t n) {
    push_object(w, RECORD_SLOPES, file, slope, n * sizeof *slope, 0, (int64_t)n);
}

void writer_joint(struct writer *w, int file, const struct joint *joint) {
    size_t cells = (size_t)joint->n * (size_t)joint->n, size = cells * sizeof(double);
    struct record *r = record_new(w, RECORD_JOINT, file, joint, sizeof *joint, 2 * size);
    if (r && cells) {
        r->id = (int64_t)cells;
        memcpy(r->bytes, joint->statistical, size);
        memcpy((char *)r->bytes + size, joint->common, size);
    }
    push(w, r);
}

void writer_models(struct writer *w, int file, const char *json) {
    push(w, record_text(w, RECORD_MODELS, file, "", json));
}

void writer_exchange(struct writer *w, int file, int64_t sent_us, int64_t done_us, const char *link,
                     const void *request, size_t request_size, const void *reply, size_t reply_size,
                     int result) {
    struct queued_exchange x = {sent_us, done_us, result, request_size, reply_size};
    struct record *r = record_new(w, RECORD_EXCHANGE, file, &x, sizeof x, request_size + reply_size);
    if (!r)
        return;
    memcpy(r->bytes, request, request_size);
    memcpy((char *)r->bytes + request_size, reply, reply_size);
    strncpy(r->key, link, sizeof r->key - 1);
    push(w, r);
}

int64_t writer_commit(struct writer *w, int file) {
    return push_ticket(w, RECORD_COMMIT, file);
}

int64_t writer_commit_all(struct writer *w) {
    for (int i = 0; i < WRITER_FILES; i++)
        if (w->file[i].used && w->file[i].dirty_us != CLOCK_NEVER)
            writer_commit(w, i);
    return w->last_ticket;
}

bool writer_durable(const struct writer *w, int64_t ticket) {
    return atomic_load(&w->done_ticket) >= ticket;
}

bool writer_has_room(void *self) {
    struct writer *w = self;
    return atomic_load(&w->waiting_bytes) < WRITER_BYTES_MAX;
}

int writer_failure(struct writer *w, struct err *e) {
    if (!atomic_load(&w->failed))
        return 0;
    pthread_mutex_lock(&w->lock);
    struct err first = w->failure;
    pthread_mutex_unlock(&w->lock);
    if (e && !e->code)
        *e = first;
    return -first.code;
}
