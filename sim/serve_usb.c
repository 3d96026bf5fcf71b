#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>
#include <usbredirparser.h>

#include "sim/serve.h"

/* The host side of usbredir, with the order and the traps of virtual-usb.md 3. One host at a time has the device;
 * the next one waits until it lets go. */

#define HELD 64
#define LENGTH_MAX (1 << 20) /* of a bulk request; the instruments send 8 kB at most */

struct held { /* a bulk IN request that has no data yet */
    uint64_t id;
    struct usb_redir_bulk_packet_header header;
    uint8_t *data;
    size_t length, actual;
};

struct device {
    struct serve serve;
    int listener, fd; /* fd -1: nobody has it */
    struct reactor_watch *waiting, *watch;
    struct reactor_timer *due;
    struct usbredirparser *parser;
    struct held held[HELD];
    int n_held;
    uint8_t configuration;
};

/* USB 2.0 chapter 9: requests that a redirecting client passes on. */
enum { GET_STATUS = 0, CLEAR_FEATURE = 1, GET_DESCRIPTOR = 6, GET_CONFIGURATION = 8, GET_INTERFACE = 10 };
enum { DESCRIPTOR_DEVICE = 1, DESCRIPTOR_CONFIGURATION = 2, DESCRIPTOR_STRING = 3 };

static const uint8_t ENDPOINTS[] = {0x01, 0x82, 0x86, 0x81}; /* the order of the vendor's sheets */

static size_t configuration_descriptor(uint8_t *d) {
    size_t n = 18;
    memcpy(d, (const uint8_t[]){9, 2, 0, 0, 1, 1, 0, 0xC0, 200, 9, 4, 0, 0, sizeof ENDPOINTS, 0xFF, 0, 0, 0},
           n);
    for (size_t i = 0; i < sizeof ENDPOINTS; i++, n += 7) {
        int packet = ocean_max_packet(ENDPOINTS[i]);
        memcpy(d + n, (const uint8_t[]){7, 5, ENDPOINTS[i], 2, (uint8_t)packet, (uint8_t)(packet >> 8), 0},
               7);
    }
    d[2] = (uint8_t)n;
    return n;
}

static size_t string_descriptor(const struct device *s, int index, uint8_t *d) {
    const char *text[] = {"", "Ocean Optics", s->serve.bench->ocean.model->name,
                          s->serve.bench->config.serial};
    if (index == 0) {
        memcpy(d, (const uint8_t[]){4, 3, 9, 4}, 4); /* English (United States) */
        return 4;
    }
    if (index > 3)
        return 0;
    size_t n = strlen(text[index]);
    d[0] = (uint8_t)(2 + 2 * n);
    d[1] = 3;
    for (size_t i = 0; i < n; i++) {
        d[2 + 2 * i] = (uint8_t)text[index][i];
        d[3 + 2 * i] = 0;
    }
    return d[0];
}

static size_t descriptor(const struct device *s, int value, uint8_t *d) {
    uint16_t pid = s->serve.bench->ocean.model->pid;
    const uint8_t device[18] = {
        18, 1, 0x00, 0x02, 0, 0, 0, 64, OCEAN_VID & 255, OCEAN_VID >> 8, (uint8_t)pid, (uint8_t)(pid >> 8),
        0,  1, 1,    2,    3, 1};
    switch (value >> 8) {
    case DESCRIPTOR_DEVICE:
        memcpy(d, device, sizeof device);
        return sizeof device;
    case DESCRIPTOR_CONFIGURATION:
        return configuration_descriptor(d);
    case DESCRIPTOR_STRING:
        return string_descriptor(s, value & 255, d);
    default:
        return 0;
    }
}

static void send_topology(struct device *s) {
    struct usb_redir_interface_info_header interface = {.interface_count = 1, .interface_class = {0xFF}};
    struct usb_redir_ep_info_header ep = {0};
    memset(ep.type, usb_redir_type_invalid, sizeof ep.type);
    ep.type[0] = ep.type[16] = usb_redir_type_control;
    ep.max_packet_size[0] = ep.max_packet_size[16] = 64;
    for (size_t i = 0; i < sizeof ENDPOINTS; i++) {
        int at = (ENDPOINTS[i] & 15) + (ENDPOINTS[i] & 0x80 ? 16 : 0);
        ep.type[at] = usb_redir_type_bulk;
        ep.max_packet_size[at] = (uint16_t)ocean_max_packet(ENDPOINTS[i]);
    }
    usbredirparser_send_interface_info(s->parser, &interface);
    usbredirparser_send_ep_info(s->parser, &ep);
}

