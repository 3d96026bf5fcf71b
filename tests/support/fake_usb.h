/*
 * fake_usb.h — a USB link and a toy spectrometer behind it, in virtual time, for byte-exact tests.
 *
 * Every submit is written down ("82<4608" = a read of 4608 bytes queued, "01>09" = sent, "halt 82", "reset").
 * The toy answers commands at once and a request after one integration time; it has no free-run model (that
 * is sim_usb_link's business) and breaks its next frames in the ways of `fault`.
 */
#ifndef TESTS_SUPPORT_FAKE_USB_H
#define TESTS_SUPPORT_FAKE_USB_H

#include <stdbool.h>
#include <stdint.h>

#include "drivers/spectrometer.h"

#define FAKE_USB_PACKETS 256
#define FAKE_USB_PENDING 8

enum fake_fault {
    FAKE_GOOD,
    FAKE_SILENT,    /* the request is forgotten */
    FAKE_SHORT,     /* a packet is missing */
    FAKE_NO_SYNC,   /* the last byte is 00 */
    FAKE_LEFTOVER,  /* a lone 69 before the frame */
    FAKE_STALL,     /* endpoint 82 stalls until its halt is cleared */
    FAKE_BABBLE,    /* a packet too many */
    FAKE_ALL_EQUAL, /* every pixel 2409 */
    FAKE_UNPLUGGED, /* in the middle of the frame */
};

struct fake_packet {
    uint8_t endpoint, data[512];
    int n;
    int64_t at_us;
};

struct fake_usb {
    struct clock clock;
    struct bench bench;
    struct usb_link link;
    const struct spectrometer_model *model;
    struct fake_packet packet[FAKE_USB_PACKETS];
    int n_packets;
    struct usb_transfer *pending[FAKE_USB_PENDING];
    int n_pending;
    char log[4096];
    /* the toy */
    uint8_t slot[18][15];
    uint32_t exposure_us;
    uint8_t lamp, trigger, acquisition, loaded;
    enum fake_fault fault;
    int fault_count;                       /* frames still to break; < 0: until reset */
    bool ignores_exposure, ignores_status; /* drops 02, FE */
    bool reset_mends;                      /* a reset ends the fault */
    bool gone;
    uint8_t halted; /* the endpoint that stalls until its halt is cleared; 0 = none */
    int frames;     /* requests answered */
    uint16_t level; /* of the active pixels */
};

void fake_usb_init(struct fake_usb *f, const char *model, bool high_speed);
/* Queues what the device sends: in packets of the endpoint's size. */
void fake_usb_send(struct fake_usb *f, uint8_t endpoint, const uint8_t *data, int n, int64_t at_us);
void fake_usb_send_frame(struct fake_usb *f, int64_t at_us);
void fake_usb_slot(struct fake_usb *f, int slot, const char *text); /* NUL, then garbage, as units do */

#endif
