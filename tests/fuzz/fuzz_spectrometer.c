/* A spectrometer that answers whatever the input says: opening, settings and a set of frames must end in time,
 * with an error or with frames that keep their promises. A record of the input is used up by each read:
 *     kind, length (2 bytes), bytes         kind 0 these bytes; 1 nothing; 2 stall; 3 babble; 4 unplugged;
 *                                           others: what a proper unit would send                         */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/spectrometer.h"
#include "proto/units.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

struct unit {
    const uint8_t *data;
    size_t size;
    struct clock clock;
    const struct spectrometer_model *model;
    struct usb_transfer *held[8];
    uint8_t last[32];
    uint32_t exposure_us;
    uint8_t lamp;
    bool gone;
};

static void finish(struct unit *u, struct usb_transfer *t, int status, const uint8_t *bytes, size_t n) {
    t->actual = n < t->length ? n : t->length;
    if (t->actual)
        memcpy(t->data, bytes, t->actual);
    t->status = status;
    t->completed_us = u->clock.now_us;
    t->pending = false;
}

static size_t proper_reply(const struct unit *u, uint8_t *b) {
    static const char *const SLOT[] = {"SN", "340", "0.2", "-1e-6", "0"};
    uint32_t t = u->exposure_us;
    memset(b, 0, 32);
    if (u->last[0] == 0x05) {
        b[0] = 0x05;
        b[1] = u->last[1];
        if (b[1] < 5)
            strcpy((char *)b + 2, SLOT[b[1]]);
        return 17;
    }
    const uint8_t status[] = {
        u->model->pixels & 255, u->model->pixels >> 8, t, t >> 8, t >> 16, t >> 24, u->lamp};
    memcpy(b, status, sizeof status);
    return u->last[0] == 0xfe ? 16 : 3;
}

static size_t proper_frame(const struct unit *u, uint8_t endpoint, uint8_t *b) {
    size_t total = 2 * (size_t)u->model->pixels + 1, head = (size_t)u->model->head_bytes;
    size_t n = endpoint == 0x86 ? head : total - head;
    for (size_t i = 0; i < n; i++)
        b[i] = (uint8_t)(i * 7);
    if (endpoint == 0x82)
        b[total - head - 1] = 0x69;
    return n;
}

static void answer(struct unit *u, struct usb_transfer *t) {
    static const int STATUS[] = {0, 0, -EPIPE, -EOVERFLOW, -ENODEV};
    uint8_t proper[8192];
    uint8_t kind = u->size >= 3 ? u->data[0] : 1;
    size_t n = u->size >= 3 ? u->data[1] | (size_t)u->data[2] << 8 : 0;
    u->data += u->size >= 3 ? 3 : 0;
    u->size -= u->size >= 3 ? 3 : 0;
    if (kind == 1)
        return;
    if (kind > 4) {
        n = t->endpoint == 0x81 ? proper_reply(u, proper) : proper_frame(u, t->endpoint, proper);
        finish(u, t, 0, proper, n);
        return;
    }
    n = n < u->size ? n : u->size;
    u->gone = u->gone || kind == 4;
    finish(u, t, STATUS[kind], u->data, n);
    u->data += n;
    u->size -= n;
}

static int submit(void *self, struct usb_transfer *t, struct err *e) {
    struct unit *u = self;
    if (u->gone)
        return err_set(e, ERR_LINK, "unplugged");
    t->actual = 0;
    t->status = 0;
    if (t->endpoint & 0x80) {
        for (int i = 0; i < 8; i++)
            if (!u->held[i] || u->held[i] == t || !u->held[i]->pending) {
                u->held[i] = t;
                t->pending = true;
                return 0;
            }
        abort(); /* more reads than the driver has */
    }
    memcpy(u->last, t->data, t->length < sizeof u->last ? t->length : sizeof u->last);
    if (u->last[0] == 0x02)
        u->exposure_us = u->last[1] | u->last[2] << 8 | u->last[3] << 16 | (uint32_t)u->last[4] << 24;
    if (u->last[0] == 0x03)
        u->lamp = u->last[1];
    finish(u, t, 0, NULL, 0);
    for (int i = 0; i < 8; i++)
        if (u->held[i] && u->held[i]->pending)
            answer(u, u->held[i]);
    return 0;
}

static void reap(void *self) {
    (void)self;
}

static void cancel(void *self, struct usb_transfer *t) {
    finish(self, t, -ECANCELED, NULL, 0);
}

static int clear_halt(void *self, uint8_t endpoint, struct err *e) {
    (void)self;
    (void)endpoint;
    (void)e;
    return 0;
}

static int reset(void *self, struct err *e) {
    (void)self;
    (void)e;
    return 0;
}

static int64_t due_us(void *self) {
    (void)self;
    return CLOCK_NEVER;
}

static const struct usb_link_ops OPS = {.submit = submit,
                                        .reap = reap,
                                        .cancel = cancel,
                                        .clear_halt = clear_halt,
                                        .reset = reset,
                                        .due_us = due_us};

static void check(const struct spectrometer *s, const struct frame *f, int64_t since_us, int64_t now_us) {
    const struct calibration *c = spectrometer_calibration(s);
    if (f->start_us < since_us || f->end_us > now_us || f->exposure_us != 50000 || f->pixels != c->pixels)
        abort();
}

static void use(struct spectrometer *s, struct unit *u) {
    static struct frame frames[2];
    struct err e = {0};
    int rc = spectrometer_set_exposure(s, 50000, NULL, &e);
    int64_t since_us = u->clock.now_us;
    if (rc == 0)
        rc = spectrometer_acquire(s, 2, since_us, frames, NULL, &e);
    if (rc != 0 && e.code == ERR_NONE)
        abort();
    for (int i = 0; rc == 0 && i < 2; i++)
        check(s, &frames[i], since_us, u->clock.now_us);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct bench bench;
    struct spectrometer *s = NULL;
    struct err e = {0};
    if (size == 0)
        return 0;
    struct unit u = {.data = data + 1, .size = size - 1};
    u.model = spectrometer_model_find(data[0] & 1 ? "usb4000" : "usb2000plus");
    struct usb_link link = {.ops = &OPS, .self = &u};
    link.info.max_packet[1] = link.info.max_packet[17] = 64;
    link.info.max_packet[18] = link.info.max_packet[22] = 512;
    clock_init_virtual(&u.clock);
    bench_init(&bench, &u.clock);
    usb_link_serve(&link, &bench, NULL);
    int rc = spectrometer_open(&s, u.model, &link, &bench, NULL, &e);
    if (rc == 0)
        use(s, &u);
    else if (e.code == ERR_NONE || s)
        abort();
    spectrometer_close(s);
    if (u.clock.now_us > 3600 * US_PER_S) /* 65 s integrations in every rung, and no more */
        abort();
    return 0;
}
