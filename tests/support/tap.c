#include "tests/support/tap.h"

#include <arpa/inet.h>
#include <poll.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "tests/support/program.h"

#define NOTES 65536
#define ADU_MAX 260
#define HEADER 6         /* transaction, protocol, length */
#define REG_COMMAND 0x7C /* stage-modbus.md 1.2 */
#define BIT_STOP 0x20    /* 1.5 */
#define LOOK_MS 20
#define AWAKE_US (10 * LOOK_MS * INT64_C(1000)) /* between two looks at most, else the machine stood still */

struct request {
    int64_t at_us;
    int unit, function, addr;
    uint32_t value; /* of the first register written, or of both where two were */
};

struct tap {
    pthread_t thread;
    pthread_mutex_t lock;
    atomic_bool over, patient;
    atomic_int mute; /* a unit, or TAP_... */
    int listener, port;
    int64_t now_us, looked_us; /* the tap's clock, and real_us when it was last read */
    int n;
    struct request note[NOTES];
};

struct stream {
    uint8_t data[4 * ADU_MAX];
    size_t n;
};

static int loopback(int port, bool listens) {
    struct sockaddr_in a = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    a.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    int rc = listens ? bind(fd, (struct sockaddr *)&a, sizeof a) || listen(fd, 4)
                     : connect(fd, (struct sockaddr *)&a, sizeof a);
    if (rc != 0) {
        close(fd);
        return -1;
    }
    return fd;
}

int64_t tap_now_us(struct tap *t) {
    pthread_mutex_lock(&t->lock);
    int64_t real = real_us(), passed = real - t->looked_us;
    t->now_us += t->patient && passed > AWAKE_US ? AWAKE_US : passed;
    t->looked_us = real;
    int64_t now_us = t->now_us;
    pthread_mutex_unlock(&t->lock);
    return now_us;
}

static void note(struct tap *t, const uint8_t *adu, size_t size) {
    struct request r = {.at_us = tap_now_us(t), .unit = adu[6], .function = adu[7]};
    r.addr = adu[8] << 8 | adu[9];
    if (r.function == 6 && size >= 12)
        r.value = (uint32_t)(adu[10] << 8 | adu[11]);
    if (r.function == 16 && size >= 15)
        r.value = (uint32_t)(adu[13] << 8 | adu[14]);
    if (r.function == 16 && size >= 17)
        r.value = r.value << 16 | (uint32_t)(adu[15] << 8 | adu[16]);
    pthread_mutex_lock(&t->lock);
    t->note[t->n++ % NOTES] = r;
    pthread_mutex_unlock(&t->lock);
}

/* Passes on whole frames; false: that side has hung up. */
static bool relay(struct tap *t, struct stream *s, int from, int to, bool requests) {
    ssize_t got = recv(from, s->data + s->n, sizeof s->data - s->n, 0);
    if (got <= 0)
        return false;
    s->n += (size_t)got;
    while (s->n >= HEADER) {
        size_t size = HEADER + (size_t)(s->data[4] << 8 | s->data[5]);
        if (size > ADU_MAX || s->n < size)
            break;
        if (requests)
            note(t, s->data, size);
        int mute = atomic_load(&t->mute);
        if (requests || (mute != TAP_EVERYBODY && mute != s->data[6]))
            if (send(to, s->data, size, MSG_NOSIGNAL) != (ssize_t)size)
                return false;
        s->n -= size;
        memmove(s->data, s->data + size, s->n);
    }
    return true;
}

static void serve(struct tap *t, int client) {
    int server = loopback(t->port, false);
    struct stream out = {.n = 0}, in = {.n = 0};
    while (server >= 0 && !atomic_load(&t->over)) {
        struct pollfd fd[] = {{.fd = client, .events = POLLIN}, {.fd = server, .events = POLLIN}};
        poll(fd, 2, LOOK_MS);
        tap_now_us(t);
        if (fd[0].revents && !relay(t, &out, client, server, true))
            break;
        if (fd[1].revents && !relay(t, &in, server, client, false))
            break;
    }
    if (server >= 0)
        close(server);
    close(client);
}

static void *tap_thread(void *arg) {
    struct tap *t = arg;
    while (!atomic_load(&t->over)) {
        struct pollfd fd = {.fd = t->listener, .events = POLLIN};
        tap_now_us(t);
        if (poll(&fd, 1, LOOK_MS) == 1)
            serve(t, accept(t->listener, NULL, NULL));
    }
    return NULL;
}

struct tap *tap_open(const char *target, char link[96]) {
    struct tap *t = calloc(1, sizeof *t);
    struct sockaddr_in a;
    socklen_t size = sizeof a;
    t->port = (int)strtol(strrchr(target, ':') + 1, NULL, 10);
    t->listener = loopback(0, true);
    t->looked_us = real_us();
    pthread_mutex_init(&t->lock, NULL);
    getsockname(t->listener, (struct sockaddr *)&a, &size);
    snprintf(link, 96, "tcp:127.0.0.1:%d", ntohs(a.sin_port));
    pthread_create(&t->thread, NULL, tap_thread, t);
    return t;
}

void tap_patient(struct tap *t) {
    atomic_store(&t->patient, true);
}

void tap_close(struct tap *t) {
    if (!t)
        return;
    atomic_store(&t->over, true);
    pthread_join(t->thread, NULL);
    close(t->listener);
    pthread_mutex_destroy(&t->lock);
    free(t);
}

void tap_mute(struct tap *t, int unit) {
    atomic_store(&t->mute, unit);
}

int64_t tap_stop_us(struct tap *t, int unit, int64_t since_us) {
    int64_t at_us = -1;
    pthread_mutex_lock(&t->lock);
    for (int i = 0; i < t->n && i < NOTES && at_us < 0; i++) {
        const struct request *r = &t->note[i];
        bool writes = r->function == 6 || r->function == 16;
        if (writes && r->unit == unit && r->at_us >= since_us && (r->addr | 1) == (REG_COMMAND | 1) &&
            r->value & BIT_STOP)
            at_us = r->at_us;
    }
    pthread_mutex_unlock(&t->lock);
    return at_us;
}

int64_t tap_silence_us(struct tap *t, int64_t from_us, int64_t to_us) {
    int64_t last_us = from_us, longest_us = 0;
    pthread_mutex_lock(&t->lock);
    for (int i = 0; i < t->n && i < NOTES && t->note[i].at_us < to_us; i++) {
        if (t->note[i].at_us < from_us)
            continue;
        if (t->note[i].at_us - last_us > longest_us)
            longest_us = t->note[i].at_us - last_us;
        last_us = t->note[i].at_us;
    }
    pthread_mutex_unlock(&t->lock);
    return to_us - last_us > longest_us ? to_us - last_us : longest_us;
}
