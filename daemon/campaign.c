#include "daemon/campaign_private.h"

#include <stdlib.h>
#include <string.h>

/* A virtual clock must not run while nothing is to be done, or while a person is awaited. */
static bool has_work(void *arg) {
    const struct campaign *c = arg;
    return c->want.interrupt || c->manual_pending || (c->n_queue > 0 && !c->queue_waits);
}

static void await_work(struct campaign *c) {
    c->bench->frozen = c->clock->is_virtual;
    bench_wait(c->bench, CLOCK_NEVER, has_work, c, NULL);
    c->bench->frozen = false;
    atomic_store(&c->cancel.raised, false);
}

int campaign_serve(struct campaign *c) {
    while (!c->want.interrupt) {
        await_work(c);
        if (c->manual_pending)
            campaign_manual(c);
        else if (!c->want.interrupt && c->n_queue > 0 && !c->queue_waits)
            campaign_run(c, campaign_queue_next(c));
    }
    if (c->state != CAMPAIGN_INTERRUPTED)
        campaign_set_state(c, CAMPAIGN_INTERRUPTED);
    campaign_publish(c);
    return 0;
}

/* ---- one step ---- */

/* Manual axes that already stand where a person has turned them are no part of a move. */
static struct stage_target motor_target(const struct campaign *c, const struct stage_target *wanted) {
    struct stage_target t = *wanted;
    for (int a = 0; a < STAGE_AXES; a++) {
        struct axis *axis = c->instruments.stage.axis[a];
        struct axis_status s;
        if (!t.used[a] || !axis || axis_config(axis)->kind != AXIS_MANUAL)
            continue;
        axis_status(axis, &s);
        if (s.valid && s.position_udeg == t.udeg[a])
            t.used[a] = false;
    }
    return t;
}

/* From where the stage stands, and not from where the plan left it: readings are also taken out of its order. */
int campaign_move(struct campaign *c, const struct step *step, struct err *e) {
    struct stage_target via[PLAN_VIA];
    struct stage_reading at;
    struct plan_devices devices = {0};
    instruments_plan_devices(&c->instruments, &devices);
    stage_read(&c->instruments.stage, &at);
    int stops = plan_way(c->setup.config, &devices, at.udeg, &step->target, via);
    if (stops < 0)
        return err_set(
            e, ERR_DEVICE,
            "no way round the keep-out zones leads from where the stage stands (source %.2f, sample %.2f "
            "deg) to its next reading: move it to a free place by hand",
            deg_from_udeg(at.udeg[STAGE_SOURCE]), deg_from_udeg(at.udeg[STAGE_SAMPLE]));
    for (int v = 0; v <= stops; v++) {
        struct stage_target t = motor_target(c, v < stops ? &via[v] : &step->target);
        int result = stage_move(&c->instruments.stage, &t, &c->cancel, &at, e);
        if (result < 0)
            return result;
    }
    return 0;
}

static int do_step(struct campaign *c, int k, struct err *e) {
    switch (c->plan->step[k].kind) {
    case STEP_WARM_UP:
        return campaign_warm_up(c, e);
    case STEP_HOLD:
        return 0; /* asked for by the first reading that needs it, also when that is taken again */
    case STEP_PARK:
        return campaign_park(c, e);
    default:
        return campaign_read_step(c, k, e);
    }
}

/* ---- when a step fails ---- */

static bool passes_by_itself(int code) {
    return code == -ERR_TIMEOUT || code == -ERR_LINK || code == -ERR_BUSY || code == -ERR_IO;
}

/* Also a position that is not known any more, or a way that is not free: no reason to lose a night. */
static bool needs_a_person(int code) {
    return code == -ERR_DEVICE || code == -ERR_PERMISSION || code == -ERR_RANGE || code == -ERR_STATE;
}

/* Nobody but a pause cancels what does not have to end. */
static int give_way(struct campaign *c, struct err *why) {
    err_clear(why);
    atomic_store(&c->cancel.raised, false);
    return c->want.pause_now ? campaign_pause(c, why) : 0;
}

