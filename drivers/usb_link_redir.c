/* The client side of usbredir (virtual-usb.md 3): a device behind a unix socket or TCP. All sockets are
 * non-blocking; what the socket does not take now waits in the parser's queue until it is writable. */
#include "drivers/usb_link.h"

#include <errno.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
#include <usbredirparser.h>

#include "proto/units.h"

#define SLOTS 16
#define OPEN_US (2 * US_PER_S) /* a host on the same network answers hello in milliseconds */
#define CLEAR_FEATURE 1        /* USB 2.0, 9.4: standard request, feature 0 = ENDPOINT_HALT */
#define TO_ENDPOINT 0x02       /* USB 2.0, 9.3: host to device, standard, recipient endpoint */

struct slot { /* a transfer the peer has not answered yet */
    struct usb_transfer *t;
    uint64_t id;
    int64_t abandon_us; /* CLOCK_NEVER until cancelled */
};

struct redir {
    int fd;
    struct usbredirparser *parser;
    struct clock *clock;
    struct usb_device_info info;
    bool gone, attached;
    int cause; /* errno that ended the stream, 0 = the peer hung up */
    uint64_t next_id;
    struct slot slot[SLOTS];
    char trouble[160]; /* the parser's last complaint, for the sentence of an error */
};

static int read_socket(void *priv, uint8_t *data, int count) {
    struct redir *r = priv;
    ssize_t n = recv(r->fd, data, count, 0);
    int cause = n < 0 ? errno : 0;
    if (cause == EAGAIN || cause == EINTR)
        return 0;
    r->cause = cause;
    return n > 0 ? (int)n : -1;
}

static int write_socket(void *priv, uint8_t *data, int count) {
    struct redir *r = priv;
    ssize_t n = send(r->fd, data, count, MSG_NOSIGNAL);
    int cause = n < 0 ? errno : 0;
    if (cause == EAGAIN || cause == EINTR)
        return 0;
    r->cause = cause;
    return n < 0 ? -1 : (int)n;
}

static void log_trouble(void *priv, int level, const char *message) {
    struct redir *r = priv;
    if (level <= usbredirparser_warning)
        snprintf(r->trouble, sizeof r->trouble, "%s", message);
}

static void complete(struct redir *r, struct slot *s, int status, size_t actual) {
    struct usb_transfer *t = s->t;
    s->t = NULL;
    t->status = status;
    t->actual = actual;
    t->completed_us = clock_stamp(r->clock);
    t->pending = false;
}

static void lose(struct redir *r) {
    r->gone = true;
    for (int i = 0; i < SLOTS; i++)
        if (r->slot[i].t)
            complete(r, &r->slot[i], -ENODEV, 0);
}

static void flush(struct redir *r) {
    if (!r->gone && usbredirparser_has_data_to_write(r->parser) && usbredirparser_do_write(r->parser) < 0)
        lose(r);
}

static void on_hello(void *priv, struct usb_redir_hello_header *hello) {
    (void)priv;
    (void)hello;
}

static void on_device_connect(void *priv, struct usb_redir_device_connect_header *device) {
    struct redir *r = priv;
    r->attached = true;
    r->info.vid = device->vendor_id;
    r->info.pid = device->product_id;
    /* A host without the packet-size capability leaves them 0; the speed tells (spectrometer-ocean.md 2.1).
     */
    int bulk = device->speed == usb_redir_speed_high ? 512 : 64;
    for (int i = 0; i < 32; i++)
        if (r->info.max_packet[i] < 0)
            r->info.max_packet[i] = bulk;
}

static void on_device_disconnect(void *priv) {
    lose(priv);
}

static void on_interface_info(void *priv, struct usb_redir_interface_info_header *info) {
    (void)priv;
    (void)info;
}

static void on_ep_info(void *priv, struct usb_redir_ep_info_header *info) {
    struct redir *r = priv;
    bool sizes = usbredirparser_peer_has_cap(r->parser, usb_redir_cap_ep_info_max_packet_size);
    for (int i = 0; i < 32; i++) {
        int size = sizes ? info->max_packet_size[i] : -1;
        r->info.max_packet[i] = info->type[i] == usb_redir_type_bulk ? size : 0;
    }
}

