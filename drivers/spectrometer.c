#include "drivers/spectrometer.h"

#include <stdlib.h>

#include "drivers/spectrometer_eeprom.h"
#include "drivers/spectrometer_timing.h"
#include "drivers/spectrometer_wire.h"
#include "proto/units.h"

/* Short, and above what Flame-S times badly (spectrometer-ocean.md 8, 14). */
#define PROBE_EXPOSURE_US 10000
#define INITIALISE_US (100 * US_PER_MS) /* pause after 01 (section 3) */
#define SETTING_US (10 * US_PER_MS)     /* pause before a setting is read again (3.1) */
#define SETTING_TRIES 3
#define STEP_US 10 /* of the integration time; above COARSE_FROM_US it is COARSE_STEP_US (3.1) */
#define COARSE_FROM_US 655000
#define COARSE_STEP_US 1000

struct spectrometer {
    const struct spectrometer_model *model;
    struct usb_link *link;
    struct bench *bench;
    struct calibration calibration;
    struct spectrometer_wire wire;
    struct spectrometer_timing timing;
    bool lamp;       /* as last ordered */
    int64_t lamp_us; /* since when the lamp line is known to be so; CLOCK_NEVER = not verified */
    bool sound;      /* false: the stream may be out of step, the ladder runs before the next frame */
    uint16_t dropped[SPECTROMETER_PIXELS_MAX];
};

const struct spectrometer_model *spectrometer_model(const struct spectrometer *s) {
    return s->model;
}

const struct calibration *spectrometer_calibration(const struct spectrometer *s) {
    return &s->calibration;
}

static int64_t stamp(struct spectrometer *s) {
    return clock_stamp(s->bench->clock);
}

static int pause_for(struct spectrometer *s, int64_t us, const struct cancel *cancel, struct err *e) {
    int rc = bench_wait(s->bench, stamp(s) + us, NULL, NULL, cancel);
    return rc < 0 ? err_set(e, -rc, "the spectrometer's pause was ended") : 0;
}

/* spectrometer-ocean.md 4, time-outs: the worst case is an idle cycle and a frame, both of the longer time.
 */
static int64_t frame_limit_us(const struct spectrometer *s, int64_t longest_us) {
    return longest_us * 22 / 10 + s->model->readout_us + US_PER_S;
}

/* ---- settings, each verified by the status packet ---- */

int spectrometer_round_exposure(int exposure_us) {
    int step = exposure_us > COARSE_FROM_US ? COARSE_STEP_US : STEP_US;
    return (exposure_us + step / 2) / step * step;
}

typedef bool status_check(const struct spectrometer_status *status, uint32_t wanted);

static bool exposure_is(const struct spectrometer_status *status, uint32_t wanted) {
    return status->exposure_us == wanted;
}

static bool lamp_is(const struct spectrometer_status *status, uint32_t wanted) {
    return status->lamp == (wanted != 0);
}

static bool trigger_is(const struct spectrometer_status *status, uint32_t wanted) {
    return status->trigger == (int)wanted;
}

/* A unit drops what it does not accept without a word, and an older status may still be in its memory. */
static int set_verified(struct spectrometer *s, const uint8_t *command, size_t n, status_check *check,
                        uint32_t wanted, const struct cancel *cancel, struct err *e) {
    for (int i = 0; i < SETTING_TRIES; i++) {
        struct spectrometer_status status;
        int rc = i ? pause_for(s, SETTING_US, cancel, e) : 0;
        if (rc == 0)
            rc = spectrometer_wire_send(&s->wire, command, n, cancel, e);
        if (rc == 0)
            rc = spectrometer_wire_status(&s->wire, &status, cancel, e);
        if (rc)
            return rc;
        if (check(&status, wanted))
            return 0;
    }
    return err_set(
        e, ERR_DEVICE,
        "the spectrometer's status does not show setting %02x = %u: it refused it, or it is another "
        "model",
        command[0], wanted);
}