/* The fate of a failed step: 0 = do it again (after a pause or hold, if need be), negative = the campaign ends. */
static int decide(struct campaign *c, int code, int *repeats, struct err *why) {
    struct err ignored = {0};
    if (campaign_must_end(c))
        return -ERR_CANCELLED;
    if (writer_failure(c->writer, NULL) < 0) {
        err_clear(why);
        return writer_failure(c->writer, why);
    }
    if (code == -ERR_CANCELLED)
        return give_way(c, why);
    if (c->store_failure.code || (!passes_by_itself(code) && !needs_a_person(code)))
        return code;
    campaign_store_event(c, "repeat", json_pack("{s:i, s:s}", "step", c->step, "why", why->text));
    bool opened_anew = c->spectrometer_suspect; /* that may be all it needs, whatever it said */
    if (c->spectrometer_suspect) {
        instruments_close_spectrometer(&c->instruments);
        c->lamp = c->setup.config->shutter == SHUTTER_LAMP_LINE ? -1 : c->lamp;
    }
    c->spectrometer_suspect = false;
    if ((passes_by_itself(code) || opened_anew) && ++*repeats <= CAMPAIGN_REPEATS)
        return 0;
    int result = campaign_hold(c, why->text, false, passes_by_itself(code) ? CAMPAIGN_RETRY_S * US_PER_S : 0,
                               &ignored);
    if (result == 0 &&
        needs_a_person(code)) { /* "continue" is that person's word; the step says what came of it */
        stage_reset_alarms(&c->instruments.stage, &c->cancel, &ignored);
        campaign_home_where_needed(c, &ignored);
    }
    return result;
}

static int run_steps(struct campaign *c, struct err *e) {
    int repeats = 0;
    for (int k; (k = campaign_next_step(c)) >= 0;) {
        struct err failed = {0};
        c->step = k;
        c->step_since_us = clock_now_us(c->clock);
        int result = c->want.pause ? campaign_pause(c, &failed) : 0;
        if (result == 0 && !campaign_must_end(c))
            result = do_step(c, k, &failed);
        if (result == 0 && campaign_must_end(c))
            result = -ERR_CANCELLED;
        if (result == 0) {
            campaign_mark_done(c, k);
            c->last_done_us = clock_now_us(c->clock);
            repeats = 0;
            continue;
        }
        do
            result = decide(c, result, &repeats, &failed);
        while (result == -ERR_CANCELLED && !campaign_must_end(c));
        if (result < 0) {
            *e = failed;
            return result;
        }
    }
    return 0;
}

/* ---- a run ---- */

/* A pause may cut preparing short; then it begins again. */
static int prepare(struct campaign *c, struct err *e) {
    int result = campaign_prepare(c, e);
    while (result == -ERR_CANCELLED && !campaign_must_end(c)) {
        result = give_way(c, e);
        if (result == 0)
            result = campaign_prepare(c, e);
    }
    return result;
}

static int allocate_run(struct campaign *c, struct err *e) {
    int n = c->plan->n_steps;
    c->n_frames =
        c->job->exposure.average > CAMPAIGN_OVERLAP_SCANS ? c->job->exposure.average : CAMPAIGN_OVERLAP_SCANS;
    c->done = calloc(n, sizeof *c->done);
    c->attempt = calloc(n, sizeof *c->attempt);
    c->dark_attempt = calloc(n, sizeof *c->dark_attempt);
    c->frames = calloc(c->n_frames, sizeof *c->frames);
    if (!c->done || !c->attempt || !c->dark_attempt || !c->frames)
        return err_set(e, ERR_NOMEM, "no memory for a campaign of %d steps", n);
    return 0;
}

