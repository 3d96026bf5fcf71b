/* Where a campaign waits for a person or a condition: one way in and one way out for pause and hold. The shutter is
 * shut, torque stays on, the axes are polled; virtual time stands still while a person is awaited. */
#include "daemon/campaign_private.h"

#include <string.h>

static bool may_go_on(void *arg) {
    const struct campaign *c = arg;
    return c->want.go_on || campaign_must_end(c);
}

/* A shutter that cannot be shut because its device is gone must not keep the campaign from waiting for it. */
static void shut(struct campaign *c) {
    struct err ignored = {0};
    if (c->instruments.spectrometer && c->setup.config->shutter == SHUTTER_LAMP_LINE)
        campaign_set_lamp(c, false, &ignored);
}

static int wait_for_go(struct campaign *c, bool person, int64_t until_us, struct err *e) {
    c->bench->frozen = c->clock->is_virtual && person;
    int result = bench_wait(c->bench, until_us, may_go_on, c, &c->cancel);
    c->bench->frozen = false;
    c->want.go_on = false;
    if (result < 0 || campaign_must_end(c))
        return err_set(e, ERR_CANCELLED, "ended while it was waiting");
    return 0;
}

/* Lamp drift is known between readings no further apart than a bracket: longer ones end it (measurement.md 3). */
static int after_wait(struct campaign *c, int64_t since_us, const char *why, struct err *e) {
    if (clock_now_us(c->clock) - since_us <= (int64_t)(c->job->reference.bracket_min * US_PER_MIN))
        return 0;
    return campaign_end_bracket(c, why, e);
}

int campaign_pause(struct campaign *c, struct err *e) {
    struct err ignored = {0};
    atomic_store(&c->cancel.raised, false);
    if (c->want.pause_now) {
        campaign_await_standstill(c);
        if (c->instruments.spectrometer)
            spectrometer_drain(c->instruments.spectrometer, &ignored);
    }
    c->want.pause = c->want.pause_now = c->want.go_on = false;
    shut(c);
    int result = campaign_store_drain(c, &c->cancel, e);
    if (result < 0)
        return result;
    int64_t since_us = clock_now_us(c->clock);
    campaign_set_state(c, CAMPAIGN_PAUSED);
    result = wait_for_go(c, true, CLOCK_NEVER, e);
    if (result < 0)
        return result;
    campaign_set_state(c, c->state_before_pause);
    return after_wait(c, since_us, "pause", e);
}

static void begin_hold(struct campaign *c, const char *text, bool planned) {
    bool same = !strcmp(c->hold.text, text) && !planned;
    c->hold = (struct campaign_hold){.active = true, .planned = planned, .since_us = campaign_now_us(c)};
    snprintf(c->hold.text, sizeof c->hold.text, "%s", text);
    campaign_set_state(c, CAMPAIGN_HELD);
    if (same)
        return; /* the condition still lasts: said once */
    json_t *event = json_pack("{s:s, s:b}", "text", text, "planned", planned);
    campaign_store_event(c, "hold", json_incref(event));
    campaign_notify(c, "hold", event);
    campaign_event(c, "hold", false, event);
}

int campaign_hold(struct campaign *c, const char *text, bool planned, int64_t retry_us, struct err *e) {
    enum campaign_state before = c->state;
    shut(c);
    int result = campaign_store_drain(c, &c->cancel, e);
    if (result < 0)
        return result;
    int64_t since_us = clock_now_us(c->clock);
    c->want.go_on = false;
    begin_hold(c, text, planned);
    result = wait_for_go(c, retry_us == 0, retry_us ? since_us + retry_us : CLOCK_NEVER, e);
    c->hold.active = false;
    if (result < 0)
        return result;
    campaign_set_state(c, before);
    return planned ? 0 : after_wait(c, since_us, "hold", e);
}

/* ---- what a person has to do before a reading ---- */

/* A job that waited would otherwise measure what the one before has left in the holder. The simulated person changes
 * samples by itself. */
int campaign_hold_for_samples(struct campaign *c, struct err *e) {
    char text[256];
    if (!c->current->waited || c->setup.wiring->simulated)
        return 0;
    snprintf(text, sizeof text, "Mount the samples of job %s: %s at %s%s", c->job->name,
             c->job->sample[0].name, c->job->sample[0].holder,
             c->job->n_samples > 1 ? ", and the others as its plan says" : "");
    return campaign_hold(c, text, true, 0, e);
}

static bool turns_an_axis(const struct step *s) {
    return s->target.used[STAGE_SAMPLE];
}

static int last_mounting(const struct campaign *c, int k) {
    for (int h = k; h >= 0; h--)
        if (c->plan->step[h].kind == STEP_HOLD && !turns_an_axis(&c->plan->step[h]))
            return h;
    return -1;
}

static int mount_for_step(struct campaign *c, int k, struct err *e) {
    int wanted = last_mounting(c, k);
    if (wanted == c->mounted)
        return 0;
    int result = campaign_hold(
        c, wanted >= 0 ? c->plan->step[wanted].text : "Mount everything as at the start", true, 0, e);
    if (result == 0)
        c->mounted = wanted;
    return result;
}

static int turn_by_hand(struct campaign *c, enum stage_axis which, int32_t target_udeg, struct err *e) {
    struct axis *axis = c->instruments.stage.axis[which];
    struct axis_status s;
    char text[120];
    axis_status(axis, &s);
    if (s.valid && s.position_udeg == target_udeg)
        return 0;
    snprintf(text, sizeof text, "Turn the %s axis to %.3f deg", stage_axis_name(which),
             deg_from_udeg(target_udeg));
    int result = campaign_hold(c, text, true, 0, e);
    if (result == 0)
        result = axis_begin_move(axis, target_udeg, e);
    if (result < 0)
        return result;
    axis_confirm(axis, target_udeg);
    const struct wiring *w = c->setup.wiring;
    return w->turned ? w->turned(w->self, stage_axis_name(which), deg_from_udeg(target_udeg), e) : 0;
}

static const char *position_of(const struct campaign *c, const struct step *s) {
    if (s->kind == STEP_SAMPLE)
        return c->job->sample[s->sample].holder;
    return s->kind == STEP_REFERENCE ? c->job->reference.holder : "trap";
}

/* The person has done what the holds asked for: a simulated bench does it now. */
static int done_by_hand(struct campaign *c, const struct step *s, struct err *e) {
    const struct wiring *w = c->setup.wiring;
    int result = s->kind == STEP_SAMPLE && w->mount ? w->mount(w->self, &c->job->sample[s->sample], e) : 0;
    if (result == 0 && w->in_beam && c->setup.config->holder.kind != CONFIG_AXIS_MOTOR)
        result = w->in_beam(w->self, position_of(c, s), e);
    return result;
}

int campaign_hold_for_step(struct campaign *c, int k, struct err *e) {
    const struct step *s = &c->plan->step[k];
    int result = mount_for_step(c, k, e);
    for (int a = 0; a < STAGE_AXES && result == 0; a++) {
        const struct axis *axis = c->instruments.stage.axis[a];
        if (s->target.used[a] && axis && axis_config(axis)->kind == AXIS_MANUAL)
            result = turn_by_hand(c, a, s->target.udeg[a], e);
    }
    return result == 0 ? done_by_hand(c, s, e) : result;
}
