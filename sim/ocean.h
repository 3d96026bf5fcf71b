/*
 * ocean.h — a spectrometer of the classic Ocean family behind its four bulk endpoints.
 *
 * Host side: ocean_out takes what arrives on 0x01; ocean_in hands out packets of 0x81, 0x82 and 0x86 into a
 * transfer, one at a time, as a bus would: a short packet ends the transfer, a packet that does not fit is babble
 * and lost. Inside: commands 01 02 03 05 09 0A 6A 6B 6C FE (an unknown opcode gets no reply), EEPROM with garbage
 * after the NUL, and the free-run engines, which integrate in the background:
 *   USB2000+  a request starts a frame when idle; after it is read two more are taken unasked; a request during
 *             one of them gets it, else they are dropped.
 *   USB4000   integrates all the time; a finished frame goes to the FIFO if that is empty, so that it can be older
 *             than the request; else idle cycles run until the FIFO is empty and a request is pending.
 * Requests, FIFO and endpoint memory outlive a client; ocean_reset (bus reset) clears endpoint memory only.
 *
 * Times      microseconds, never backwards; ocean_due_us tells when the next thing happens that a reader of 0x82
 *            or 0x86 waits for. Frame content is asked of the bench when a frame is handed over.
 * Source     spectrometer-ocean.md 2, 3, 4.
 * Checked    tests/unit/test_sim_ocean.c, tests/wire/
 */
#ifndef SIM_OCEAN_H
#define SIM_OCEAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sim/detector.h"

#define OCEAN_VID 0x2457
#define OCEAN_SLOTS 31
#define OCEAN_SLOT_BYTES 15
#define OCEAN_PACKETS 32
#define OCEAN_NAK (-1)
#define OCEAN_BABBLE (-2)
#define OCEAN_STALL (-3)

struct ocean_queue { /* packets of one IN endpoint, the oldest first */
    uint8_t data[2 * DETECTOR_PIXELS_MAX + 64];
    uint16_t packet[OCEAN_PACKETS]; /* lengths */
    size_t used;
    int n;
};

struct ocean_window { /* of one integration */
    int64_t from_us, to_us;
    uint32_t exposure_us;
};

struct ocean_bench { /* what the spectrometer is attached to */
    void *self;
    void (*frame)(void *self, const struct ocean_window *window, uint16_t *counts);
    void (*lamp)(void *self, int64_t now_us, bool on);
};

struct ocean {
    const struct detector_model *model;
    struct ocean_bench bench;
    uint8_t eeprom[OCEAN_SLOTS][OCEAN_SLOT_BYTES];
    uint16_t fpga[256];
    uint8_t trigger;
    bool lamp;
    uint32_t exposure_us; /* as set; a running integration keeps its own */
    bool requested;
    int64_t requested_us;
    /* engine */
    bool integrating; /* USB4000: false = an idle cycle */
    struct ocean_window cycle;
    int unasked; /* USB2000+: frames left to take without a request */
    bool fifo_full;
    struct ocean_window fifo;
    int64_t fifo_ready_us;
    int64_t read_us;                       /* when the endpoints were last emptied */
    struct ocean_queue reply, first, rest; /* 0x81, 0x86, 0x82 */
};

void ocean_init(struct ocean *o, const struct detector_model *model, const char *serial,
                const struct ocean_bench *bench);
/* What arrives on an OUT endpoint. Bytes taken or OCEAN_STALL. */
int ocean_out(struct ocean *o, int64_t now_us, uint8_t endpoint, const uint8_t *data, size_t size);
/* Fills data[*actual..length) with the packets there are. 0: the transfer is complete; OCEAN_NAK: more to
 * come; OCEAN_BABBLE; OCEAN_STALL no such endpoint. */
int ocean_in(struct ocean *o, int64_t now_us, uint8_t endpoint, uint8_t *data, size_t length, size_t *actual);
int64_t ocean_due_us(struct ocean *o); /* INT64_MAX: nothing on its way */
void ocean_reset(struct ocean *o);
int ocean_max_packet(uint8_t endpoint); /* high speed; 0 = no such endpoint */

/* ocean_engine.c */
void ocean_advance(struct ocean *o, int64_t now_us);
void ocean_request(struct ocean *o, int64_t now_us);
int64_t ocean_next_us(const struct ocean *o);
/* ocean_eeprom.c */
void ocean_eeprom_fill(struct ocean *o, const char *serial);
void ocean_eeprom_blank(struct ocean *o);
void ocean_eeprom_corrupt(struct ocean *o);

#endif
