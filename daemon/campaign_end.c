/* How a campaign ends, in every case by the same road: axes first, then the lamp, then what is on its way, then the
 * sessions. Abort and interrupt have ordered the axes to stop before this is reached (campaign_queue.c). */
#include "daemon/campaign_private.h"

int campaign_park(struct campaign *c, struct err *e) {
    int result = campaign_owed_darks(c, c->step, e);
    if (result < 0)
        return result;
    campaign_set_state(c, CAMPAIGN_PARKING);
    if (c->instruments.spectrometer && campaign_set_lamp(c, false, e) < 0)
        return -e->code;
    return campaign_store_drain(c, &c->cancel, e);
}

void campaign_await_standstill(struct campaign *c) {
    int64_t until_us = clock_now_us(c->clock) + CAMPAIGN_STANDSTILL_US;
    if (bench_wait(c->bench, until_us, stage_standstill, &c->instruments.stage, &c->cancel) != BENCH_DONE)
        campaign_warn(c, "not every axis has been seen to stand still: look before you touch the stage");
}

/* Nothing here may keep the rest from being done: each step is tried, whatever became of the one before. */
static void make_safe(struct campaign *c) {
    struct err ignored = {0};
    stage_order_stop(&c->instruments.stage);
    if (c->instruments.spectrometer && c->setup.config->shutter == SHUTTER_LAMP_LINE) {
        int result = spectrometer_set_lamp(c->instruments.spectrometer, false, &c->cancel, &ignored);
        c->lamp = result == 0 ? 0 : -1;
    }
    campaign_await_standstill(c);
    err_clear(&ignored);
    if (c->instruments.spectrometer && spectrometer_drain(c->instruments.spectrometer, &ignored) < 0)
        instruments_close_spectrometer(&c->instruments);
}

static void close_sessions(struct campaign *c, enum campaign_state state) {
    struct err failed = {0};
    estimator_drop(c->estimator); /* an answer that still comes would have no session to go to */
    if (!c->writer)
        return;
    if (c->set.full && !c->store_failure.code)
        campaign_store_drain(c, &c->cancel, &failed);
    json_t *end = json_pack("{s:s}", "state", campaign_state_name(state));
    if (c->failure.code)
        json_object_set_new(end, "why", json_string(c->failure.text));
    if (c->warning[0])
        json_object_set_new(end, "warning", json_string(c->warning));
    campaign_store_event(c, "end", end);
    for (int i = 0; i < JOB_SAMPLES; i++) {
        if (c->measured[i].used)
            writer_close(c->writer, c->measured[i].file);
        c->measured[i].used = false; /* the polls of the wait that follows belong to no session */
    }
    bench_wait(c->bench, CLOCK_NEVER, writer_idle, c->writer, &c->cancel);
    if (!c->failure.code && writer_failure(c->writer, &c->failure) < 0)
        campaign_warn(c, "%s", c->failure.text);
    writer_stop(c->writer);
    c->writer = NULL;
}

/* A drive that lost its position meanwhile (an alarm revokes it) is not trusted by the next goniod either. */
static void record_positions(struct campaign *c) {
    for (int a = 0; a < STAGE_AXES; a++) {
        const struct axis *axis = c->instruments.stage.axis[a];
        struct axis_status s;
        struct err e = {0};
        if (!axis || axis_config(axis)->kind != AXIS_MOTOR)
            continue;
        axis_status(axis, &s);
        if (s.read_us != INT64_MIN && instruments_record_drive(&c->instruments, a, s.valid, false, &e) < 0)
            campaign_warn(c, "%s", e.text);
    }
}

void campaign_end(struct campaign *c, int result, const struct err *why) {
    enum campaign_state end = CAMPAIGN_DONE;
    json_t *sessions = campaign_session_names(c);
    atomic_store(&c->cancel.raised, false);
    if (campaign_must_end(c)) {
        end = c->want.interrupt ? CAMPAIGN_INTERRUPTED : CAMPAIGN_ABORTED;
        campaign_set_state(c, CAMPAIGN_ABORTING);
    } else if (result < 0) {
        end = CAMPAIGN_FAILED;
        c->failure = *why;
        campaign_warn(c, "%s", why->text);
        campaign_set_state(c, CAMPAIGN_PARKING);
    }
    if (end != CAMPAIGN_DONE)
        make_safe(c);
    record_positions(c);
    close_sessions(c, end);
    if (end == CAMPAIGN_DONE && c->failure.code)
        end = CAMPAIGN_FAILED;
    c->queue_waits = end != CAMPAIGN_DONE && c->n_queue > 0;
    estimator_forgive(c->estimator);
    campaign_job_ended(c, end, sessions);
    campaign_set_state(c, end);
}
