#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "sim/sim_bench.h"

#define TRANSFERS 16

struct sim_usb {
    struct sim_bench *bench;
    struct usb_transfer *pending[TRANSFERS]; /* IN, in the order of submission */
    int n;
};

static void complete(struct sim_usb *s, int i, int status) {
    struct usb_transfer *t = s->pending[i];
    t->status = status;
    t->completed_us = clock_now_us(s->bench->clock);
    t->pending = false;
    memmove(s->pending + i, s->pending + i + 1, sizeof s->pending[0] * (size_t)(--s->n - i));
}

static bool first_on_endpoint(const struct sim_usb *s, int i) {
    for (int k = 0; k < i; k++)
        if (s->pending[k]->endpoint == s->pending[i]->endpoint)
            return false;
    return true;
}

static int status_of(int result) {
    return result == OCEAN_BABBLE ? -EOVERFLOW : result == OCEAN_STALL ? -EPIPE : 0;
}

static void reap(void *self) {
    struct sim_usb *s = self;
    int64_t now_us = clock_stamp(s->bench->clock);
    sim_bench_update(s->bench, now_us);
    ocean_advance(&s->bench->ocean, now_us);
    for (int i = 0; i < s->n;) {
        struct usb_transfer *t = s->pending[i];
        int result = OCEAN_NAK;
        if (first_on_endpoint(s, i))
            result = ocean_in(&s->bench->ocean, now_us, t->endpoint, t->data, t->length, &t->actual);
        if (result == OCEAN_NAK)
            i++;
        else
            complete(s, i, status_of(result));
    }
}

static int submit(void *self, struct usb_transfer *t, struct err *e) {
    struct sim_usb *s = self;
    int64_t now_us = clock_stamp(s->bench->clock);
    if (s->n == TRANSFERS)
        return err_set(e, ERR_BUSY, "the simulated device takes at most %d transfers at a time", TRANSFERS);
    t->actual = 0;
    t->status = 0;
    t->submitted_us = now_us;
    t->pending = true;
    s->pending[s->n++] = t;
    if (!(t->endpoint & 0x80)) {
        sim_bench_update(s->bench, now_us);
        int taken = ocean_out(&s->bench->ocean, now_us, t->endpoint, t->data, t->length);
        t->actual = taken < 0 ? 0 : (size_t)taken;
        complete(s, s->n - 1, taken < 0 ? -EPIPE : 0);
    }
    reap(s);
    return 0;
}

static void cancel(void *self, struct usb_transfer *t) {
    struct sim_usb *s = self;
    reap(s);
    for (int i = 0; i < s->n; i++)
        if (s->pending[i] == t) {
            complete(s, i, -ECANCELED);
            return;
        }
}

static int clear_halt(void *self, uint8_t endpoint, struct err *e) {
    (void)self; /* toggles are no matter in process */
    return ocean_max_packet(endpoint) ? 0 : err_set(e, ERR_RANGE, "there is no endpoint 0x%02X", endpoint);
}

static int reset(void *self, struct err *e) {
    (void)e;
    struct sim_usb *s = self;
    while (s->n > 0)
        complete(s, 0, -ECANCELED);
    ocean_reset(&s->bench->ocean);
    return 0;
}

static int64_t due_us(void *self) {
    struct sim_usb *s = self;
    for (int i = 0; i < s->n; i++)
        if (s->pending[i]->endpoint != 0x81)
            return ocean_due_us(&s->bench->ocean);
    return CLOCK_NEVER;
}

static int descriptors(void *self, struct pollfd *fd, int max) {
    (void)self;
    (void)fd;
    (void)max;
    return 0;
}

static void close_link(void *self) {
    struct sim_usb *s = self;
    while (s->n > 0)
        complete(s, 0, -ECANCELED);
    free(s);
}

static const struct usb_link_ops OPS = {
    .submit = submit,
    .reap = reap,
    .cancel = cancel,
    .clear_halt = clear_halt,
    .reset = reset,
    .due_us = due_us,
    .descriptors = descriptors,
    .close = close_link,
};

int sim_usb_link(struct sim_bench *bench, struct usb_link *link, struct err *e) {
    struct sim_usb *s = calloc(1, sizeof *s);
    if (!s)
        return err_set(e, ERR_NOMEM, "no memory for the simulated spectrometer");
    s->bench = bench;
    *link = (struct usb_link){.ops = &OPS, .self = s};
    link->info =
        (struct usb_device_info){.vid = OCEAN_VID, .pid = bench->ocean.model->pid, .path = "sim:usb"};
    strncpy(link->info.serial, bench->config.serial, sizeof link->info.serial - 1);
    for (int n = 1; n < 16; n++) {
        link->info.max_packet[n] = ocean_max_packet((uint8_t)n);
        link->info.max_packet[16 + n] = ocean_max_packet((uint8_t)(0x80 | n));
    }
    return 0;
}
