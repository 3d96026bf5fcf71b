/*
 * usb_link.h — bulk transfers to one USB device: submit, reap, cancel; never a blocking read.
 *
 * Ways in: libusb (the kernel), usbredir over a unix socket or TCP (a remote spectrometer, or goniosim),
 * simulated in process. All three behave as virtual-usb.md measures them. The link is a service of bench_wait
 * through due_us, descriptors and reap; the driver waits in bench_wait for transfer->pending to fall.
 *
 * A transfer belongs to the link from submit until pending is false; the caller owns the memory and keeps it
 * alive. status: 0, -ENODEV, -ETIMEDOUT, -EPIPE (stall), -EOVERFLOW (babble: the device sent more than
 * length), -EIO, -ECANCELED. actual is valid for every status: a cancelled or timed-out read may have
 * delivered bytes. An IN transfer ends at a short packet or when length is full. Deadlines are the caller's:
 * bench_wait, then cancel, then wait (at most USB_LINK_CANCEL_MS) for pending to fall; a link must complete a
 * cancelled transfer even when the device never answers. Once the device is gone every pending transfer
 * completes with -ENODEV and submit returns -ERR_LINK; the link stays that way until it is closed.
 *
 * submitted_us is stamped before the device can see the transfer, completed_us after it can no longer change:
 * what a transfer causes lies after the one, what it reports lies before the other.
 * Checked    tests/unit/test_usb_link.c, tests/wire/
 */
#ifndef DRIVERS_USB_LINK_H
#define DRIVERS_USB_LINK_H

#include <poll.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "drivers/bench.h"
#include "drivers/clock.h"
#include "proto/err.h"

#define USB_LINK_CANCEL_MS 200

struct usb_transfer {
    uint8_t endpoint; /* 0x80 set = IN */
    uint8_t *data;
    size_t length;
    size_t actual;
    int status;
    bool pending;
    int64_t submitted_us, completed_us;
};

struct usb_device_info {
    uint16_t vid, pid;
    char serial[64];    /* iSerial as the device describes itself, may be empty */
    char path[64];      /* bus-port path or the link's target */
    int max_packet[32]; /* by endpoint: OUT n at n, IN n at 16 + n; 0 = no such endpoint */
};

struct usb_link_ops {
    int (*submit)(void *self, struct usb_transfer *t, struct err *e);
    void (*reap)(void *self); /* marks what has completed; returns at once */
    void (*cancel)(void *self,
                   struct usb_transfer *t); /* completes as -ECANCELED, or as it had just completed */
    int (*clear_halt)(void *self, uint8_t endpoint, struct err *e);
    int (*reset)(void *self, struct err *e); /* the device keeps its state; the interface is claimed again */
    int64_t (*due_us)(void *self);           /* next completion a simulated link knows of, else CLOCK_NEVER */
    int (*descriptors)(void *self, struct pollfd *fd, int max);
    void (*close)(void *self);
};

struct usb_link {
    const struct usb_link_ops *ops;
    void *self;
    struct usb_device_info info;
};

/* For the link back ends: the common names of targets and the deadline after which they give up a cancelled
 * transfer themselves, inside USB_LINK_CANCEL_MS. */
#define USB_LINK_ABANDON_US 100000
int usb_link_open_libusb(struct usb_link *link, uint16_t vid, uint16_t pid, const char *serial,
                         struct clock *clock, struct err *e);
int usb_link_open_redir(struct usb_link *link, const char *where, uint16_t vid, uint16_t pid,
                        struct clock *clock, struct err *e);

/* What the config key spectrometer.link and serial choose. target: "usb", "usbredir:unix:PATH",
 * "usbredir:tcp:HOST:PORT". vid/pid choose among devices; serial (EEPROM serial is read by the driver, so
 * here only a bus path or iSerial can choose) may be NULL.
 * Errors     -ERR_DEVICE absent or another model; -ERR_PERMISSION (names the udev rule); -ERR_BUSY claimed by another
 *            process; -ERR_LINK the redirection host does not answer. */
int usb_link_open(struct usb_link *link, const char *target, uint16_t vid, uint16_t pid, const char *serial,
                  struct clock *clock, struct err *e);

/* Makes the link a service of the bench: reaps when due or readable. */
int usb_link_serve(struct usb_link *link, struct bench *bench, struct err *e);
/* Takes the link from the bench (NULL: it serves none) and closes it; a link never opened is left alone. */
void usb_link_close(struct usb_link *link, struct bench *bench);

static inline int usb_link_max_packet(const struct usb_link *link, uint8_t endpoint) {
    return link->info.max_packet[(endpoint & 0x80 ? 16 : 0) + (endpoint & 0x0f)];
}

static inline bool usb_link_has(const struct usb_link *link, uint8_t endpoint) {
    return usb_link_max_packet(link, endpoint) > 0;
}

/* Submits and waits in bench_wait; on the deadline cancels and waits for the transfer to come home.
 * Returns 0 (look at status and actual), -ERR_TIMEOUT (actual may be > 0), -ERR_CANCELLED, or submit's error.
 */
int usb_link_transfer(struct usb_link *link, struct bench *bench, struct usb_transfer *t, int64_t until_us,
                      const struct cancel *cancel, struct err *e);
/* Cancels what is pending and waits, at most USB_LINK_CANCEL_MS, until all of it has come home. */
void usb_link_recall(struct usb_link *link, struct bench *bench, struct usb_transfer *const *t, int n);

/* One line of `gonioctl devices`. */
struct usb_found {
    struct usb_device_info info;
    bool can_open; /* false: permission is the obstacle */
    bool busy;
};
int usb_link_list(struct usb_found *found, int max, struct err *e); /* how many, or a negative code */

#endif