static int64_t now_us(const struct device *s) {
    return clock_stamp(s->serve.bench->clock);
}

static void release(struct device *s, int i, uint8_t status) {
    struct held h = s->held[i];
    memmove(s->held + i, s->held + i + 1, sizeof h * (size_t)(--s->n_held - i));
    h.header.status = status;
    h.header.length = (uint16_t)h.actual;
    h.header.length_high = (uint16_t)(h.actual >> 16);
    usbredirparser_send_bulk_packet(s->parser, h.id, &h.header, h.actual ? h.data : NULL, (int)h.actual);
    free(h.data);
}

static bool first_on_endpoint(const struct device *s, int i) {
    for (int k = 0; k < i; k++)
        if (s->held[k].header.endpoint == s->held[i].header.endpoint)
            return false;
    return true;
}

static void pump(struct device *s) {
    struct ocean *o = &s->serve.bench->ocean;
    int64_t now = now_us(s);
    sim_bench_update(s->serve.bench, now);
    for (int i = 0; i < s->n_held;) {
        struct held *h = &s->held[i];
        int result = OCEAN_NAK;
        if (first_on_endpoint(s, i))
            result = ocean_in(o, now, h->header.endpoint, h->data, h->length, &h->actual);
        if (result == OCEAN_NAK)
            i++;
        else
            release(s, i,
                    result == OCEAN_BABBLE ? usb_redir_babble
                    : result               ? usb_redir_stall
                                           : usb_redir_success);
    }
    int64_t due_us = s->n_held ? ocean_due_us(o) : INT64_MAX;
    if (due_us == INT64_MAX)
        reactor_timer_off(s->due);
    else
        reactor_timer_in(s->due, due_us - now);
}

static void forget_held(struct device *s) {
    while (s->n_held > 0)
        free(s->held[--s->n_held].data);
}

static void detach(struct device *s) {
    forget_held(s);
    reactor_timer_off(s->due);
    reactor_watch_end(s->watch);
    s->watch = NULL;
    usbredirparser_destroy(s->parser);
    s->parser = NULL;
    close(s->fd);
    s->fd = -1;
    reactor_watch_change(s->waiting, REACTOR_READ);
}

/* false: the client has gone. */
static bool flush(struct device *s) {
    while (usbredirparser_has_data_to_write(s->parser)) {
        int before = usbredirparser_has_data_to_write(s->parser);
        if (usbredirparser_do_write(s->parser) < 0)
            return false;
        if (usbredirparser_has_data_to_write(s->parser) == before)
            break; /* the socket is full: the reactor calls again when it is not */
    }
    reactor_watch_change(s->watch, usbredirparser_has_data_to_write(s->parser) ? REACTOR_READ | REACTOR_WRITE
                                                                               : REACTOR_READ);
    return true;
}

static int read_socket(void *priv, uint8_t *data, int count) {
    struct device *s = priv;
    ssize_t n = recv(s->fd, data, (size_t)count, 0);
    if (n < 0 && (errno == EAGAIN || errno == EINTR))
        return 0;
    return n > 0 ? (int)n : -1;
}

static int write_socket(void *priv, uint8_t *data, int count) {
    struct device *s = priv;
    ssize_t n = send(s->fd, data, (size_t)count, MSG_NOSIGNAL);
    if (n < 0 && (errno == EAGAIN || errno == EINTR))
        return 0;
    return n < 0 ? -1 : (int)n;
}

static void log_line(void *priv, int level, const char *message) {
    (void)priv;
    if (level <= usbredirparser_error)
        fprintf(stderr, "goniosim: usbredir: %s\n", message);
}

static void on_hello(void *priv, struct usb_redir_hello_header *hello) {
    (void)hello;
    struct device *s = priv;
    struct usb_redir_device_connect_header connect = {.speed = usb_redir_speed_high,
                                                      .vendor_id = OCEAN_VID,
                                                      .product_id = s->serve.bench->ocean.model->pid,
                                                      .device_version_bcd = 0x0100};
    send_topology(s); /* must come before device_connect */
    usbredirparser_send_device_connect(s->parser, &connect);
}

