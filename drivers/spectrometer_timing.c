/*
 * Why the bounds of spectrometer_timing.h hold (spectrometer-ocean.md 4).
 *
 * USB4000, idle-cycle model. The unit integrates all the time. A finished frame goes into a FIFO that holds
 * one; the integration that runs beside it is kept only if the host has emptied the FIFO before it ends, and
 * is followed by idle cycles otherwise, until the FIFO is empty and a request is pending.
 *  - Frame k-1 leaves the FIFO because of request R, so frame k can enter it, that is end, only after R. This
 *    gives "ended after R" for k, and "ended after R'" for k-1, hence "began after R'" for k.
 *  - One thrown-away frame alone would not do: when the stage settles while the parallel integration runs,
 * the frame in the FIFO is old and the next one mixes both states. It is kept only if the FIFO was emptied
 *    within one integration time, so with R at least two integration times after C' (the parked frame's
 *    integration and the one beside it, each begun before C') it has been dropped: frame k starts after R.
 *    If k-1 was not parked at all it began after R, and k later still.
 *  - A campaign's moves mostly last longer than 2 T: the first frame after a move is the parked one and costs
 * a millisecond, then half an idle cycle passes in the mean, then every frame counts. Short moves of long
 *    exposures cost one frame more.
 *
 * USB2000+, three-frame model. After a request the unit takes that spectrum and two more of its own accord,
 * acquires nothing before the first is read, then idles. By the sheet a request during the second or third
 * gets the running one (k ended after R_k), and a request to the idle unit starts a fresh one. Units in the
 * field have given spectra older than that, and the sheet that goniod goes by asks for two discards
 * (spectrometer-ocean.md 4 and 11): so only what holds with one frame kept in a buffer is used, which is
 * weaker than the sheet in every case and makes the bounds of both models the same.
 *
 * An integration lasts T by the unit's own crystal; a part in a thousand is ten times what a crystal drifts.
 * A new integration time holds for integrations that begin after it was verified; the running one keeps the
 * old, and an idle cycle of the old length may still have to end.
 */
#include "drivers/spectrometer_timing.h"

#define UNKNOWN_PAST (INT64_MIN / 2)
#define KNOWN_PAST (INT64_MIN / 4) /* sums with an unknown stay below */
#define UNKNOWN_FUTURE (INT64_MAX / 2)
#define TRANSPORT_US 20000 /* from the end of a read-out to the host's completion, generously */

static int64_t later(int64_t a, int64_t b) {
    return a > b ? a : b;
}

void spectrometer_timing_init(struct spectrometer_timing *t, int exposure_us, int longest_us,
                              int64_t now_us) {
    *t = (struct spectrometer_timing){
        .sent_us = {UNKNOWN_PAST, UNKNOWN_PAST},
        .done_us = {UNKNOWN_FUTURE, UNKNOWN_FUTURE},
        .end_low_us = UNKNOWN_PAST,
        .changed_us = now_us,
        .exposure_us = exposure_us,
        .low_us = 0,
        .high_us = longest_us > exposure_us ? longest_us : exposure_us,
    };
}

void spectrometer_timing_change(struct spectrometer_timing *t, int exposure_us, int64_t now_us) {
    t->exposure_us = exposure_us;
    t->changed_us = now_us;
    if (exposure_us < t->low_us)
        t->low_us = exposure_us;
    if (exposure_us > t->high_us)
        t->high_us = exposure_us;
}

static bool was_idle(const struct spectrometer_timing *t, const struct spectrometer_model *model) {
    int64_t cycle = (int64_t)t->high_us + t->high_us / 1000 + model->readout_us;
    return t->sent_us[0] >= t->done_us[1] + 2 * cycle + TRANSPORT_US;
}

int64_t spectrometer_timing_start(const struct spectrometer_timing *t,
                                  const struct spectrometer_model *model) {
    int64_t start = later(t->end_low_us, t->sent_us[1]);
    start = later(start, t->sent_us[0] - t->high_us - t->high_us / 1000);
    return was_idle(t, model) ? later(start, t->sent_us[0]) : start;
}

bool spectrometer_timing_fresh(const struct spectrometer_timing *t, const struct spectrometer_model *model,
                               int64_t since_us) {
    return t->sent_us[model->discards - 1] >= since_us && spectrometer_timing_start(t, model) >= since_us;
}

void spectrometer_timing_add(struct spectrometer_timing *t, const struct spectrometer_model *model,
                             int64_t sent_us, int64_t done_us) {
    int64_t start = spectrometer_timing_start(t, model);
    if (start >= t->changed_us)
        t->low_us = t->high_us = t->exposure_us;
    t->end_low_us = start > KNOWN_PAST ? start + t->low_us - t->low_us / 1000 : UNKNOWN_PAST;
    t->sent_us[1] = t->sent_us[0];
    t->done_us[1] = t->done_us[0];
    t->sent_us[0] = sent_us;
    t->done_us[0] = done_us;
}
