#include "drivers/usb_link.h"

#include <errno.h>
#include <string.h>

#include "proto/units.h"

#define REDIR_PREFIX "usbredir:"

int usb_link_open(struct usb_link *link, const char *target, uint16_t vid, uint16_t pid, const char *serial,
                  struct clock *clock, struct err *e) {
    memset(link, 0, sizeof *link);
    if (strcmp(target, "usb") == 0)
        return usb_link_open_libusb(link, vid, pid, serial, clock, e);
    if (strncmp(target, REDIR_PREFIX, strlen(REDIR_PREFIX)) == 0)
        return usb_link_open_redir(link, target + strlen(REDIR_PREFIX), vid, pid, clock, e);
    return err_set(e, ERR_INPUT,
                   "the spectrometer's link is '%s', expected usb, usbredir:unix:PATH or "
                   "usbredir:tcp:HOST:PORT",
                   target);
}

static int64_t serve_due(void *self) {
    struct usb_link *link = self;
    return link->ops->due_us(link->self);
}

static void serve_run(void *self) {
    struct usb_link *link = self;
    link->ops->reap(link->self);
}

static int serve_descriptors(void *self, struct pollfd *fd, int max) {
    struct usb_link *link = self;
    return link->ops->descriptors(link->self, fd, max);
}

int usb_link_serve(struct usb_link *link, struct bench *bench, struct err *e) {
    const struct bench_service service = {
        .name = "usb",
        .self = link,
        .due_us = serve_due,
        .run = serve_run,
        .descriptors = link->ops->descriptors ? serve_descriptors : NULL,
    };
    if (bench_add(bench, &service) != 0)
        return err_set(e, ERR_RANGE, "the bench serves %d devices already, no place is left for USB",
                       BENCH_SERVICES);
    return 0;
}

void usb_link_close(struct usb_link *link, struct bench *bench) {
    if (!link->ops)
        return;
    if (bench)
        bench_remove(bench, link);
    link->ops->close(link->self);
    memset(link, 0, sizeof *link);
}

struct transfers {
    struct usb_transfer *const *t;
    int n;
};

static bool all_home(void *arg) {
    const struct transfers *all = arg;
    for (int i = 0; i < all->n; i++)
        if (all->t[i]->pending)
            return false;
    return true;
}

void usb_link_recall(struct usb_link *link, struct bench *bench, struct usb_transfer *const *t, int n) {
    struct transfers all = {t, n};
    for (int i = 0; i < n; i++)
        if (t[i]->pending)
            link->ops->cancel(link->self, t[i]);
    bench_wait(bench, clock_stamp(bench->clock) + USB_LINK_CANCEL_MS * US_PER_MS, all_home, &all, NULL);
}

int usb_link_transfer(struct usb_link *link, struct bench *bench, struct usb_transfer *t, int64_t until_us,
                      const struct cancel *cancel, struct err *e) {
    int rc = link->ops->submit(link->self, t, e);
    if (rc)
        return rc;
    struct transfers one = {&t, 1};
    rc = bench_wait(bench, until_us, all_home, &one, cancel);
    if (t->pending)
        usb_link_recall(link, bench, one.t, 1);
    if (rc < 0)
        return err_set(e, rc == -ERR_CANCELLED ? ERR_CANCELLED : ERR_STATE,
                       "the wait for USB endpoint %02x was ended", t->endpoint);
    if (rc == BENCH_UNTIL && t->status == -ECANCELED)
        return err_set(e, ERR_TIMEOUT, "USB endpoint %02x did not answer in time", t->endpoint);
    return 0;
}
