#include "tests/support/fake_usb.h"

#include <assert.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>

static void note(struct fake_usb *f, const char *text) {
    size_t used = strlen(f->log);
    assert(used + strlen(text) + 2 < sizeof f->log);
    snprintf(f->log + used, sizeof f->log - used, "%s%s", used ? " " : "", text);
}

void fake_usb_send(struct fake_usb *f, uint8_t endpoint, const uint8_t *data, int n, int64_t at_us) {
    int size = usb_link_max_packet(&f->link, endpoint);
    for (int sent = 0; sent < n; sent += size) {
        assert(f->n_packets < FAKE_USB_PACKETS);
        struct fake_packet *p = &f->packet[f->n_packets++];
        *p = (struct fake_packet){
            .endpoint = endpoint, .n = n - sent < size ? n - sent : size, .at_us = at_us};
        memcpy(p->data, data + sent, p->n);
    }
}

static void send_parts(struct fake_usb *f, uint8_t *frame, int n, int64_t at_us) {
    int head = usb_link_max_packet(&f->link, 0x82) > 64 ? f->model->head_bytes : 0;
    if (f->fault == FAKE_SHORT)
        n -= 512;
    fake_usb_send(f, 0x86, frame, head, at_us);
    fake_usb_send(f, 0x82, frame + head, n - 1 - head, at_us);
    if (f->fault == FAKE_BABBLE)
        fake_usb_send(f, 0x82, frame, 512, at_us);
    fake_usb_send(f, 0x82, frame + f->model->pixels * 2, 1, at_us); /* the sync byte is a packet of its own */
}

void fake_usb_send_frame(struct fake_usb *f, int64_t at_us) {
    uint8_t frame[7681];
    int pixels = f->model->pixels;
    for (int p = 0; p < pixels; p++) {
        int active = p >= f->model->active_first && p <= f->model->active_last;
        int counts = f->fault == FAKE_ALL_EQUAL ? 2409 : active ? f->level : 1000 + p % 7;
        frame[2 * p] = counts & 0xff;
        frame[2 * p + 1] = counts >> 8;
    }
    frame[2 * pixels] = f->fault == FAKE_NO_SYNC ? 0x00 : 0x69;
    if (f->fault == FAKE_LEFTOVER)
        fake_usb_send(f, 0x82, (uint8_t[]){0x69}, 1, at_us);
    send_parts(f, frame, 2 * pixels + 1, at_us);
    f->frames++;
}

static void request(struct fake_usb *f) {
    int64_t now = clock_now_us(&f->clock);
    if (f->fault_count == 0)
        f->fault = FAKE_GOOD;
    else if (f->fault_count > 0)
        f->fault_count--;
    if (f->fault == FAKE_STALL)
        f->halted = 0x82;
    else if (f->fault == FAKE_UNPLUGGED)
        f->gone = true;
    else if (f->fault != FAKE_SILENT)
        fake_usb_send_frame(f, now + f->exposure_us + f->model->readout_us);
}

static void reply_status(struct fake_usb *f) {
    const uint8_t status[16] = {f->model->pixels & 0xff,
                                f->model->pixels >> 8,
                                f->exposure_us & 0xff,
                                f->exposure_us >> 8 & 0xff,
                                f->exposure_us >> 16 & 0xff,
                                f->exposure_us >> 24,
                                f->lamp,
                                f->trigger,
                                f->acquisition,
                                f->model->pixels / 256,
                                0,
                                f->loaded,
                                0,
                                0,
                                usb_link_max_packet(&f->link, 0x82) > 64 ? 0x80 : 0x00,
                                0x55};
    if (!f->ignores_status)
        fake_usb_send(f, 0x81, status, sizeof status, clock_now_us(&f->clock));
}

static void obey(struct fake_usb *f, const uint8_t *b, size_t n) {
    uint8_t reply[17] = {0x05, n > 1 ? b[1] : 0};
    switch (b[0]) {
    case 0x02:
        if (!f->ignores_exposure)
            f->exposure_us = b[1] | b[2] << 8 | b[3] << 16 | (uint32_t)b[4] << 24;
        break;
    case 0x03:
        f->lamp = b[1];
        break;
    case 0x05:
        memcpy(reply + 2, f->slot[b[1]], 15);
        fake_usb_send(f, 0x81, reply, 17, clock_now_us(&f->clock));
        break;
    case 0x09:
        request(f);
        break;
    case 0x0a:
        f->trigger = b[1];
        break;
    case 0x6c:
        fake_usb_send(f, 0x81, (uint8_t[]){0x08, 0x00, 0x19}, 3, clock_now_us(&f->clock)); /* 6400 counts */
        break;
    case 0xfe:
        reply_status(f);
        break;
    }
}

static void finish(struct fake_usb *f, int at, int status) {
    struct usb_transfer *t = f->pending[at];
    memmove(&f->pending[at], &f->pending[at + 1], (--f->n_pending - at) * sizeof f->pending[0]);
    t->status = status;
    t->completed_us = clock_now_us(&f->clock);
    t->pending = false;
}

static int submit(void *self, struct usb_transfer *t, struct err *e) {
    struct fake_usb *f = self;
    char text[80];
    int used = snprintf(text, sizeof text, "%02x%c", t->endpoint, t->endpoint & 0x80 ? '<' : '>');
    if (f->gone)
        return err_set(e, ERR_LINK, "unplugged");
    if (t->endpoint & 0x80)
        snprintf(text + used, sizeof text - used, "%zu", t->length);
    for (size_t i = 0; !(t->endpoint & 0x80) && i < t->length; i++)
        used += snprintf(text + used, sizeof text - used, "%02x", t->data[i]);
    note(f, text);
    assert(f->n_pending < FAKE_USB_PENDING);
    t->submitted_us = clock_now_us(&f->clock);
    t->pending = true;
    t->actual = 0;
    t->status = 0;
    f->pending[f->n_pending++] = t;
    if (!(t->endpoint & 0x80))
        obey(f, t->data, t->length);
    return 0;
}

