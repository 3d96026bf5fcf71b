/*
 * spectrometer_wire.h — the bytes between goniod and a classic Ocean spectrometer: commands, replies, frames.
 *
 * Commands go out on endpoint 01 and are answered on 81; frames come on 82, at high speed after the first
 * head_bytes on 86 (spectrometer-ocean.md 2 and 3). Reads are queued before the command that fills them. One
 * frame at most is under way; commands and status may pass while it is.
 *
 * Errors     -ERR_TIMEOUT; -ERR_IO stall, babble, wrong length or content; -ERR_LINK the device is gone;
 *            -ERR_CANCELLED.
 * Checked    tests/unit/test_spectrometer.c: every byte, size and order; each way to break a frame
 */
#ifndef DRIVERS_SPECTROMETER_WIRE_H
#define DRIVERS_SPECTROMETER_WIRE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "drivers/bench.h"
#include "drivers/spectrometer.h"
#include "drivers/usb_link.h"
#include "proto/err.h"

#define SPECTROMETER_WIRE_SLOT 15 /* data bytes of an EEPROM slot */
/* Head and tail of the longest frame, each rounded up to whole packets. */
#define SPECTROMETER_WIRE_FRAME 8192
#define SPECTROMETER_WIRE_REPLY 512 /* a whole packet also where endpoint 81 declares 512 */

struct spectrometer_wire {
    struct usb_link *link;
    struct bench *bench;
    const struct spectrometer_model *model;
    int head_bytes;       /* on endpoint 86; 0 at full speed and for models without */
    bool requested;       /* a frame is under way */
    int64_t requested_us; /* stamped before its request was sent */
    int skipped;          /* leftover sync bytes dropped from its front */
    bool replies_stale;   /* an old reply may lie on endpoint 81 */
    struct usb_transfer command, request, reply, head, tail;
    uint8_t command_data[4 + SPECTROMETER_WIRE_SLOT], request_data[1];
    uint8_t reply_data[SPECTROMETER_WIRE_REPLY];
    uint8_t frame_data[SPECTROMETER_WIRE_FRAME];
};

struct spectrometer_status { /* reply to FE; bytes whose meaning differs between units are left out */
    int pixels;
    uint32_t exposure_us;
    bool lamp;
    int trigger;
    bool frame_pending; /* requested or ready, from byte 8 */
    bool packets_left;  /* byte 11: old data may lie in the endpoints */
};

/* -ERR_DEVICE where the endpoints are not those of the model. */
int spectrometer_wire_init(struct spectrometer_wire *w, const struct spectrometer_model *model,
                           struct usb_link *link, struct bench *bench, struct err *e);
/* Takes every pending transfer back. */
void spectrometer_wire_recall(struct spectrometer_wire *w);

int spectrometer_wire_send(struct spectrometer_wire *w, const uint8_t *bytes, size_t n,
                           const struct cancel *cancel, struct err *e);
int spectrometer_wire_status(struct spectrometer_wire *w, struct spectrometer_status *status,
                             const struct cancel *cancel, struct err *e);
int spectrometer_wire_slot(struct spectrometer_wire *w, int slot, uint8_t data[SPECTROMETER_WIRE_SLOT],
                           const struct cancel *cancel, struct err *e);
int spectrometer_wire_temperature(struct spectrometer_wire *w, double *celsius, struct err *e);

/* Queues the reads, then sends the request; does not wait. */
int spectrometer_wire_request(struct spectrometer_wire *w, struct err *e);
/* Waits for the requested frame. counts[model->pixels] and done_us are written on success only. On
 * -ERR_CANCELLED it stays under way; on any other error it has been recalled. */
int spectrometer_wire_frame(struct spectrometer_wire *w, int64_t until_us, uint16_t *counts, int64_t *done_us,
                            const struct cancel *cancel, struct err *e);
/* Reads and drops whatever the device sends until it has been quiet for 100 ms; waits first_us for the first
 * of it. Clears the halt of an endpoint that stalls. */
int spectrometer_wire_drain(struct spectrometer_wire *w, int64_t first_us, const struct cancel *cancel,
                            struct err *e);
int spectrometer_wire_clear_halts(struct spectrometer_wire *w, struct err *e);

#endif