static int send_exposure(struct spectrometer *s, int us, const struct cancel *cancel, struct err *e) {
    const uint8_t command[] = {0x02, us & 0xff, us >> 8 & 0xff, us >> 16 & 0xff, us >> 24 & 0xff};
    return set_verified(s, command, sizeof command, exposure_is, us, cancel, e);
}

static int send_lamp(struct spectrometer *s, bool on, const struct cancel *cancel, struct err *e) {
    return set_verified(s, (uint8_t[]){0x03, on, 0x00}, 3, lamp_is, on, cancel, e);
}

static int send_trigger(struct spectrometer *s, const struct cancel *cancel, struct err *e) {
    return set_verified(s, (uint8_t[]){0x0a, 0x00, 0x00}, 3, trigger_is, 0, cancel, e);
}

static int order_exposure(struct spectrometer *s, int us, const struct cancel *cancel, struct err *e) {
    if (us == s->timing.exposure_us && s->timing.changed_us != CLOCK_NEVER)
        return 0;
    spectrometer_timing_change(&s->timing, us, CLOCK_NEVER); /* a frame under way may have either */
    int rc = send_exposure(s, us, cancel, e);
    if (rc == 0)
        s->timing.changed_us = stamp(s);
    return rc;
}

static int order_lamp(struct spectrometer *s, bool on, const struct cancel *cancel, struct err *e) {
    if (on == s->lamp && s->lamp_us != CLOCK_NEVER)
        return 0;
    s->lamp = on;
    s->lamp_us = CLOCK_NEVER;
    int rc = send_lamp(s, on, cancel, e);
    if (rc == 0)
        s->lamp_us = stamp(s);
    return rc;
}

static int recover(struct spectrometer *s, const struct cancel *cancel, struct err *e);

/* A command or its reply that went wrong on the wire needs the ladder as a frame does: an endpoint that stalls is
 * not freed by asking again. Its probe ends with both settings ordered anew. */
static int after_order(struct spectrometer *s, int rc, const struct err *why, const struct cancel *cancel,
                       struct err *e) {
    if (rc == -ERR_TIMEOUT || rc == -ERR_IO)
        return recover(s, cancel, e);
    return rc ? err_set(e, -rc, "%s", why->text) : 0;
}

int spectrometer_set_exposure(struct spectrometer *s, int exposure_us, const struct cancel *cancel,
                              struct err *e) {
    const struct spectrometer_model *m = s->model;
    struct err why = {0};
    if (exposure_us < m->min_exposure_us || exposure_us > m->max_exposure_us)
        return err_set(e, ERR_RANGE, "an integration time of %d us is outside %d..%d us of the %s",
                       exposure_us, m->min_exposure_us, m->max_exposure_us, m->title);
    int rc = order_exposure(s, spectrometer_round_exposure(exposure_us), cancel, &why);
    return after_order(s, rc, &why, cancel, e);
}

int spectrometer_set_lamp(struct spectrometer *s, bool on, const struct cancel *cancel, struct err *e) {
    struct err why = {0};
    int rc = order_lamp(s, on, cancel, &why);
    return after_order(s, rc, &why, cancel, e);
}

int spectrometer_temperature(struct spectrometer *s, double *celsius, struct err *e) {
    return spectrometer_wire_temperature(&s->wire, celsius, e);
}

/* What was ordered and could not be verified, or was lost in a reset, is ordered again before a frame counts.
 */
static int renew_settings(struct spectrometer *s, const struct cancel *cancel, struct err *e) {
    int rc = order_lamp(s, s->lamp, cancel, e);
    return rc ? rc : order_exposure(s, s->timing.exposure_us, cancel, e);
}

/* ---- frames ---- */

/* Takes in the frame under way, whatever it shows. */
static int take_frame(struct spectrometer *s, uint16_t *counts, int64_t *done_us, const struct cancel *cancel,
                      struct err *e) {
    int64_t limit = frame_limit_us(s, s->timing.high_us);
    int rc = spectrometer_wire_frame(&s->wire, stamp(s) + limit, counts, done_us, cancel, e);
    if (rc == 0)
        spectrometer_timing_add(&s->timing, s->model, s->wire.requested_us, *done_us);
    else if (rc != -ERR_CANCELLED)
        s->sound = false;
    return rc;
}