static int next_packet(const struct fake_usb *f, uint8_t endpoint) {
    for (int i = 0; i < f->n_packets; i++)
        if (f->packet[i].endpoint == endpoint)
            return i;
    return -1;
}

static void drop_packet(struct fake_usb *f, int at) {
    memmove(&f->packet[at], &f->packet[at + 1], (--f->n_packets - at) * sizeof f->packet[0]);
}

/* What has arrived for one read; true if that ends it. */
static bool fill(struct fake_usb *f, struct usb_transfer *t, int *status) {
    int at;
    *status = f->gone ? -ENODEV : t->endpoint == f->halted ? -EPIPE : 0;
    if (*status)
        return true;
    while ((at = next_packet(f, t->endpoint)) >= 0 && f->packet[at].at_us <= clock_now_us(&f->clock)) {
        struct fake_packet *p = &f->packet[at];
        bool is_short = p->n < usb_link_max_packet(&f->link, t->endpoint);
        if (p->n > (int)(t->length - t->actual)) {
            *status = -EOVERFLOW;
            drop_packet(f, at);
            return true;
        }
        memcpy(t->data + t->actual, p->data, p->n);
        t->actual += p->n;
        drop_packet(f, at);
        if (is_short || t->actual == t->length)
            return true;
    }
    return false;
}

static void reap(void *self) {
    struct fake_usb *f = self;
    for (int i = 0; i < f->n_pending;) {
        struct usb_transfer *t = f->pending[i];
        int status = f->gone ? -ENODEV : 0;
        if (!(t->endpoint & 0x80))
            t->actual = t->length;
        if (!(t->endpoint & 0x80) || fill(f, t, &status))
            finish(f, i, status);
        else
            i++;
    }
}

static void cancel(void *self, struct usb_transfer *t) {
    struct fake_usb *f = self;
    for (int i = 0; i < f->n_pending; i++)
        if (f->pending[i] == t) {
            finish(f, i, -ECANCELED);
            return;
        }
}

static int clear_halt(void *self, uint8_t endpoint, struct err *e) {
    struct fake_usb *f = self;
    char text[16];
    (void)e;
    snprintf(text, sizeof text, "halt %02x", endpoint);
    note(f, text);
    f->halted = f->halted == endpoint ? 0 : f->halted;
    return 0;
}

static int reset(void *self, struct err *e) {
    struct fake_usb *f = self;
    (void)e;
    note(f, "reset");
    if (f->reset_mends)
        f->fault_count = 0;
    return 0;
}

static int64_t due_us(void *self) {
    struct fake_usb *f = self;
    int64_t due = CLOCK_NEVER, now = clock_now_us(&f->clock);
    for (int i = 0; i < f->n_pending; i++) {
        const struct usb_transfer *t = f->pending[i];
        int at = next_packet(f, t->endpoint);
        if (f->gone || !(t->endpoint & 0x80) || t->endpoint == f->halted)
            return now;
        if (at >= 0 && f->packet[at].at_us < due)
            due = f->packet[at].at_us;
    }
    return due;
}

static void close_fake(void *self) {
    (void)self;
}

static const struct usb_link_ops OPS = {
    .submit = submit,
    .reap = reap,
    .cancel = cancel,
    .clear_halt = clear_halt,
    .reset = reset,
    .due_us = due_us,
    .close = close_fake,
};

void fake_usb_slot(struct fake_usb *f, int slot, const char *text) {
    memset(f->slot[slot], 0xa5, 15);
    size_t n = strlen(text) + 1;
    memcpy(f->slot[slot], text, n < 15 ? n : 15);
}

void fake_usb_init(struct fake_usb *f, const char *model, bool high_speed) {
    static const char *const TEXT[15] = {"USB2+F01234", "340.3",     "0.3771",    "-1.5e-05", "-2.1e-09",
                                         "0.0",         "9.0e-1",    "3.5e-06",   "-8e-11",   "0",
                                         "0",           "0.000e+00", "0.000E+00", "0",        "7"};
    memset(f, 0, sizeof *f);
    clock_init_virtual(&f->clock);
    bench_init(&f->bench, &f->clock);
    f->model = spectrometer_model_find(model);
    f->exposure_us = 100000; /* a Flame-T after power-up */
    f->level = 20000;
    for (int i = 0; i < 15; i++)
        fake_usb_slot(f, i, TEXT[i]);
    if (f->model->pixels == 3840)
        fake_usb_slot(f, 2, "0.2100"); /* the same range over more pixels */
    memset(f->slot[17], 0, 15);
    f->slot[17][4] = 60000 & 0xff;
    f->slot[17][5] = 60000 >> 8;
    int bulk = high_speed ? 512 : 64;
    f->link = (struct usb_link){.ops = &OPS, .self = f, .info = {.vid = 0x2457, .pid = f->model->pid}};
    f->link.info.max_packet[1] = f->link.info.max_packet[17] = 64;
    f->link.info.max_packet[18] = f->link.info.max_packet[22] = bulk;
    usb_link_serve(&f->link, &f->bench, NULL);
}
