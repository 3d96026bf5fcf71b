/*
 * spectrometer.h — spectra of the classic Ocean family (USB2000+/Flame-S, USB4000/Flame-T) with their true
 * time stamps.
 *
 * Facts: spectrometer-ocean.md. Opening drains what an earlier session left, reads EEPROM, verifies trigger
 * and integration time by the status packet. A frame that may have begun before `not_before_us`, or before
 * integration time or lamp changed, is read and thrown away (1 frame on USB4000, 2 on USB2000+, or more where
 * time stamps ask for it).
 *
 * Raw counts are uint16 as sent; saturation is decided on raw counts against EEPROM slot 17. Nothing here is
 * reduced: electric dark, linearity and wavelengths are given by the calibration and applied by the
 * reduction. Every wait is in bench_wait and has a deadline of 2.2 x max(old, new integration time) +
 * read-out + 1 s. Checked    tests/unit/test_spectrometer.c, tests/wire/
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
    int pixels;
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

/* Integration time by opcode 02, verified by FE. -ERR_RANGE outside the model's limits. */
int spectrometer_set_exposure(struct spectrometer *s, int exposure_us, const struct cancel *cancel,
                              struct err *e);
int spectrometer_set_lamp(struct spectrometer *s, bool on, const struct cancel *cancel, struct err *e);
int spectrometer_temperature(struct spectrometer *s, double *celsius, struct err *e);

/* n frames whose integration began at or after not_before_us. On -ERR_TIMEOUT or a bad frame the driver has
 * already run its recovery ladder (drain, re-initialise, clear-halt, one reset); ERR_DEVICE then means "needs
 * a power cycle". */
int spectrometer_acquire(struct spectrometer *s, int n, int64_t not_before_us, struct frame *frames,
                         const struct cancel *cancel, struct err *e);
/* After an abort: take in the frame that is still on its way. */
int spectrometer_drain(struct spectrometer *s, struct err *e);

#endif