static void on_reset(void *priv) {
    struct device *s = priv;
    forget_held(s);
    ocean_reset(&s->serve.bench->ocean);
}

static void on_set_configuration(void *priv, uint64_t id, struct usb_redir_set_configuration_header *h) {
    struct device *s = priv;
    struct usb_redir_configuration_status_header status = {usb_redir_success, h->configuration};
    s->configuration = h->configuration;
    send_topology(s);
    usbredirparser_send_configuration_status(s->parser, id, &status);
}

static void on_get_configuration(void *priv, uint64_t id) {
    struct device *s = priv;
    struct usb_redir_configuration_status_header status = {usb_redir_success, s->configuration};
    usbredirparser_send_configuration_status(s->parser, id, &status);
}

static void on_set_alt(void *priv, uint64_t id, struct usb_redir_set_alt_setting_header *h) {
    struct device *s = priv;
    struct usb_redir_alt_setting_status_header status = {h->alt ? usb_redir_stall : usb_redir_success,
                                                         h->interface, 0};
    send_topology(s);
    usbredirparser_send_alt_setting_status(s->parser, id, &status);
}

static void on_get_alt(void *priv, uint64_t id, struct usb_redir_get_alt_setting_header *h) {
    struct usb_redir_alt_setting_status_header status = {usb_redir_success, h->interface, 0};
    usbredirparser_send_alt_setting_status(((struct device *)priv)->parser, id, &status);
}

/* Length of the reply, 0 for one without data, -1 for a stall. */
static int control(struct device *s, const struct usb_redir_control_packet_header *h, uint8_t *out) {
    if (h->requesttype & 0x80 && h->request == GET_STATUS) {
        memset(out, 0, 2);
        return 2;
    }
    if (h->requesttype == 0x80 && h->request == GET_DESCRIPTOR) {
        size_t n = descriptor(s, h->value, out);
        return n ? (int)n : -1;
    }
    if (h->requesttype == 0x80 && h->request == GET_CONFIGURATION) {
        out[0] = s->configuration;
        return 1;
    }
    if (h->requesttype == 0x81 && h->request == GET_INTERFACE) {
        out[0] = 0;
        return 1;
    }
    return h->requesttype == 0x02 && h->request == CLEAR_FEATURE ? 0 : -1; /* a halted endpoint is freed */
}

static void on_control(void *priv, uint64_t id, struct usb_redir_control_packet_header *h, uint8_t *data,
                       int size) {
    (void)size;
    struct device *s = priv;
    uint8_t out[256];
    int n = control(s, h, out);
    if (n > h->length)
        n = h->length;
    struct usb_redir_control_packet_header reply = *h;
    reply.status = n < 0 ? usb_redir_stall : usb_redir_success;
    reply.length = n > 0 ? (uint16_t)n : 0;
    usbredirparser_send_control_packet(s->parser, id, &reply, n > 0 ? out : NULL, n > 0 ? n : 0);
    usbredirparser_free_packet_data(s->parser, data);
}

static void hold(struct device *s, uint64_t id, const struct usb_redir_bulk_packet_header *h) {
    size_t length = h->length | (size_t)h->length_high << 16;
    uint8_t *data = s->n_held < HELD && length <= LENGTH_MAX ? malloc(length + 1) : NULL;
    if (!data) {
        struct usb_redir_bulk_packet_header refused = *h;
        refused.status = usb_redir_ioerror;
        refused.length = refused.length_high = 0;
        usbredirparser_send_bulk_packet(s->parser, id, &refused, NULL, 0);
        return;
    }
    s->held[s->n_held++] = (struct held){.id = id, .header = *h, .data = data, .length = length};
}

static void on_bulk(void *priv, uint64_t id, struct usb_redir_bulk_packet_header *h, uint8_t *data,
                    int size) {
    struct device *s = priv;
    if (h->endpoint & 0x80) {
        hold(s, id, h);
    } else {
        struct usb_redir_bulk_packet_header reply = *h; /* says how much was taken, and carries no data */
        int taken = ocean_out(&s->serve.bench->ocean, now_us(s), h->endpoint, data, (size_t)size);
        reply.status = taken < 0 ? usb_redir_stall : usb_redir_success;
        if (taken < 0)
            reply.length = reply.length_high = 0;
        usbredirparser_send_bulk_packet(s->parser, id, &reply, NULL, 0);
    }
    usbredirparser_free_packet_data(s->parser, data);
    pump(s);
}

