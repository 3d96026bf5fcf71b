/*
 * spectrometer_timing.h — when a frame's integration can have begun, from what the host knows.
 *
 * Two facts need no trust in the host's speed: what a request causes lies after the request was sent; what a
 * completed read reports lies before it completed. From them, with R and C the request and completion of
 * frame k-1 (R', C' of frame k-2) and T the longest integration time that may be in force, frame k began
 * not before
 *     its predecessor's earliest end          integrations do not overlap, each lasts T
 *     R'                                      k-1 ended after R': the buffer holds one frame (below)
 *     R - T                                   k ended after R, for the same reason
 *     R, if R >= C' + 2 (T + read-out)        the unit was idle when R reached it (below)
 * The longest of these is the frame's start_us; its end_us is its completion. The reasoning for each model is
 * in the .c file.
 *
 * Units      us of the bench clock.
 * Domain     any order of calls; before the first frame nothing is known.
 * Checked    tests/unit/test_spectrometer_timing.c: both free-run models at random, never one start too late
 */
#ifndef DRIVERS_SPECTROMETER_TIMING_H
#define DRIVERS_SPECTROMETER_TIMING_H

#include <stdbool.h>
#include <stdint.h>

#include "drivers/spectrometer.h"

struct spectrometer_timing {
    int64_t sent_us[2];  /* requests of the last two frames, newest first */
    int64_t done_us[2];  /* their completions */
    int64_t end_low_us;  /* earliest possible end of the newest frame's integration */
    int64_t changed_us;  /* since when exposure_us is in force */
    int exposure_us;     /* in force */
    int low_us, high_us; /* what the next frame may have been exposed for */
};

/* Nothing is known of earlier frames, except that they were exposed for at most longest_us. */
void spectrometer_timing_init(struct spectrometer_timing *t, int exposure_us, int longest_us, int64_t now_us);
void spectrometer_timing_change(struct spectrometer_timing *t, int exposure_us, int64_t now_us);
/* Of the next frame to complete. INT64_MIN / 4 or less = unknown. */
int64_t spectrometer_timing_start(const struct spectrometer_timing *t,
                                  const struct spectrometer_model *model);
/* The next frame to complete began at or after since_us, and the model's discards lie in between. */
bool spectrometer_timing_fresh(const struct spectrometer_timing *t, const struct spectrometer_model *model,
                               int64_t since_us);
void spectrometer_timing_add(struct spectrometer_timing *t, const struct spectrometer_model *model,
                             int64_t sent_us, int64_t done_us);

#endif
