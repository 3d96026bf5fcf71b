#include "drivers/modbus_link.h"

#include <assert.h>
#include <errno.h>
#include <fcntl.h>
#include <modbus.h>
#include <netdb.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <termios.h>
#include <unistd.h>

#define EXCEPTION_LAST 11 /* EMBXGTAR; the EMBBAD... codes follow */

/* A reply can be late by far more than the quarantine and then come in just ahead of the reply it is taken
 * for. For so long after a lost reply the silence that proves a reply is therefore as long as a slow unit
 * behind a USB adapter (16 ms latency timer) may take to send the true one. */
#define PROBATION_US 2000000
#define PROBATION_GAP_MS 50
#define URGENT_MS 50 /* three axes on a mute bus are then ordered to stop within response time + 350 ms */

/* The ones libmodbus 3.1.6 knows; any other it would replace by 9600 without an error (stage-modbus.md 4). */
static const int BAUDS[] = {1200,    2400,    4800,    9600,    19200,  38400,  57600,
                            115200,  230400,  460800,  500000,  576000, 921600, 1000000,
                            1152000, 1500000, 2000000, 2500000, 3000000};
/* stage-modbus.md 4.3 rule 6 */
static const int BACKOFF_MS[] = {500, 1000, 2000, 4000, 8000, 10000};
#define BACKOFFS (int)(sizeof BACKOFF_MS / sizeof *BACKOFF_MS)

struct bus {
    modbus_t *ctx;
    struct clock *clock;
    struct modbus_link_config config;
    char device[96]; /* RTU: the tty; TCP: numeric address */
    char port[8];    /* TCP */
    bool tcp;
    int lock_fd;          /* RTU: holds the flock, TCP: the name; -1 = none */
    int refused;          /* connects refused in a row: the place in BACKOFF_MS */
    int64_t probation_us; /* ends then */
    struct modbus_link_state state;
};

static void disconnect(struct bus *b) {
    if (b->state.connected && !b->tcp)
        ioctl(modbus_get_socket(b->ctx), TIOCNXCL);
    if (b->ctx)
        modbus_close(b->ctx); /* also after a connect that failed half way */
    if (b->lock_fd >= 0)
        close(b->lock_fd);
    b->lock_fd = -1;
    b->state.connected = false;
}

static void back_off(struct bus *b) {
    int step = b->refused < BACKOFFS ? b->refused : BACKOFFS - 1;
    b->state.ready_us = clock_stamp(b->clock) + BACKOFF_MS[step] * 1000LL;
    b->refused++;
}

static int refuse_second(const struct bus *b, const char *what, struct err *e) {
    return err_set(e, ERR_BUSY, "%s is in use by another goniod or gonioctl (%s tells which)",
                   b->config.target, what);
}