static void on_cancel(void *priv, uint64_t id) {
    struct device *s = priv;
    pump(s);
    for (int i = 0; i < s->n_held; i++)
        if (s->held[i].id == id) {
            release(s, i, usb_redir_cancelled);
            return;
        }
    /* completed already: its answer is on the way, and nothing more is said */
}

static void on_disconnect_ack(void *priv) {
    (void)priv;
}

static struct usbredirparser *make_parser(struct device *s) {
    static const int caps[] = {usb_redir_cap_connect_device_version, usb_redir_cap_device_disconnect_ack,
                               usb_redir_cap_ep_info_max_packet_size, usb_redir_cap_64bits_ids,
                               usb_redir_cap_32bits_bulk_length};
    uint32_t bits[USB_REDIR_CAPS_SIZE] = {0};
    struct usbredirparser *p = usbredirparser_create();
    if (!p)
        return NULL;
    for (size_t i = 0; i < sizeof caps / sizeof *caps; i++)
        usbredirparser_caps_set_cap(bits, caps[i]);
    p->priv = s;
    p->log_func = log_line;
    p->read_func = read_socket;
    p->write_func = write_socket;
    p->hello_func = on_hello;
    p->reset_func = on_reset;
    p->set_configuration_func = on_set_configuration;
    p->get_configuration_func = on_get_configuration;
    p->set_alt_setting_func = on_set_alt;
    p->get_alt_setting_func = on_get_alt;
    p->control_packet_func = on_control;
    p->bulk_packet_func = on_bulk;
    p->cancel_data_packet_func = on_cancel;
    p->device_disconnect_ack_func = on_disconnect_ack;
    usbredirparser_init(p, "goniosim " GONIOD_VERSION, bits, USB_REDIR_CAPS_SIZE, usbredirparser_fl_usb_host);
    return p;
}

static void on_client(void *arg, int events) {
    struct device *s = arg;
    if ((events & REACTOR_READ) && usbredirparser_do_read(s->parser) == usbredirparser_read_io_error) {
        detach(s);
        return;
    }
    pump(s);
    if (!flush(s))
        detach(s);
}

static void on_due(void *arg) {
    struct device *s = arg;
    if (s->fd < 0)
        return;
    pump(s);
    if (!flush(s))
        detach(s);
}

static void on_connection(void *arg, int events) {
    (void)events;
    struct device *s = arg;
    s->fd = serve_accept(s->listener);
    if (s->fd < 0)
        return;
    s->parser = make_parser(s);
    s->watch = s->parser ? reactor_watch(s->serve.reactor, s->fd, REACTOR_READ, on_client, s) : NULL;
    if (!s->watch) {
        close(s->fd);
        s->fd = -1;
        return;
    }
    s->configuration = 1;
    reactor_watch_change(s->waiting, 0); /* the next client waits in the backlog */
    if (!flush(s))                       /* the parser has queued its hello */
        detach(s);
}

static int listen_at(struct device *s, const char *where, char *endpoint, size_t size, struct err *e) {
    if (strncmp(where, "unix:", 5) == 0) {
        snprintf(endpoint, size, "usbredir:%s", where);
        return serve_listen_unix(where + 5, &s->listener, e);
    }
    int port = atoi(where + 4), rc = serve_listen_tcp(port, &s->listener, &port, e);
    snprintf(endpoint, size, "usbredir:tcp:127.0.0.1:%d", port);
    return rc;
}

int serve_usbredir(const struct serve *serve, const char *where, char *endpoint, size_t size, struct err *e) {
    struct device *s = calloc(1, sizeof *s);
    if (!s)
        return err_set(e, ERR_NOMEM, "no memory for a usbredir server");
    *s = (struct device){.serve = *serve, .listener = -1, .fd = -1};
    int rc = listen_at(s, where, endpoint, size, e);
    if (rc == 0) {
        s->due = reactor_timer(serve->reactor, on_due, s);
        s->waiting =
            s->due ? reactor_watch(serve->reactor, s->listener, REACTOR_READ, on_connection, s) : NULL;
        if (!s->waiting)
            rc = err_set(e, ERR_IO, "cannot watch the socket of the usbredir server");
    }
    if (rc) {
        reactor_timer_end(s->due);
        if (s->listener >= 0)
            close(s->listener);
        free(s);
    }
    return rc;
}
