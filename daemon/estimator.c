#include "daemon/estimator.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/timerfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include "proto/process.h"

#define SEND_PATIENCE_MS 1000
#define PREFIX 4 /* uint32, little-endian: bytes of text that follow */

struct estimator {
    struct bench *bench;
    char program[PATH_MAX];
    int deadline_s;
    pid_t child; /* 0 = none */
    int fd;      /* -1 = none */
    int timer_fd;
    int failures;      /* in a row */
    bool open;         /* a question is open */
    bool over;         /* its reply is whole, or `why` says that there will be none */
    const char *why;   /* or NULL */
    int64_t answer_us; /* not before */
    estimator_answer *answer;
    void *arg;
    char *out;
    size_t out_size, out_done;
    char *in;
    size_t in_size, in_capacity;
};

static void set_deadline(struct estimator *s, int seconds) {
    struct itimerspec t = {.it_value = {.tv_sec = seconds}};
    timerfd_settime(s->timer_fd, 0, &t, NULL);
}

static void end_child(struct estimator *s) {
    if (s->fd >= 0)
        close(s->fd);
    s->fd = -1;
    if (s->child > 0) {
        kill(s->child, SIGKILL);
        while (waitpid(s->child, NULL, 0) < 0 && errno == EINTR)
            ;
    }
    s->child = 0;
}

static void clear_question(struct estimator *s) {
    free(s->out);
    s->out = NULL;
    s->out_size = s->out_done = s->in_size = 0;
    s->open = s->over = false;
    s->why = NULL;
    set_deadline(s, 0);
}

static void give_up(struct estimator *s, const char *why) {
    end_child(s);
    set_deadline(s, 0);
    s->failures++;
    s->why = why;
    s->over = true;
}

/* ---- the child ---- */

static int start_child(struct estimator *s, struct err *e) {
    int end[2];
    if (s->failures > ESTIMATOR_RESTARTS)
        return err_set(e, ERR_FIT, "%s failed %d times in a row and is not started again", s->program,
                       s->failures);
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, end) < 0) {
        int saved = errno;
        return err_errno(e, ERR_FIT, saved, "cannot make the socket to %s", s->program);
    }
    const char *const argv[] = {s->program, "--serve", NULL};
    int failed = process_start(argv, end[1], end[1], &s->child);
    close(end[1]);
    if (failed) {
        close(end[0]);
        s->child = 0;
        s->failures++;
        return err_errno(e, ERR_FIT, failed, "cannot start %s", s->program);
    }
    fcntl(end[0], F_SETFL, O_NONBLOCK);
    s->fd = end[0];
    return 0;
}

/* ---- the wire ---- */

static void send_more(struct estimator *s) {
    while (s->out_done < s->out_size) {
        ssize_t n = send(s->fd, s->out + s->out_done, s->out_size - s->out_done, MSG_NOSIGNAL);
        int saved = errno;
        if (n < 0 && saved == EINTR)
            continue;
        if (n < 0 && saved != EAGAIN)
            give_up(s, "ended while it was asked");
        if (n < 0)
            return;
        s->out_done += n;
    }
}

/* Not in bench_wait: the child only reads until it has the whole question. */
static void send_now(struct estimator *s) {
    struct pollfd fd = {.fd = s->fd, .events = POLLOUT};
    do
        send_more(s);
    while (!s->over && s->out_done < s->out_size && poll(&fd, 1, SEND_PATIENCE_MS) > 0);
}

static size_t reply_size(const struct estimator *s) {
    const unsigned char *p = (const unsigned char *)s->in;
    return p[0] | p[1] << 8 | p[2] << 16 | (size_t)p[3] << 24;
}

static void deliver(struct estimator *s) {
    json_error_t where;
    struct err e = {0};
    json_t *reply = s->why ? NULL : json_loadb(s->in + PREFIX, s->in_size - PREFIX, 0, &where);
    if (!reply && !s->why)
        give_up(s, "answered with something that is not JSON");
    if (!reply)
        err_set(&e, ERR_FIT, "%s %s: the measurement goes on without this estimate", s->program, s->why);
    else
        s->failures = 0;
    clear_question(s);
    s->answer(s->arg, reply, reply ? NULL : &e);
    json_decref(reply);
}

/* How many bytes the reply still needs; 0 = complete. */
static size_t reply_missing(struct estimator *s) {
    if (s->in_size < PREFIX)
        return PREFIX - s->in_size;
    return PREFIX + reply_size(s) - s->in_size;
}

static bool make_room(struct estimator *s, size_t size) {
    if (size <= s->in_capacity)
        return true;
    char *larger = size <= ESTIMATOR_REPLY_MAX ? realloc(s->in, size) : NULL;
    if (!larger)
        return false;
    s->in = larger;
    s->in_capacity = size;
    return true;
}

static void receive_more(struct estimator *s) {
    for (size_t missing; (missing = reply_missing(s)) > 0;) {
        if (!make_room(s, s->in_size + missing)) {
            give_up(s, "sent a reply too long to take");
            return;
        }
        ssize_t n = recv(s->fd, s->in + s->in_size, missing, 0);
        int saved = errno;
        if (n < 0 && saved == EINTR)
            continue;
        if (n < 0 && saved == EAGAIN)
            return;
        if (n <= 0) {
            give_up(s, "ended without an answer");
            return;
        }
        s->in_size += n;
    }
    set_deadline(s, 0);
    s->over = true;
}