static void forget_run(struct campaign *c) {
    for (int i = 0; i < JOB_SAMPLES; i++) {
        reducer_free(c->measured[i].reducer);
        fit_points_free(c->measured[i].points);
    }
    memset(c->measured, 0, sizeof c->measured);
    memset(c->light, 0, sizeof c->light);
    memset(&c->want, 0, offsetof(struct campaign_requests, interrupt));
    free(c->done);
    free(c->attempt);
    free(c->dark_attempt);
    free(c->frames);
    c->done = NULL;
    c->attempt = c->dark_attempt = NULL;
    c->frames = NULL;
    c->shutter_us = INT64_MIN;
    c->n_darks = c->n_done = c->bracket = c->plan_bracket = c->last_bracket = 0;
    c->estimate_done_us = c->offset_us = c->ticket = 0;
    c->step = -1;
    c->set.full = c->fit_final = c->fit_warned = false;
    err_clear(&c->store_failure);
    c->job = NULL;
    c->plan = NULL;
    campaign_job_free(c->current);
    c->current = NULL;
}

void campaign_run(struct campaign *c, struct campaign_job *job) {
    struct err e = {0};
    c->current = job;
    err_clear(&c->failure);
    c->warning[0] = 0;
    campaign_set_state(c, CAMPAIGN_PREPARING);
    int result = writer_start(&c->writer, c->bench, &e);
    c->job = &job->job;
    c->plan = &job->plan;
    c->started_us = c->last_done_us = clock_now_us(c->clock);
    campaign_mounted_at_start(c);
    if (result == 0)
        result = allocate_run(c, &e);
    if (result == 0)
        result = prepare(c, &e);
    if (result == 0)
        result = campaign_hold_for_samples(c, &e);
    if (result == 0)
        result = run_steps(c, &e);
    if (result == 0)
        result = campaign_fit_final(c, &e);
    campaign_end(c, result, &e);
    forget_run(c);
}

/* ---- the campaign as a whole ---- */

int campaign_new(struct campaign **campaign, const struct campaign_setup *setup, struct err_list *errors) {
    struct err e = {0};
    struct campaign *c = calloc(1, sizeof *c);
    if (!c) {
        err_set(&e, ERR_NOMEM, "no memory for the campaign");
        err_list_add(errors, &e);
        return -ERR_NOMEM;
    }
    c->setup = *setup;
    c->bench = setup->bench;
    c->clock = setup->bench->clock;
    c->step = -1;
    c->lamp_since_us = c->shutter_us = INT64_MIN;
    c->lamp = c->commission_axis = -1;
    c->last_temperature_c = NAN;
    int result =
        instruments_load(&c->instruments, c->bench, setup->config, setup->wiring, setup->state_dir, errors);
    c->instruments.seen = campaign_seen_exchange;
    c->instruments.seen_arg = c;
    if (result == 0) {
        result = estimator_new(&c->estimator, c->bench, setup->goniofit, 0, &e);
        if (result == 0)
            result = campaign_queue_start(c, &e);
        if (result == 0)
            result = campaign_store_start(c);
        if (result == 0)
            result = campaign_status_start(c);
        if (result < 0)
            err_list_add(errors, &e);
    }
    if (result < 0) {
        campaign_free(c);
        return result;
    }
    campaign_publish(c);
    *campaign = c;
    return 0;
}

void campaign_free(struct campaign *c) {
    if (!c)
        return;
    while (c->n_queue > 0)
        campaign_job_free(campaign_queue_next(c));
    estimator_free(c->estimator);
    instruments_free(&c->instruments);
    /* Services are told apart by their `self`: each part of the campaign registered its own address. */
    bench_remove(c->bench, c);
    bench_remove(c->bench, &c->set);
    bench_remove(c->bench, &c->published_us);
    for (int i = 0; i < c->n_ended; i++)
        json_decref(c->ended[i]);
    free(c->set.counts);
    free(c);
}

enum campaign_state campaign_state(const struct campaign *c) {
    return c->state;
}

int campaign_steps_done(const struct campaign *c) {
    return c->n_done;
}

int campaign_jobs_ended(const struct campaign *c) {
    return c->all_ended;
}