static void on_control_packet(void *priv, uint64_t id, struct usb_redir_control_packet_header *header,
                              uint8_t *data, int length) {
    struct redir *r = priv;
    (void)id;
    (void)header;
    (void)length;
    usbredirparser_free_packet_data(r->parser, data);
}

static int status_of(int redir_status) {
    switch (redir_status) {
    case usb_redir_success:
        return 0;
    case usb_redir_cancelled:
        return -ECANCELED;
    case usb_redir_stall:
        return -EPIPE;
    case usb_redir_timeout:
        return -ETIMEDOUT;
    case usb_redir_babble:
        return -EOVERFLOW;
    default:
        return -EIO;
    }
}

static struct slot *find_slot(struct redir *r, uint64_t id) {
    for (int i = 0; i < SLOTS; i++)
        if (r->slot[i].t && r->slot[i].id == id)
            return &r->slot[i];
    return NULL;
}

static void on_bulk_packet(void *priv, uint64_t id, struct usb_redir_bulk_packet_header *header,
                           uint8_t *data, int length) {
    struct redir *r = priv;
    struct slot *s = find_slot(r, id); /* NULL: answered after we had given it up */
    if (s && s->t->endpoint & 0x80) {
        size_t room = s->t->length, sent = (size_t)length;
        size_t actual = sent < room ? sent : room;
        if (actual)
            memcpy(s->t->data, data, actual);
        complete(r, s, sent > room ? -EOVERFLOW : status_of(header->status), actual);
    } else if (s) {
        size_t taken = header->length | (size_t)header->length_high << 16;
        complete(r, s, status_of(header->status), taken < s->t->length ? taken : s->t->length);
    }
    usbredirparser_free_packet_data(r->parser, data);
}

static void on_configuration_status(void *priv, uint64_t id,
                                    struct usb_redir_configuration_status_header *status) {
    (void)priv;
    (void)id;
    (void)status;
}

static int host_gone(struct err *e) {
    return err_set(e, ERR_LINK, "the USB redirection host is gone: check that it runs and can be reached");
}

static int submit(void *self, struct usb_transfer *t, struct err *e) {
    struct redir *r = self;
    struct slot *s = NULL;
    for (int i = 0; i < SLOTS && !s; i++)
        if (!r->slot[i].t)
            s = &r->slot[i];
    if (r->gone)
        return host_gone(e);
    if (!s)
        return err_set(e, ERR_BUSY, "%d USB transfers are under way already", SLOTS);
    *s = (struct slot){.t = t, .id = r->next_id++, .abandon_us = CLOCK_NEVER};
    t->pending = true;
    t->status = 0;
    t->actual = 0;
    t->submitted_us = clock_stamp(r->clock);
    struct usb_redir_bulk_packet_header header = {
        .endpoint = t->endpoint, .length = t->length & 0xffff, .length_high = t->length >> 16};
    bool in = t->endpoint & 0x80;
    usbredirparser_send_bulk_packet(r->parser, s->id, &header, in ? NULL : t->data, in ? 0 : (int)t->length);
    flush(r);
    return 0;
}

static void give_up_cancelled(struct redir *r) {
    int64_t now = clock_stamp(r->clock);
    for (int i = 0; i < SLOTS; i++)
        if (r->slot[i].t && r->slot[i].abandon_us <= now)
            complete(r, &r->slot[i], -ECANCELED, 0);
}

static void reap(void *self) {
    struct redir *r = self;
    flush(r);
    /* A packet the parser cannot make sense of leaves the stream in an unknown place: the link is lost. */
    if (!r->gone && usbredirparser_do_read(r->parser) < 0)
        lose(r);
    flush(r);
    give_up_cancelled(r);
}

static void cancel(void *self, struct usb_transfer *t) {
    struct redir *r = self;
    for (int i = 0; i < SLOTS; i++)
        if (r->slot[i].t == t && r->slot[i].abandon_us == CLOCK_NEVER) {
            r->slot[i].abandon_us = clock_stamp(r->clock) + USB_LINK_ABANDON_US;
            usbredirparser_send_cancel_data_packet(r->parser, r->slot[i].id);
        }
    flush(r);
}

