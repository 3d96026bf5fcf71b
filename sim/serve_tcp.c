#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "sim/serve.h"

#define HEADER 7 /* transaction, protocol, length, unit */
#define ADU_MAX 260

struct server {
    struct serve serve;
    int fd;
};

struct client {
    struct serve serve;
    int fd;
    struct reactor_watch *watch;
    struct reactor_timer *delay;
    uint8_t in[4 * ADU_MAX];
    size_t n;
    bool waiting; /* a reply is on its way */
    uint8_t out[ADU_MAX];
    size_t out_size;
};

static void drop(struct client *c) {
    reactor_watch_end(c->watch);
    reactor_timer_end(c->delay);
    close(c->fd);
    free(c);
}

/* A bad header cannot be resynchronised: the connection ends, as drives do. */
static bool bad_header(const struct client *c) {
    size_t length = (size_t)(c->in[4] << 8 | c->in[5]);
    return c->in[2] || c->in[3] || length < 2 || length > ADU_MAX - 6;
}

static void answer(struct client *c, size_t length) {
    struct sim_bench *b = c->serve.bench;
    uint8_t reply[AZ_PDU_MAX];
    size_t n = sim_bench_bus(b, clock_stamp(b->clock), c->in[6], c->in + HEADER, length - 1, reply);
    if (n == 0)
        return; /* mute, or no such unit on this bus: no reply comes */
    memcpy(c->out, c->in, HEADER);
    c->out[4] = (uint8_t)((n + 1) >> 8);
    c->out[5] = (uint8_t)(n + 1);
    memcpy(c->out + HEADER, reply, n);
    c->out_size = HEADER + n;
    c->waiting = true;
}

static bool send_reply(struct client *c) {
    c->waiting = false;
    return send(c->fd, c->out, c->out_size, MSG_NOSIGNAL) == (ssize_t)c->out_size;
}

/* false: the connection is over. */
static bool work(struct client *c) {
    while (!c->waiting && c->n >= HEADER) {
        size_t length = (size_t)(c->in[4] << 8 | c->in[5]);
        if (bad_header(c))
            return false;
        if (c->n < 6 + length)
            return true;
        answer(c, length);
        c->n -= 6 + length;
        memmove(c->in, c->in + 6 + length, c->n);
        if (c->waiting && c->serve.reply_delay_us > 0)
            reactor_timer_in(c->delay, c->serve.reply_delay_us);
        else if (c->waiting && !send_reply(c))
            return false;
    }
    return true;
}

static void on_delay(void *arg) {
    struct client *c = arg;
    if (!send_reply(c) || !work(c))
        drop(c);
}

static void on_client(void *arg, int events) {
    (void)events;
    struct client *c = arg;
    if (c->n == sizeof c->in) {
        drop(c);
        return;
    }
    ssize_t got = recv(c->fd, c->in + c->n, sizeof c->in - c->n, 0);
    if (got < 0 && (errno == EAGAIN || errno == EINTR))
        return;
    if (got > 0)
        c->n += (size_t)got;
    if (got <= 0 || !work(c))
        drop(c);
}

static void on_connection(void *arg, int events) {
    (void)events;
    struct server *s = arg;
    int fd = serve_accept(s->fd);
    struct client *c = fd >= 0 ? calloc(1, sizeof *c) : NULL;
    if (!c) {
        if (fd >= 0)
            close(fd);
        return;
    }
    c->serve = s->serve;
    c->fd = fd;
    c->delay = reactor_timer(s->serve.reactor, on_delay, c);
    c->watch = c->delay ? reactor_watch(s->serve.reactor, fd, REACTOR_READ, on_client, c) : NULL;
    if (!c->watch)
        drop(c);
}

int serve_modbus_tcp(const struct serve *serve, int port, char *endpoint, size_t size, struct err *e) {
    struct server *s = calloc(1, sizeof *s);
    if (!s)
        return err_set(e, ERR_NOMEM, "no memory for a Modbus server");
    s->serve = *serve;
    int rc = serve_listen_tcp(port, &s->fd, &port, e);
    if (rc == 0 && !reactor_watch(serve->reactor, s->fd, REACTOR_READ, on_connection, s)) {
        close(s->fd);
        rc = err_set(e, ERR_IO, "cannot watch the socket of the Modbus server");
    }
    if (rc) {
        free(s);
        return rc;
    }
    snprintf(endpoint, size, "tcp:127.0.0.1:%d", port);
    return 0;
}
