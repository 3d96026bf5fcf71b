#include "tests/support/redir_host.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
#include <usbredirparser.h>

#define HELD 16

struct held {
    bool used;
    uint64_t id;
    struct usb_redir_bulk_packet_header header;
};

struct redir_host {
    pthread_t thread;
    int listener, fd;
    uint16_t vid, pid;
    enum redir_host_manner manner;
    char target[160];
    atomic_bool stop;
    atomic_int cleared, resets;
    struct usbredirparser *parser;
    bool hang_up, deaf, stall, babble;
    struct held held[HELD];
    int owed_82, owed_81;
};

static int read_socket(void *priv, uint8_t *data, int count) {
    struct redir_host *h = priv;
    ssize_t n = recv(h->fd, data, count, MSG_DONTWAIT);
    if (n < 0)
        return errno == EAGAIN ? 0 : -1;
    return n == 0 ? -1 : (int)n;
}

static int write_socket(void *priv, uint8_t *data, int count) {
    struct redir_host *h = priv;
    ssize_t n = send(h->fd, data, count, MSG_NOSIGNAL);
    return n < 0 ? -1 : (int)n;
}

static void quiet(void *priv, int level, const char *message) {
    (void)priv;
    (void)level;
    (void)message;
}

static void send_topology(struct redir_host *h) {
    struct usb_redir_interface_info_header interface = {.interface_count = 1, .interface_class = {0xff}};
    struct usb_redir_ep_info_header endpoints = {0};
    memset(endpoints.type, usb_redir_type_invalid, sizeof endpoints.type);
    endpoints.type[0] = endpoints.type[16] = usb_redir_type_control;
    static const int BULK[] = {1, 16 + 1, 16 + 2, 16 + 6};
    for (int i = 0; i < 4; i++) {
        endpoints.type[BULK[i]] = usb_redir_type_bulk;
        endpoints.max_packet_size[BULK[i]] = BULK[i] < 18 ? 64 : 512;
    }
    usbredirparser_send_interface_info(h->parser, &interface);
    usbredirparser_send_ep_info(h->parser, &endpoints);
}

static void on_hello(void *priv, struct usb_redir_hello_header *hello) {
    struct redir_host *h = priv;
    (void)hello;
    if (h->manner == REDIR_HOST_HANGS_UP)
        h->hang_up = true;
    if (h->manner != REDIR_HOST_PROPER)
        return;
    struct usb_redir_device_connect_header device = {
        .speed = usb_redir_speed_high, .device_class = 0xff, .vendor_id = h->vid, .product_id = h->pid};
    send_topology(h);
    usbredirparser_send_device_connect(h->parser, &device);
}

static void answer(struct redir_host *h, struct held *r, int status, const uint8_t *data, int n) {
    r->header.status = status;
    r->header.length = n & 0xffff;
    r->header.length_high = n >> 16;
    r->used = false;
    usbredirparser_send_bulk_packet(h->parser, r->id, &r->header, n ? (uint8_t *)data : NULL, n);
}

static void answer_82(struct redir_host *h, struct held *r) {
    static uint8_t data[20000];
    int want = r->header.length | r->header.length_high << 16;
    for (int i = 0; i < (int)sizeof data; i++)
        data[i] = i % 251;
    if (h->stall) {
        h->stall = false;
        answer(h, r, usb_redir_stall, NULL, 0);
    } else if (h->babble) {
        h->babble = false;
        answer(h, r, usb_redir_babble, data, want);
    } else if (h->owed_82) {
        int n = h->owed_82 < want ? h->owed_82 : want;
        h->owed_82 = 0;
        answer(h, r, usb_redir_success, data, n);
    }
}

static void pump(struct redir_host *h) {
    for (int i = 0; i < HELD; i++) {
        struct held *r = &h->held[i];
        if (r->used && r->header.endpoint == 0x82)
            answer_82(h, r);
        else if (r->used && r->header.endpoint == 0x81 && h->owed_81) {
            h->owed_81 = 0;
            answer(h, r, usb_redir_success, (const uint8_t *)"ok!", 3);
        }
    }
}

static void obey(struct redir_host *h, const uint8_t *order, int n) {
    switch (n ? order[0] : 0) {
    case 'D':
        h->owed_82 = order[1] | order[2] << 8;
        break;
    case 'R':
        h->owed_81 = 1;
        break;
    case 'S':
        h->stall = true;
        break;
    case 'B':
        h->babble = true;
        break;
    case 'K':
        h->hang_up = true;
        break;
    case 'H':
        h->deaf = true;
        break;
    case 'X':
        usbredirparser_send_device_disconnect(h->parser);
        break;
    }
}

static void on_bulk_packet(void *priv, uint64_t id, struct usb_redir_bulk_packet_header *header,
                           uint8_t *data, int n) {
    struct redir_host *h = priv;
    struct held taken = {true, id, *header};
    if (header->endpoint & 0x80) {
        for (int i = 0; i < HELD; i++)
            if (!h->held[i].used) {
                h->held[i] = taken;
                break;
            }
    } else {
        obey(h, data, n);
        if (!h->deaf) {
            taken.header.status = usb_redir_success; /* its length says what was taken; no data */
            usbredirparser_send_bulk_packet(h->parser, id, &taken.header, NULL, 0);
        }
    }
    usbredirparser_free_packet_data(h->parser, data);
}