/* ---- the bench service ---- */

/* From here on virtual time stands still until there is an answer. Before, nothing of the child may be noticed: even a
 * wait that is woken for nothing looks at what it waits for, at a time that no two runs have in common. */
static bool is_due(const struct estimator *s) {
    return clock_now_us(s->bench->clock) >= s->answer_us;
}

static int64_t due_us(void *self) {
    const struct estimator *s = self;
    return s->open && (s->over || !is_due(s)) ? s->answer_us : CLOCK_NEVER;
}

static void run(void *self) {
    struct estimator *s = self;
    uint64_t expired = 0;
    if (read(s->timer_fd, &expired, sizeof expired) > 0 && s->open && !s->over)
        give_up(s, "did not answer in time");
    if (s->open && !s->over)
        send_more(s);
    if (s->open && !s->over)
        receive_more(s);
    if (s->open && s->over && is_due(s))
        deliver(s);
}

bool estimator_idle(void *self) {
    return !((struct estimator *)self)->open;
}

static bool outstanding(void *self) {
    const struct estimator *s = self;
    return s->open && is_due(s);
}

static int descriptors(void *self, struct pollfd *fd, int max) {
    struct estimator *s = self;
    if (!s->open || s->over || !is_due(s) || max < 2)
        return 0;
    short events = POLLIN | (s->out_done < s->out_size ? POLLOUT : 0);
    fd[0] = (struct pollfd){.fd = s->fd, .events = events};
    fd[1] = (struct pollfd){.fd = s->timer_fd, .events = POLLIN};
    return 2;
}

/* ---- calls ---- */

int estimator_program(const char *named, char *path, size_t size, struct err *e) {
    if (!named)
        named = getenv("GONIOFIT");
    if (named && *named) {
        snprintf(path, size, "%s", named);
        return 0;
    }
    ssize_t n = readlink("/proc/self/exe", path, size - sizeof "goniofit");
    int saved = errno;
    if (n < 0)
        return err_errno(e, ERR_IO, saved, "cannot find out where goniod is installed: set GONIOFIT");
    path[n] = 0;
    strcpy(strrchr(path, '/') + 1, "goniofit");
    return 0;
}

int estimator_new(struct estimator **estimator, struct bench *bench, const char *program, int deadline_s,
                  struct err *e) {
    struct estimator *s = calloc(1, sizeof *s);
    if (!s)
        return err_set(e, ERR_NOMEM, "no memory for the estimator");
    s->bench = bench;
    s->fd = -1;
    s->deadline_s = deadline_s ? deadline_s : ESTIMATOR_DEADLINE_S;
    s->timer_fd = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    int saved = errno;
    int result = s->timer_fd < 0 ? err_errno(e, ERR_IO, saved, "cannot make the estimator's timer")
                                 : estimator_program(program, s->program, sizeof s->program, e);
    struct bench_service service = {.name = "estimator",
                                    .self = s,
                                    .due_us = due_us,
                                    .run = run,
                                    .outstanding = outstanding,
                                    .descriptors = descriptors};
    if (result == 0)
        result = bench_add(bench, &service);
    if (result < 0) {
        estimator_free(s);
        return result;
    }
    *estimator = s;
    return 0;
}

void estimator_free(struct estimator *s) {
    if (!s)
        return;
    bench_remove(s->bench, s);
    end_child(s);
    if (s->timer_fd >= 0)
        close(s->timer_fd);
    free(s->out);
    free(s->in);
    free(s);
}

static int frame_request(struct estimator *s, char *request) {
    size_t size = strlen(request);
    s->out = realloc(request, size + PREFIX);
    if (!s->out) {
        free(request);
        return -ERR_NOMEM;
    }
    memmove(s->out + PREFIX, s->out, size);
    for (int i = 0; i < PREFIX; i++)
        s->out[i] = (char)(size >> (8 * i));
    s->out_size = size + PREFIX;
    s->out_done = s->in_size = 0;
    return 0;
}

int estimator_ask(struct estimator *s, char *request, int64_t virtual_us, estimator_answer *answer, void *arg,
                  struct err *e) {
    const struct clock *clock = s->bench->clock;
    int result = s->open ? err_set(e, ERR_BUSY, "%s is still at the question before", s->program) : 0;
    if (result == 0 && s->fd < 0)
        result = start_child(s, e);
    if (result < 0) {
        free(request);
        return result;
    }
    if (frame_request(s, request) < 0)
        return err_set(e, ERR_NOMEM, "no memory for a question to %s", s->program);
    s->open = true;
    s->answer_us = clock_now_us(clock) + (clock->is_virtual ? virtual_us : 0);
    s->answer = answer;
    s->arg = arg;
    set_deadline(s, s->deadline_s);
    if (!is_due(s))
        send_now(s);
    return 0;
}

void estimator_drop(struct estimator *s) {
    if (!s->open)
        return;
    end_child(s);
    clear_question(s);
}

void estimator_forgive(struct estimator *s) {
    s->failures = 0;
}