/* usbredir has no packet for it; a host turns this standard request into a clear-halt of its own, and the
 * order of the stream puts it before the transfers that follow. The answer is not waited for. */
static int clear_halt(void *self, uint8_t endpoint, struct err *e) {
    struct redir *r = self;
    if (r->gone)
        return host_gone(e);
    struct usb_redir_control_packet_header header = {
        .request = CLEAR_FEATURE, .requesttype = TO_ENDPOINT, .index = endpoint};
    usbredirparser_send_control_packet(r->parser, r->next_id++, &header, NULL, 0);
    flush(r);
    return 0;
}

static int reset(void *self, struct err *e) {
    struct redir *r = self;
    if (r->gone)
        return host_gone(e);
    usbredirparser_send_reset(r->parser);
    flush(r);
    return 0;
}

static int64_t due_us(void *self) {
    const struct redir *r = self;
    int64_t due = CLOCK_NEVER;
    for (int i = 0; i < SLOTS; i++)
        if (r->slot[i].t && r->slot[i].abandon_us < due)
            due = r->slot[i].abandon_us;
    return due;
}

static int descriptors(void *self, struct pollfd *fd, int max) {
    struct redir *r = self;
    if (r->gone || max < 1)
        return 0;
    bool writes = usbredirparser_has_data_to_write(r->parser); /* hello, while it still connects */
    fd[0] = (struct pollfd){.fd = r->fd, .events = POLLIN | (writes ? POLLOUT : 0)};
    return 1;
}

static void close_redir(void *self) {
    struct redir *r = self;
    lose(r);
    if (r->parser)
        usbredirparser_destroy(r->parser);
    if (r->fd >= 0)
        close(r->fd);
    free(r);
}

static const struct usb_link_ops OPS = {
    .submit = submit,
    .reap = reap,
    .cancel = cancel,
    .clear_halt = clear_halt,
    .reset = reset,
    .due_us = due_us,
    .descriptors = descriptors,
    .close = close_redir,
};

static int connect_unix(struct redir *r, const char *path, struct err *e) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    if (strlen(path) >= sizeof address.sun_path)
        return err_set(e, ERR_INPUT, "the socket path '%s' is longer than %zu characters", path,
                       sizeof address.sun_path - 1);
    strcpy(address.sun_path, path);
    r->fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (r->fd < 0 || connect(r->fd, (struct sockaddr *)&address, sizeof address) != 0) {
        int cause = errno;
        return err_errno(e, cause == EACCES ? ERR_PERMISSION : ERR_LINK, cause,
                         "no USB redirection host at unix:%s", path);
    }
    return 0;
}

