#include "tests/support/modbus_peer.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

static int64_t now_ms(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec * 1000LL + t.tv_nsec / 1000000;
}

static void append_crc(uint8_t *frame, int size) {
    uint16_t crc = 0xFFFF;
    for (int i = 0; i < size; i++) {
        crc ^= frame[i];
        for (int k = 0; k < 8; k++)
            crc = crc & 1 ? (crc >> 1) ^ 0xA001 : crc >> 1;
    }
    frame[size] = crc & 0xFF;
    frame[size + 1] = crc >> 8;
}

/* pdu: unit, function, data. Answers in place; returns the size of unit + function + data. */
static int answer(struct modbus_peer *p, uint8_t *pdu, int flags) {
    int addr = pdu[2] << 8 | pdu[3], count = pdu[4] << 8 | pdu[5];
    p->last_function = pdu[1];
    p->last_addr = addr;
    if (flags & PEER_OTHER_UNIT)
        pdu[0]++;
    if (flags & PEER_REFUSE) {
        pdu[1] |= 0x80;
        pdu[2] = 4;
        return 3;
    }
    if (pdu[1] == 6) {
        p->reg[addr] = (uint16_t)count;
        return 6;
    }
    if (pdu[1] == 16) {
        for (int i = 0; i < count; i++)
            p->reg[addr + i] = (uint16_t)(pdu[7 + 2 * i] << 8 | pdu[8 + 2 * i]);
        return 6;
    }
    pdu[2] = (uint8_t)(2 * count);
    for (int i = 0; i < count; i++) {
        pdu[3 + 2 * i] = p->reg[addr + i] >> 8;
        pdu[4 + 2 * i] = p->reg[addr + i] & 0xFF;
    }
    return 3 + 2 * count;
}

static void queue(struct modbus_peer *p, const uint8_t *bytes, int size, int delay_ms) {
    struct peer_reply *r = &p->pending[p->n_pending++];
    r->due_ms = now_ms() + delay_ms;
    r->size = size;
    memcpy(r->bytes, bytes, size);
}

static void respond(struct modbus_peer *p, const uint8_t *request, int size) {
    struct peer_act act = p->act[atomic_fetch_add(&p->requests, 1) % p->n_act];
    uint8_t frame[300];
    int head = p->tcp ? 6 : 0;
    memcpy(frame, request, size);
    int n = answer(p, frame + head, act.flags) + head;
    if (p->tcp) {
        frame[4] = (n - 6) >> 8;
        frame[5] = (n - 6) & 0xFF;
    } else {
        append_crc(frame, n);
        n += 2;
    }
    if (act.flags & PEER_BAD_CRC)
        frame[n - 1] ^= 0x55;
    if (act.flags & PEER_HANG_UP) {
        shutdown(p->fd, SHUT_RDWR);
        return;
    }
    for (int copies = act.flags & PEER_DROP ? 0 : act.flags & PEER_TWICE ? 2 : 1; copies > 0; copies--)
        queue(p, frame, n, act.delay_ms);
}

/* Bytes of one whole request at the head of the buffer, 0 = not yet there. */
static int request_size(const struct modbus_peer *p, const uint8_t *b, int n) {
    if (p->tcp)
        return n >= 6 && n >= 6 + (b[4] << 8 | b[5]) ? 6 + (b[4] << 8 | b[5]) : 0;
    int size = n < 7 ? 8 : b[1] == 16 ? 9 + b[6] : 8;
    return n >= size ? size : 0;
}

static int timeout_ms(const struct modbus_peer *p) {
    int64_t wait = 20, now = now_ms();
    for (int i = 0; i < p->n_pending; i++)
        if (p->pending[i].due_ms - now < wait)
            wait = p->pending[i].due_ms - now;
    return wait > 0 ? (int)wait : 0;
}

static void send_due(struct modbus_peer *p) {
    int kept = 0;
    for (int i = 0; i < p->n_pending; i++) {
        struct peer_reply *r = &p->pending[i];
        if (r->due_ms > now_ms())
            p->pending[kept++] = *r;
        else if (write(p->fd, r->bytes, r->size) != r->size)
            continue; /* the client has gone */
    }
    p->n_pending = kept;
}

static void accept_client(struct modbus_peer *p) {
    if (p->fd >= 0)
        close(p->fd);
    p->fd = accept(p->listen_fd, NULL, NULL);
    p->n_pending = 0;
}

static void *serve(void *arg) {
    struct modbus_peer *p = arg;
    uint8_t buffer[600];
    int n = 0;
    while (!atomic_load(&p->end)) {
        struct pollfd fd[2] = {{.fd = p->fd, .events = POLLIN}, {.fd = p->listen_fd, .events = POLLIN}};
        poll(fd, 2, timeout_ms(p));
        if (fd[1].revents) {
            accept_client(p);
            n = 0;
        } else if (fd[0].revents & POLLIN) {
            ssize_t got = read(p->fd, buffer + n, sizeof buffer - n);
            if (got <= 0 && p->tcp) {
                close(p->fd);
                p->fd = -1;
            }
            n += got > 0 ? (int)got : 0;
        } else if (fd[0].revents) {
            usleep(1000); /* a pty whose other side is closed */
        }
        for (int size; (size = request_size(p, buffer, n)) > 0;) {
            respond(p, buffer, size);
            memmove(buffer, buffer + size, n -= size);
        }
        send_due(p);
    }
    return NULL;
}

static void open_pty(struct modbus_peer *p) {
    p->fd = posix_openpt(O_RDWR | O_NOCTTY);
    grantpt(p->fd);
    unlockpt(p->fd);
    struct termios t;
    tcgetattr(p->fd, &t);
    cfmakeraw(&t);
    tcsetattr(p->fd, TCSANOW, &t);
    snprintf(p->target, sizeof p->target, "rtu:%s", ptsname(p->fd));
}

static void open_listener(struct modbus_peer *p) {
    struct sockaddr_in a = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof a;
    p->fd = -1;
    p->listen_fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    bind(p->listen_fd, (struct sockaddr *)&a, sizeof a);
    listen(p->listen_fd, 4);
    getsockname(p->listen_fd, (struct sockaddr *)&a, &size);
    snprintf(p->target, sizeof p->target, "tcp:127.0.0.1:%d", ntohs(a.sin_port));
}

void modbus_peer_start(struct modbus_peer *p, bool tcp, const struct peer_act *act, int n_act) {
    memset(p, 0, sizeof *p);
    p->tcp = tcp;
    p->act = act;
    p->n_act = n_act;
    p->listen_fd = -1;
    for (int i = 0; i < 65536; i++)
        p->reg[i] = (uint16_t)i;
    if (tcp)
        open_listener(p);
    else
        open_pty(p);
    pthread_create(&p->thread, NULL, serve, p);
}

void modbus_peer_stop(struct modbus_peer *p) {
    atomic_store(&p->end, true);
    pthread_join(p->thread, NULL);
    if (p->fd >= 0)
        close(p->fd);
    if (p->listen_fd >= 0)
        close(p->listen_fd);
}
