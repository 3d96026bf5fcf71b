#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "sim/serve.h"

/* A frame ends with a silence of C3.5, >= 2.5 ms at 19200 baud and above (stage-modbus.md 1.1); a pty delivers a
 * frame at once, and a host under load may be late between two writes. */
#define GAP_US 4000
#define FRAME_MAX 256
#define REPLIES 8 /* late ones that can be on their way */

struct reply {
    uint8_t data[FRAME_MAX];
    size_t size;
    int64_t due_us;
};

struct line {
    struct serve serve;
    int master, slave; /* holding the slave end open keeps the pty alive while no host has it open */
    struct reactor_timer *gap, *delay;
    uint8_t in[2 * FRAME_MAX];
    size_t n;
    struct reply reply[REPLIES];
    int n_replies;
};

/* CRC-16 of Modbus: reflected 0x8005, starting at FFFF, low byte first on the wire. */
static uint16_t crc16(const uint8_t *data, size_t n) {
    uint16_t crc = 0xFFFF;
    for (size_t i = 0; i < n; i++) {
        crc ^= data[i];
        for (int bit = 0; bit < 8; bit++)
            crc = (uint16_t)(crc & 1 ? crc >> 1 ^ 0xA001 : crc >> 1);
    }
    return crc;
}

static void send_due(struct line *l) {
    int64_t now_us = clock_stamp(l->serve.bench->clock);
    while (l->n_replies > 0 && l->reply[0].due_us <= now_us) {
        ssize_t sent = write(l->master, l->reply[0].data, l->reply[0].size);
        (void)sent; /* a host that does not read loses its replies, as on a wire */
        memmove(l->reply, l->reply + 1, sizeof l->reply[0] * (size_t)--l->n_replies);
    }
    if (l->n_replies > 0)
        reactor_timer_in(l->delay, l->reply[0].due_us - now_us);
}

static void queue(struct line *l, int64_t now_us, uint8_t unit, const uint8_t *pdu, size_t n) {
    if (l->n_replies == REPLIES)
        return;
    struct reply *r = &l->reply[l->n_replies++];
    r->data[0] = unit;
    memcpy(r->data + 1, pdu, n);
    uint16_t crc = crc16(r->data, n + 1);
    r->data[n + 1] = (uint8_t)crc;
    r->data[n + 2] = (uint8_t)(crc >> 8);
    r->size = n + 3;
    r->due_us = now_us + l->serve.reply_delay_us;
}

/* Silence: what has come is a frame, or noise that no drive answers (stage-modbus.md 1.1, "no reply when"). */
static void on_gap(void *arg) {
    struct line *l = arg;
    struct sim_bench *b = l->serve.bench;
    size_t n = l->n;
    l->n = 0;
    if (n < 4 || n > FRAME_MAX || crc16(l->in, n - 2) != (l->in[n - 2] | l->in[n - 1] << 8))
        return;
    int64_t now_us = clock_stamp(b->clock);
    uint8_t reply[AZ_PDU_MAX];
    bool broadcast = l->in[0] == 0;
    for (int i = 0; i < b->n_units && broadcast; i++)
        sim_bench_bus(b, now_us, b->unit[i].config.unit, l->in + 1, n - 3, reply);
    size_t size = broadcast ? 0 : sim_bench_bus(b, now_us, l->in[0], l->in + 1, n - 3, reply);
    if (size > 0)
        queue(l, now_us, l->in[0], reply, size);
    send_due(l);
}

static void on_delay(void *arg) {
    send_due(arg);
}

static void on_bytes(void *arg, int events) {
    (void)events;
    struct line *l = arg;
    if (l->n == sizeof l->in)
        l->n = 0;
    ssize_t got = read(l->master, l->in + l->n, sizeof l->in - l->n);
    if (got <= 0)
        return;
    l->n += (size_t)got;
    reactor_timer_in(l->gap, GAP_US);
}

static int open_pty(struct line *l, char *name, size_t size, struct err *e) {
    struct termios raw;
    l->master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (l->master < 0 || grantpt(l->master) != 0 || unlockpt(l->master) != 0 ||
        ptsname_r(l->master, name, size) != 0)
        return err_errno(e, ERR_IO, errno, "cannot make a pseudo terminal for the Modbus bus");
    l->slave = open(name, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (l->slave < 0 || tcgetattr(l->slave, &raw) != 0)
        return err_errno(e, ERR_IO, errno, "cannot open the pseudo terminal %s", name);
    cfmakeraw(&raw);
    cfsetspeed(&raw, B115200);
    tcsetattr(l->slave, TCSANOW, &raw);
    return 0;
}

static int make_link(const char *path, const char *target, struct err *e) {
    char old[64];
    ssize_t n = readlink(path, old, sizeof old);
    if (n > 5 && strncmp(old, "/dev/", 5) == 0)
        unlink(path); /* of an earlier run */
    if (symlink(target, path) != 0)
        return err_errno(e, ERR_IO, errno, "cannot make the link %s to %s", path, target);
    return 0;
}

static void end(struct line *l) {
    reactor_timer_end(l->gap);
    reactor_timer_end(l->delay);
    if (l->slave >= 0)
        close(l->slave);
    if (l->master >= 0)
        close(l->master);
    free(l);
}

int serve_modbus_rtu(const struct serve *serve, const char *link_path, char *endpoint, size_t size,
                     struct err *e) {
    char name[64];
    struct line *l = calloc(1, sizeof *l);
    if (!l)
        return err_set(e, ERR_NOMEM, "no memory for a Modbus server");
    *l = (struct line){.serve = *serve, .master = -1, .slave = -1};
    l->gap = reactor_timer(serve->reactor, on_gap, l);
    l->delay = reactor_timer(serve->reactor, on_delay, l);
    int rc = l->gap && l->delay ? 0 : err_set(e, ERR_IO, "cannot make a timer for the Modbus bus");
    if (rc == 0)
        rc = open_pty(l, name, sizeof name, e);
    if (rc == 0 && link_path)
        rc = make_link(link_path, name, e);
    if (rc == 0 && !reactor_watch(serve->reactor, l->master, REACTOR_READ, on_bytes, l))
        rc = err_set(e, ERR_IO, "cannot watch the pseudo terminal of the Modbus bus");
    if (rc) {
        end(l);
        return rc;
    }
    snprintf(endpoint, size, "rtu:%s", link_path ? link_path : name);
    return 0;
}