static int saturated_pixels(const struct calibration *c, const uint16_t *counts) {
    int n = 0;
    for (int p = c->active_first; p <= c->active_last; p++)
        n += counts[p] >= c->saturation;
    return n;
}

/* One frame, into *frame; *fresh says whether it may be kept. */
static int next_frame(struct spectrometer *s, int64_t since_us, struct frame *frame, bool *fresh,
                      const struct cancel *cancel, struct err *e) {
    int rc = s->wire.requested ? 0 : spectrometer_wire_request(&s->wire, e);
    if (rc)
        return rc;
    *fresh = spectrometer_timing_fresh(&s->timing, s->model, since_us);
    frame->start_us = spectrometer_timing_start(&s->timing, s->model);
    rc = take_frame(s, frame->counts, &frame->end_us, cancel, e);
    if (rc || !*fresh)
        return rc;
    frame->pixels = s->model->pixels;
    frame->exposure_us = s->timing.exposure_us;
    frame->lamp = s->lamp;
    frame->saturated_pixels = saturated_pixels(&s->calibration, frame->counts);
    return 0;
}

static int64_t since_when(const struct spectrometer *s, int64_t not_before_us) {
    int64_t since = not_before_us;
    if (s->timing.changed_us > since)
        since = s->timing.changed_us;
    return s->lamp_us > since ? s->lamp_us : since;
}

static int acquire_set(struct spectrometer *s, int n, int64_t since_us, struct frame *frames,
                       const struct cancel *cancel, struct err *e) {
    int rc = 0;
    for (int got = 0; rc == 0 && got < n;) {
        bool fresh = false;
        rc = next_frame(s, since_us, &frames[got], &fresh, cancel, e);
        got += rc == 0 && fresh;
    }
    return rc;
}

/* ---- the ladder back to a stream in step (spectrometer-ocean.md 4, recovery) ---- */

/* There is no order to stop an acquisition: a frame that an earlier session asked for has to be waited for.
 */
static int drain_old_frame(struct spectrometer *s, int *longest_us, const struct cancel *cancel,
                           struct err *e) {
    struct spectrometer_status status;
    int rc = spectrometer_wire_drain(&s->wire, 0, cancel, e);
    if (rc == 0)
        rc = spectrometer_wire_status(&s->wire, &status, cancel, e);
    if (rc)
        return rc;
    if (status.pixels != s->model->pixels)
        return err_set(e, ERR_DEVICE, "the spectrometer has %d pixels, a %s has %d: another model?",
                       status.pixels, s->model->title, s->model->pixels);
    *longest_us = status.exposure_us < (uint32_t)s->model->max_exposure_us ? (int)status.exposure_us
                                                                           : s->model->max_exposure_us;
    if (status.frame_pending)
        return spectrometer_wire_drain(&s->wire, frame_limit_us(s, *longest_us), cancel, e);
    return status.packets_left ? spectrometer_wire_drain(&s->wire, 0, cancel, e) : 0;
}

static int probe(struct spectrometer *s, int longest_us, const struct cancel *cancel, struct err *e) {
    int wanted_us = s->timing.exposure_us;
    int64_t done_us;
    int rc = spectrometer_wire_send(&s->wire, (uint8_t[]){0x01}, 1, cancel, e);
    if (rc == 0)
        rc = pause_for(s, INITIALISE_US, cancel, e);
    if (rc == 0)
        rc = send_trigger(s, cancel, e);
    if (rc == 0)
        rc = send_exposure(s, PROBE_EXPOSURE_US, cancel, e);
    spectrometer_timing_init(&s->timing, PROBE_EXPOSURE_US, longest_us, stamp(s));
    if (rc == 0)
        rc = spectrometer_wire_request(&s->wire, e);
    if (rc == 0)
        rc = take_frame(s, s->dropped, &done_us, cancel, e);
    if (wanted_us != PROBE_EXPOSURE_US || rc)
        spectrometer_timing_change(&s->timing, wanted_us, CLOCK_NEVER);
    s->lamp_us = CLOCK_NEVER;
    return rc ? rc : renew_settings(s, cancel, e);
}

