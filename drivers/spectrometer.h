/*
 * spectrometer.h — spectra of the classic Ocean family (USB2000+/Flame-S, USB4000/Flame-T) with their true
 * time stamps.
 *
 * Facts: spectrometer-ocean.md. Opening drains what an earlier session left, reads EEPROM, switches the lamp
 * line off, verifies trigger and integration time by the status packet. A frame that may have begun before
 * `not_before_us`, or before integration time or lamp changed, is read and thrown away: at least
 * model->discards of them, more where time stamps ask for it (spectrometer_timing.h). Nothing is thrown away
 * while nothing has changed.
 *
 * Raw counts are uint16 as sent; saturation is decided on raw counts against EEPROM slot 17. Nothing here is
 * reduced: electric dark, linearity and wavelengths are given by the calibration and applied by the
 * reduction. Every wait is in bench_wait and has a deadline of 2.2 x max(old, new integration time) +
 * read-out + 1 s.
 *
 * Errors     -ERR_TIMEOUT    no frame in time; the recovery ladder (drain, re-initialise, clear-halt, one reset) has
 *                             been run and a probe frame was good: repeat the set. A setting that is lost on the
 *                             wire climbs it too, and then is in force
 *            -ERR_IO         a frame that is none: length, sync byte, all pixels equal, stall, babble; likewise
 *            -ERR_DEVICE     the ladder failed: it needs a power cycle; or another model; or a blank EEPROM
 *            -ERR_LINK       gone from the bus: close both, open both again
 *            -ERR_CANCELLED  at once; the frame under way is taken in by spectrometer_drain or the next acquire
 * Checked    tests/unit/test_spectrometer.c, tests/unit/test_spectrometer_timing.c,
 *            tests/scenario/test_spectra.c, tests/wire/
 */
#ifndef DRIVERS_SPECTROMETER_H
#define DRIVERS_SPECTROMETER_H

#include <stdbool.h>
#include <stdint.h>

#include "drivers/bench.h"
#include "drivers/usb_link.h"
#include "proto/calibration.h"
#include "proto/err.h"

#define SPECTROMETER_PIXELS_MAX 3840

struct spectrometer_model { /* one row of a table: what differs between models */
    const char *name;       /* "usb2000plus" */
    const char *title;      /* "USB2000+ / Flame-S" */
    uint16_t vid, pid;
    int pixels;                    /* uint16 each, then the sync byte 69 */
    int head_bytes;                /* at high speed these come first, on endpoint 86; 0 = none */
    int dark_first, dark_last;     /* electric dark, 0-based, inclusive */
    int active_first, active_last; /* 0-based, inclusive */
    int min_exposure_us, max_exposure_us;
    int discards;       /* frames to throw away after a change */
    double idle_cycles; /* mean idle cycle per fresh frame, in integration times (plan's time model) */
    int readout_us;
    double read_noise_counts; /* spectrometer-ocean.md 7 */
    double electrons_per_count;
};

const struct spectrometer_model *spectrometer_model_find(const char *name); /* NULL if unknown */
const struct spectrometer_model *spectrometer_models(int *n);

struct frame {
    uint16_t counts[SPECTROMETER_PIXELS_MAX]; /* raw, as sent */
    int pixels;
    int exposure_us;
    int64_t start_us, end_us; /* earliest possible start, latest possible end of the integration */
    int saturated_pixels;     /* active pixels with raw >= saturation level */
    bool lamp;
};

struct spectrometer;

int spectrometer_open(struct spectrometer **s, const struct spectrometer_model *model, struct usb_link *link,
                      struct bench *bench, const struct cancel *cancel, struct err *e);
void spectrometer_close(struct spectrometer *s);
const struct spectrometer_model *spectrometer_model(const struct spectrometer *s);
const struct calibration *spectrometer_calibration(const struct spectrometer *s);

/* The integration time in use for a wish: rounded to what both sheets of a model can set (10 us steps, 1 ms
 * steps above 655 ms). Frames carry the value in use. */
int spectrometer_round_exposure(int exposure_us);
/* Integration time by opcode 02, verified by FE. -ERR_RANGE outside the model's limits. The value that is
 * already in use costs nothing, and no frame. */
int spectrometer_set_exposure(struct spectrometer *s, int exposure_us, const struct cancel *cancel,
                              struct err *e);
/* The lamp line as shutter, verified by FE. Works, like the temperature, while a frame is under way. */
int spectrometer_set_lamp(struct spectrometer *s, bool on, const struct cancel *cancel, struct err *e);
int spectrometer_temperature(struct spectrometer *s, double *celsius, struct err *e);

/* n frames whose integration began at or after not_before_us. start_us and end_us of the frames ascend, and
 * no frame's integration overlaps the next one's (their stated intervals may). */
int spectrometer_acquire(struct spectrometer *s, int n, int64_t not_before_us, struct frame *frames,
                         const struct cancel *cancel, struct err *e);
/* After an abort: take in the frame that is still on its way. */
int spectrometer_drain(struct spectrometer *s, struct err *e);

#endif