/* The lock is taken before libmodbus changes the line settings under another owner. */
static int lock_tty(struct bus *b, struct err *e) {
    b->lock_fd = open(b->device, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    int saved = errno;
    if (b->lock_fd < 0) {
        if (saved == EACCES || saved == EPERM)
            return err_errno(e, ERR_PERMISSION, saved,
                             "cannot open %s; add the user to the group that owns it (dialout)", b->device);
        if (saved == EBUSY)
            return err_errno(e, ERR_BUSY, saved, "another program holds %s exclusively", b->device);
        return err_errno(e, ERR_LINK, saved, "cannot open %s; is the adapter plugged in?", b->device);
    }
    if (flock(b->lock_fd, LOCK_EX | LOCK_NB) == 0)
        return 0;
    return refuse_second(b, "fuser -v", e);
}

/* Drives behind TCP obey several masters, and two goniods on this machine would move the axes against each other. A name
 * in the abstract space of unix sockets is held by one process and goes with it; it is that of the address, however the
 * config spells it. */
static int lock_name(struct bus *b, struct err *e) {
    struct sockaddr_un name = {.sun_family = AF_UNIX};
    int n = snprintf(name.sun_path + 1, sizeof name.sun_path - 1, "goniod/%s:%s", b->device, b->port) + 1;
    socklen_t size = offsetof(struct sockaddr_un, sun_path) +
                     (socklen_t)(n < (int)sizeof name.sun_path ? n : (int)sizeof name.sun_path - 1);
    b->lock_fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (b->lock_fd < 0 || bind(b->lock_fd, (struct sockaddr *)&name, size) == 0)
        return 0; /* without a descriptor to spare the connect says so */
    return refuse_second(b, "ss -xap", e);
}

static int connect_bus(struct bus *b, struct err *e) {
    int result = b->tcp ? lock_name(b, e) : lock_tty(b, e);
    if (result == 0) {
        int rc = modbus_connect(b->ctx);
        int saved = errno;
        if (rc)
            result = err_errno(e, ERR_LINK, saved, "cannot connect to the axes at %s", b->config.target);
    }
    if (result) {
        disconnect(b);
        back_off(b);
        return result;
    }
    b->state.connected = true;
    if (!b->tcp)
        ioctl(modbus_get_socket(b->ctx), TIOCEXCL);
    modbus_flush(b->ctx); /* a pty keeps the bytes of an earlier session */
    b->state.ready_us = clock_stamp(b->clock);
    return 0;
}

static int waiting_bytes(const struct bus *b) {
    int n = 0;
    if (ioctl(modbus_get_socket(b->ctx), FIONREAD, &n) != 0)
        return 0; /* the next transaction says what is wrong */
    return n;
}

/* After anything but a clean reply or exception a late frame may still come. */
static void suspect(struct bus *b, bool gone) {
    b->state.failures++;
    if (b->tcp || gone) {
        disconnect(b);
        back_off(b);
        return;
    }
    int64_t quiet = clock_stamp(b->clock) + b->config.quarantine_ms * 1000LL;
    if (quiet > b->state.ready_us)
        b->state.ready_us = quiet;
    b->probation_us = quiet + PROBATION_US;
}

/* Throws away what an earlier exchange left; true if the line is silent then. */
static bool drain(struct bus *b) {
    modbus_flush(b->ctx);
    clock_gap(b->clock, b->config.gap_ms * 1000LL);
    return waiting_bytes(b) == 0;
}

static int ready_to_send(struct bus *b, const struct modbus_request *rq, struct err *e) {
    int64_t now = clock_stamp(b->clock);
    if (!b->state.connected) {
        if (now < b->state.ready_us && !rq->urgent)
            return err_set(e, ERR_LINK, "not connected to %s; the next attempt is in %.1f s",
                           b->config.target, (b->state.ready_us - now) * 1e-6);
        return connect_bus(b, e);
    }
    if (rq->urgent) {
        modbus_flush(b->ctx);
        return 0;
    }
    if (now < b->state.ready_us)
        return err_set(e, ERR_BUSY, "%s is kept silent for %.1f s after a lost reply", b->config.target,
                       (b->state.ready_us - now) * 1e-6);
    bool after_failure = b->state.failures > 0;
    if (b->tcp || waiting_bytes(b) == 0)
        return 0;
    if (drain(b) && after_failure)
        return 0; /* what the quarantine was there to catch */
    suspect(b, false);
    return err_set(e, ERR_BUSY, "%s: bytes came that nobody had asked for; waiting for silence",
                   b->config.target);
}

static void limit_reply(struct bus *b, int ms) {
    modbus_set_response_timeout(b->ctx, (uint32_t)(ms / 1000), (uint32_t)(ms % 1000) * 1000);
}

/* On a bus that has just failed the stop orders of the other axes must not wait for this one's reply. */
static int exchange(struct bus *b, struct modbus_request *rq) {
    bool hurry = rq->urgent && b->state.failures > 0 && b->config.response_ms > URGENT_MS;
    limit_reply(b, hurry ? URGENT_MS : b->config.response_ms);
    modbus_set_slave(b->ctx, rq->unit);
    switch (rq->function) {
    case 3:
        return modbus_read_registers(b->ctx, rq->addr, rq->count, rq->regs);
    case 4:
        return modbus_read_input_registers(b->ctx, rq->addr, rq->count, rq->regs);
    case 6:
        return modbus_write_register(b->ctx, rq->addr, rq->regs[0]);
    default:
        assert(rq->function == 16);
        return modbus_write_registers(b->ctx, rq->addr, rq->count, rq->regs);
    }
}

static bool is_exception(int saved) {
    return saved > MODBUS_ENOBASE && saved <= MODBUS_ENOBASE + EXCEPTION_LAST;
}

static int failed(struct bus *b, const struct modbus_request *rq, int saved, struct err *e) {
    if (saved == ETIMEDOUT) {
        suspect(b, false);
        return err_set(e, ERR_TIMEOUT, "unit %d on %s did not answer within %d ms", rq->unit,
                       b->config.target, b->config.response_ms);
    }
    if (saved >= MODBUS_ENOBASE) {
        suspect(b, false);
        return err_set(e, ERR_IO, "unit %d on %s: the reply was not usable (%s)", rq->unit, b->config.target,
                       modbus_strerror(saved));
    }
    suspect(b, true);
    return err_errno(e, ERR_LINK, saved, "lost the connection to %s", b->config.target);
}

/* True if the line stays silent after a reply, so that it was the reply to this request. */
static bool confirmed(struct bus *b, const struct modbus_request *rq) {
    bool probation = clock_now_us(b->clock) < b->probation_us && !rq->urgent;
    int gap_ms = b->config.gap_ms;
    if (probation && gap_ms < PROBATION_GAP_MS)
        gap_ms = PROBATION_GAP_MS;
    clock_gap(b->clock, gap_ms * 1000LL);
    return waiting_bytes(b) == 0;
}

static int transact(void *self, struct modbus_request *rq, struct err *e) {
    struct bus *b = self;
    rq->exception = 0;
    int result = ready_to_send(b, rq, e);
    if (result)
        return result;
    errno = 0;
    int rc = exchange(b, rq);
    int saved = errno;
    int64_t replied_us = clock_stamp(b->clock);
    bool answered = rc >= 0 || is_exception(saved);
    if (!answered)
        return failed(b, rq, saved, e);
    if (!b->tcp && !confirmed(b, rq)) {
        suspect(b, false);
        return err_set(e, ERR_IO, "unit %d on %s: bytes followed the reply; it may belong to another request",
                       rq->unit, b->config.target);
    }
    b->state.last_reply_us = replied_us;
    b->state.failures = 0;
    b->refused = 0;
    if (rc >= 0)
        return 0;
    rq->exception = saved - MODBUS_ENOBASE;
    return err_set(e, ERR_DEVICE, "unit %d on %s refuses (exception %d, function %d at 0x%04X)", rq->unit,
                   b->config.target, rq->exception, rq->function, rq->addr);
}

static void read_state(void *self, struct modbus_link_state *state) {
    *state = ((struct bus *)self)->state;
}

static void close_bus(void *self) {
    struct bus *b = self;
    disconnect(b);
    modbus_free(b->ctx);
    free((char *)b->config.target);
    free(b);
}

static const struct modbus_link_ops OPS = {.transact = transact, .state = read_state, .close = close_bus};

static int check_serial(const struct modbus_link_config *c, struct err *e) {
    bool known = false;
    for (size_t i = 0; i < sizeof BAUDS / sizeof *BAUDS; i++)
        known |= BAUDS[i] == c->baud;
    if (!known)
        return err_set(e, ERR_INPUT,
                       "%s: no serial line runs at %d baud; use 9600, 19200, 38400, 57600, 115200 "
                       "or 230400",
                       c->target, c->baud);
    if (!strchr("NEO", c->parity) || !c->parity)
        return err_set(e, ERR_INPUT, "%s: parity is N, E or O", c->target);
    return 0;
}

/* Names are resolved once, here: a name server must not be able to hold up a running campaign. */
static int resolve(struct bus *b, const char *host_port, char port[8], struct err *e) {
    const char *colon = strrchr(host_port, ':');
    size_t size = colon ? (size_t)(colon - host_port) : 0;
    char host[96];
    if (size == 0 || size >= sizeof host || strlen(colon + 1) > 5 || !colon[1])
        return err_set(e, ERR_INPUT, "%s: expected tcp:HOST:PORT", b->config.target);
    snprintf(host, sizeof host, "%.*s", (int)size, host_port);
    snprintf(port, 8, "%s", colon + 1);
    struct addrinfo want = {.ai_socktype = SOCK_STREAM}, *found;
    int rc = getaddrinfo(host, port, &want, &found);
    if (rc)
        return err_set(e, ERR_LINK, "%s: cannot resolve '%s' (%s)", b->config.target, host, gai_strerror(rc));
    rc = getnameinfo(found->ai_addr, found->ai_addrlen, b->device, sizeof b->device, NULL, 0, NI_NUMERICHOST);
    freeaddrinfo(found);
    return rc ? err_set(e, ERR_LINK, "%s: %s", b->config.target, gai_strerror(rc)) : 0;
}

static int make_context(struct bus *b, struct err *e) {
    const struct modbus_link_config *c = &b->config;
    int result = 0;
    if (b->tcp)
        result = resolve(b, c->target + 4, b->port, e);
    else
        result = check_serial(c, e);
    if (result)
        return result;
    if (!b->tcp)
        snprintf(b->device, sizeof b->device, "%s", c->target + 4);
    b->ctx = b->tcp ? modbus_new_tcp_pi(b->device, b->port)
                    : modbus_new_rtu(b->device, c->baud, c->parity, c->data_bits, c->stop_bits);
    if (!b->ctx)
        return err_set(e, ERR_NOMEM, "no memory for the link %s", c->target);
    modbus_set_error_recovery(b->ctx, MODBUS_ERROR_RECOVERY_NONE);
    modbus_set_byte_timeout(b->ctx, 0, 0); /* the response time covers the whole reply */
    return 0;
}

int modbus_link_open(struct modbus_link *link, const struct modbus_link_config *config, struct clock *clock,
                     struct err *e) {
    bool tcp = strncmp(config->target, "tcp:", 4) == 0;
    if (!tcp && strncmp(config->target, "rtu:", 4) != 0)
        return err_set(e, ERR_INPUT, "'%s' is no Modbus link; expected rtu:PATH or tcp:HOST:PORT",
                       config->target);
    struct bus *b = calloc(1, sizeof *b);
    char *target = strdup(config->target);
    if (!b || !target) {
        free(b);
        free(target);
        return err_set(e, ERR_NOMEM, "no memory for the link %s", config->target);
    }
    *b = (struct bus){.clock = clock, .config = *config, .tcp = tcp, .lock_fd = -1};
    b->config.target = target;
    b->state.last_reply_us = INT64_MIN;
    int result = make_context(b, e);
    if (result == 0)
        result = connect_bus(b, e);
    if (result) {
        close_bus(b);
        return result;
    }
    link->ops = &OPS;
    link->self = b;
    snprintf(link->name, sizeof link->name, "%s", config->target);
    return 0;
}
