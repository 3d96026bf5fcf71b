#include "sim/ocean.h"

/* Below it the CCD of a USB4000 cannot run back to back: >= 3 read-outs a frame (spectrometer-ocean.md 4). */
#define SHUTTER_MODE_US 3800

static bool three_frames(const struct ocean *o) {
    return o->model->pixels == 2048;
}

static bool endpoints_empty(const struct ocean *o) {
    return o->first.n == 0 && o->rest.n == 0;
}

static void begin(struct ocean *o, int64_t at_us) {
    uint32_t cycle_us = o->exposure_us;
    if (!three_frames(o) && cycle_us < SHUTTER_MODE_US)
        cycle_us = 3 * SHUTTER_MODE_US;
    o->cycle = (struct ocean_window){at_us + cycle_us - o->exposure_us, at_us + cycle_us, o->exposure_us};
}

static void into_fifo(struct ocean *o) {
    o->fifo = o->cycle;
    o->fifo_full = true;
    o->fifo_ready_us = o->cycle.to_us + o->model->readout_us;
}

/* USB2000+: one asked-for frame, then two more; nothing new before the frame is read. */
static bool step_three(struct ocean *o, int64_t now_us) {
    if (o->fifo_full || !endpoints_empty(o))
        return false;
    if (!o->integrating) {
        bool start = o->unasked > 0 || (o->requested && o->trigger == 0);
        int64_t at_us = o->unasked > 0 || o->read_us > o->requested_us ? o->read_us : o->requested_us;
        if (!start)
            return false;
        begin(o, at_us);
        return o->integrating = true;
    }
    if (now_us < o->cycle.to_us)
        return false;
    if (o->requested) {
        into_fifo(o);
        o->unasked = 2;
        o->integrating = false;
        return false;
    }
    o->integrating = --o->unasked > 0;
    if (o->integrating)
        begin(o, o->cycle.to_us);
    return true;
}

/* USB4000: cycles without a break; what the FIFO cannot take is lost and idle cycles follow. */
static bool step_idle(struct ocean *o, int64_t now_us) {
    if (now_us < o->cycle.to_us)
        return false;
    bool empty = !o->fifo_full && endpoints_empty(o);
    int64_t at_us = o->cycle.to_us;
    if (o->integrating) {
        o->integrating = empty;
        if (empty)
            into_fifo(o);
    } else {
        o->integrating = empty && o->requested && o->trigger == 0;
    }
    begin(o, at_us);
    int64_t cycle_us = o->cycle.to_us - at_us;
    if (!o->integrating && now_us > o->cycle.to_us && !(empty && o->requested && o->trigger == 0))
        begin(o, at_us + (now_us - at_us) / cycle_us * cycle_us);
    return true;
}

void ocean_advance(struct ocean *o, int64_t now_us) {
    while (three_frames(o) ? step_three(o, now_us) : step_idle(o, now_us))
        continue;
}

void ocean_request(struct ocean *o, int64_t now_us) {
    if (!o->requested)
        o->requested_us = now_us;
    o->requested = true;
}

int64_t ocean_next_us(const struct ocean *o) {
    if (three_frames(o))
        return o->integrating ? o->cycle.to_us + o->model->readout_us : INT64_MAX;
    return o->cycle.to_us;
}