/* The first address that can be tried; a name with several addresses is not worth a second wait here. */
static int connect_tcp(struct redir *r, const char *where, struct err *e) {
    char host[128];
    const char *colon = strrchr(where, ':');
    if (!colon || colon == where || !colon[1] || colon - where >= (int)sizeof host)
        return err_set(e, ERR_INPUT, "the spectrometer's link is 'usbredir:tcp:%s', expected HOST:PORT",
                       where);
    snprintf(host, sizeof host, "%.*s", (int)(colon - where), where);
    struct addrinfo hints = {.ai_family = AF_UNSPEC, .ai_socktype = SOCK_STREAM}, *found = NULL;
    int rc = getaddrinfo(host, colon + 1, &hints, &found);
    if (rc != 0)
        return err_set(e, ERR_LINK, "the USB redirection host '%s' is unknown: %s", where, gai_strerror(rc));
    r->fd = socket(found->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    int failed = r->fd < 0 ? -1 : connect(r->fd, found->ai_addr, found->ai_addrlen), cause = errno;
    freeaddrinfo(found);
    if (failed && cause != EINPROGRESS)
        return err_errno(e, ERR_LINK, cause, "no USB redirection host at tcp:%s", where);
    int one = 1; /* without it a queued read costs 45 ms (virtual-usb.md 4) */
    setsockopt(r->fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
    return 0;
}

static void parser_init(struct redir *r) {
    static const int CAPS[] = {usb_redir_cap_connect_device_version, usb_redir_cap_device_disconnect_ack,
                               usb_redir_cap_ep_info_max_packet_size, usb_redir_cap_64bits_ids,
                               usb_redir_cap_32bits_bulk_length};
    uint32_t caps[USB_REDIR_CAPS_SIZE] = {0};
    for (size_t i = 0; i < sizeof CAPS / sizeof CAPS[0]; i++)
        usbredirparser_caps_set_cap(caps, CAPS[i]);
    struct usbredirparser *p = r->parser;
    p->priv = r;
    p->log_func = log_trouble;
    p->read_func = read_socket;
    p->write_func = write_socket;
    p->hello_func = on_hello;
    p->device_connect_func = on_device_connect;
    p->device_disconnect_func = on_device_disconnect;
    p->interface_info_func = on_interface_info;
    p->ep_info_func = on_ep_info;
    p->control_packet_func = on_control_packet;
    p->bulk_packet_func = on_bulk_packet;
    p->configuration_status_func = on_configuration_status;
    usbredirparser_init(p, "goniod " GONIOD_VERSION, caps, USB_REDIR_CAPS_SIZE, 0);
}

static bool met(void *arg) {
    const struct redir *r = arg;
    return r->attached || r->gone;
}

static int64_t meeting_due(void *self) {
    (void)self;
    return CLOCK_NEVER;
}

/* Connect, hello, topology, device: on a bench of its own, because no device is served yet when this opens.
 */
static int meet(struct redir *r, const char *where, struct err *e) {
    struct bench bench;
    bench_init(&bench, r->clock);
    bench_add(
        &bench,
        &(struct bench_service){
            .name = "usbredir", .self = r, .due_us = meeting_due, .run = reap, .descriptors = descriptors});
    bench_wait(&bench, clock_stamp(r->clock) + OPEN_US, met, r, NULL);
    if (r->attached && !r->gone)
        return 0;
    if (r->gone && r->cause)
        return err_errno(e, ERR_LINK, r->cause, "no USB redirection host at %s", where);
    if (r->gone)
        return err_set(e, ERR_BUSY,
                       "the USB redirection host at %s hung up before it showed a device: is another "
                       "program using it?%s%s",
                       where, r->trouble[0] ? " " : "", r->trouble);
    if (usbredirparser_have_peer_caps(r->parser))
        return err_set(e, ERR_DEVICE, "the USB redirection host at %s answers but has no device", where);
    return err_set(
        e, ERR_LINK,
        "the USB redirection host at %s did not answer within %lld s: does another program use it?", where,
        OPEN_US / US_PER_S);
}

static int open_stream(struct redir *r, const char *where, struct err *e) {
    int rc;
    if (strncmp(where, "unix:", 5) == 0)
        rc = connect_unix(r, where + 5, e);
    else if (strncmp(where, "tcp:", 4) == 0)
        rc = connect_tcp(r, where + 4, e);
    else
        rc = err_set(e, ERR_INPUT, "the spectrometer's link is 'usbredir:%s', expected unix: or tcp:", where);
    if (rc)
        return rc;
    r->parser = usbredirparser_create();
    if (!r->parser)
        return err_set(e, ERR_NOMEM, "no memory for the USB redirection link");
    parser_init(r);
    return meet(r, where, e);
}

int usb_link_open_redir(struct usb_link *link, const char *where, uint16_t vid, uint16_t pid,
                        struct clock *clock, struct err *e) {
    struct redir *r = calloc(1, sizeof *r);
    if (!r)
        return err_set(e, ERR_NOMEM, "no memory for the USB redirection link");
    *r = (struct redir){.fd = -1, .clock = clock, .next_id = 1};
    int rc = open_stream(r, where, e);
    if (rc == 0 && (r->info.vid != vid || r->info.pid != pid))
        rc = err_set(e, ERR_DEVICE, "the device at %s is %04x:%04x, expected %04x:%04x: wrong model?", where,
                     r->info.vid, r->info.pid, vid, pid);
    if (rc) {
        close_redir(r);
        return rc;
    }
    link->info = r->info;
    snprintf(link->info.path, sizeof link->info.path, "%s", where);
    link->ops = &OPS;
    link->self = r;
    return 0;
}