static int climb(struct spectrometer *s, int rung, const struct cancel *cancel, struct err *e) {
    int rc = 0, longest_us = 0;
    if (rung > 0)
        spectrometer_wire_recall(&s->wire);
    if (rung == 2)
        rc = s->link->ops->reset(s->link->self, e);
    if (rung > 0 && rc == 0)
        rc = spectrometer_wire_clear_halts(&s->wire, e);
    if (rc == 0)
        rc = drain_old_frame(s, &longest_us, cancel, e);
    return rc ? rc : probe(s, longest_us, cancel, e);
}

static int recover(struct spectrometer *s, const struct cancel *cancel, struct err *e) {
    struct err last = {0};
    s->sound = false;
    for (int rung = 0; rung < 3; rung++) {
        err_clear(&last);
        int rc = climb(s, rung, cancel, &last);
        s->sound = rc == 0;
        if (rc == 0)
            return 0;
        if (rc == -ERR_CANCELLED || rc == -ERR_LINK)
            return err_set(e, -rc, "%s", last.text);
    }
    return err_set(e, ERR_DEVICE,
                   "the spectrometer stays out of step after draining, clearing its endpoints and a reset; "
                   "switch it off and on (%s)",
                   last.text);
}

/* A frame went wrong: puts the stream in step again, so that the caller may repeat at once. The frame's error
 * is the one to tell, unless the ladder's is worse. */
static int recover_after(struct spectrometer *s, int rc, const struct err *why, const struct cancel *cancel,
                         struct err *e) {
    int ladder = rc == -ERR_LINK ? 0 : recover(s, cancel, e);
    return ladder ? ladder : err_set(e, -rc, "%s", why->text);
}

/* ---- opening, acquiring ---- */

int spectrometer_open(struct spectrometer **out, const struct spectrometer_model *model,
                      struct usb_link *link, struct bench *bench, const struct cancel *cancel,
                      struct err *e) {
    spectrometer_eeprom_slots slots;
    struct spectrometer *s = calloc(1, sizeof *s);
    if (!s)
        return err_set(e, ERR_NOMEM, "no memory for the spectrometer");
    s->model = model;
    s->link = link;
    s->bench = bench;
    s->lamp_us = CLOCK_NEVER;
    spectrometer_timing_init(&s->timing, PROBE_EXPOSURE_US, model->max_exposure_us, stamp(s));
    int rc = spectrometer_wire_init(&s->wire, model, link, bench, e);
    if (rc == 0)
        rc = recover(s, cancel, e);
    if (rc == 0)
        rc = spectrometer_eeprom_read(&s->wire, slots, cancel, e);
    if (rc == 0)
        rc = spectrometer_eeprom_decode(slots, model, &s->calibration, e);
    if (rc) {
        spectrometer_close(s);
        return rc;
    }
    *out = s;
    return 0;
}

void spectrometer_close(struct spectrometer *s) {
    if (!s)
        return;
    spectrometer_wire_recall(&s->wire);
    free(s);
}

int spectrometer_acquire(struct spectrometer *s, int n, int64_t not_before_us, struct frame *frames,
                         const struct cancel *cancel, struct err *e) {
    struct err why = {0};
    int rc =
        s->sound ? after_order(s, renew_settings(s, cancel, &why), &why, cancel, e) : recover(s, cancel, e);
    err_clear(&why);
    if (rc == 0 && not_before_us > stamp(s))
        rc = pause_for(s, not_before_us - clock_now_us(s->bench->clock), cancel, e);
    if (rc)
        return rc;
    rc = acquire_set(s, n, since_when(s, not_before_us), frames, cancel, &why);
    if (rc == -ERR_CANCELLED)
        return err_set(e, ERR_CANCELLED, "%s", why.text);
    return rc ? recover_after(s, rc, &why, cancel, e) : 0;
}

int spectrometer_drain(struct spectrometer *s, struct err *e) {
    int64_t done_us;
    return s->wire.requested ? take_frame(s, s->dropped, &done_us, NULL, e) : 0;
}