static void on_control_packet(void *priv, uint64_t id, struct usb_redir_control_packet_header *header,
                              uint8_t *data, int n) {
    struct redir_host *h = priv;
    struct usb_redir_control_packet_header reply = *header;
    (void)n;
    if (header->request == 1 && header->requesttype == 2)
        atomic_fetch_add(&h->cleared, 1);
    reply.status = usb_redir_success;
    usbredirparser_send_control_packet(h->parser, id, &reply, NULL, 0);
    usbredirparser_free_packet_data(h->parser, data);
}

static void on_cancel(void *priv, uint64_t id) {
    struct redir_host *h = priv;
    for (int i = 0; i < HELD; i++)
        if (h->held[i].used && h->held[i].id == id)
            answer(h, &h->held[i], usb_redir_cancelled, NULL, 0);
}

static void on_reset(void *priv) {
    struct redir_host *h = priv;
    atomic_fetch_add(&h->resets, 1);
}

static void on_disconnect_ack(void *priv) {
    (void)priv;
}

static void parser_start(struct redir_host *h) {
    static const int CAPS[] = {usb_redir_cap_connect_device_version, usb_redir_cap_device_disconnect_ack,
                               usb_redir_cap_ep_info_max_packet_size, usb_redir_cap_64bits_ids,
                               usb_redir_cap_32bits_bulk_length};
    uint32_t caps[USB_REDIR_CAPS_SIZE] = {0};
    for (size_t i = 0; i < sizeof CAPS / sizeof CAPS[0]; i++)
        usbredirparser_caps_set_cap(caps, CAPS[i]);
    struct usbredirparser *p = h->parser = usbredirparser_create();
    p->priv = h;
    p->log_func = quiet;
    p->read_func = read_socket;
    p->write_func = write_socket;
    p->hello_func = on_hello;
    p->bulk_packet_func = on_bulk_packet;
    p->control_packet_func = on_control_packet;
    p->cancel_data_packet_func = on_cancel;
    p->reset_func = on_reset;
    p->device_disconnect_ack_func = on_disconnect_ack;
    usbredirparser_init(p, "redir_host", caps, USB_REDIR_CAPS_SIZE, usbredirparser_fl_usb_host);
}

static void serve(struct redir_host *h) {
    parser_start(h);
    while (!atomic_load(&h->stop) && !h->hang_up) {
        struct pollfd fd = {.fd = h->fd, .events = h->deaf ? 0 : POLLIN};
        if (h->manner != REDIR_HOST_SILENT && usbredirparser_has_data_to_write(h->parser) &&
            usbredirparser_do_write(h->parser) < 0)
            break;
        if (poll(&fd, 1, 10) > 0 && usbredirparser_do_read(h->parser) == usbredirparser_read_io_error)
            break;
        pump(h);
    }
    usbredirparser_destroy(h->parser);
    close(h->fd);
}

static void *run(void *arg) {
    struct redir_host *h = arg;
    while (!atomic_load(&h->stop)) {
        struct pollfd fd = {.fd = h->listener, .events = POLLIN};
        if (poll(&fd, 1, 10) <= 0)
            continue;
        h->fd = accept(h->listener, NULL, NULL);
        int one = 1;
        setsockopt(h->fd, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
        if (h->fd >= 0)
            serve(h);
        h->hang_up = h->deaf = false;
    }
    return NULL;
}

static bool listen_unix(struct redir_host *h, const char *path) {
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    snprintf(a.sun_path, sizeof a.sun_path, "%s", path);
    unlink(path);
    snprintf(h->target, sizeof h->target, "usbredir:unix:%s", path);
    h->listener = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    return bind(h->listener, (struct sockaddr *)&a, sizeof a) == 0 && listen(h->listener, 1) == 0;
}

static bool listen_tcp(struct redir_host *h) {
    struct sockaddr_in a = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof a;
    h->listener = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    bool ok = bind(h->listener, (struct sockaddr *)&a, sizeof a) == 0 && listen(h->listener, 1) == 0 &&
              getsockname(h->listener, (struct sockaddr *)&a, &size) == 0;
    snprintf(h->target, sizeof h->target, "usbredir:tcp:127.0.0.1:%d", ntohs(a.sin_port));
    return ok;
}

struct redir_host *redir_host_start(const char *where, uint16_t vid, uint16_t pid,
                                    enum redir_host_manner manner) {
    struct redir_host *h = calloc(1, sizeof *h);
    *h = (struct redir_host){.fd = -1, .vid = vid, .pid = pid, .manner = manner};
    bool ok = strncmp(where, "unix:", 5) == 0 ? listen_unix(h, where + 5) : listen_tcp(h);
    if (!ok || pthread_create(&h->thread, NULL, run, h) != 0) {
        close(h->listener);
        free(h);
        return NULL;
    }
    return h;
}

const char *redir_host_target(const struct redir_host *host) {
    return host->target;
}

int redir_host_cleared(const struct redir_host *host) {
    return atomic_load(&host->cleared);
}

int redir_host_resets(const struct redir_host *host) {
    return atomic_load(&host->resets);
}

void redir_host_stop(struct redir_host *host) {
    atomic_store(&host->stop, true);
    pthread_join(host->thread, NULL);
    close(host->listener);
    if (strncmp(host->target, "usbredir:unix:", 14) == 0)
        unlink(host->target + 14);
    free(host);
}
