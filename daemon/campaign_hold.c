/* Where a campaign waits for a person or a condition: one way in and one way out for pause and hold. The shutter is
 * shut, torque stays on, the axes are polled; virtual time stands still while a person is awaited. */
#include "daemon/campaign_private.h"

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
    shut(c);
    int result = campaign_store_drain(c, &c->cancel, e);
    if (result < 0)
        return result;
    bool still = c->want.pause || c->want.pause_now;
    c->want.pause = c->want.pause_now = c->want.go_on = false;
    if (!still)
        return 0; /* resumed before it had begun */
    int64_t since_us = clock_now_us(c->clock);
    campaign_set_state(c, CAMPAIGN_PAUSED);
    result = wait_for_go(c, true, CLOCK_NEVER, e);
    if (result < 0)
        return result;
    campaign_set_state(c, c->state_before_pause);
    return after_wait(c, since_us, "pause", e);
}

#define TEXT_OF(number) #number
#define TEXT_OF_VALUE(macro) TEXT_OF(macro)
#define RETRY_S TEXT_OF_VALUE(CAMPAIGN_RETRY_S)

/* For a person who comes to a campaign that waits: what it does by itself, and what it waits for. */
static const char *what_follows(bool planned, bool person) {
    if (planned)
        return "Then: gonioctl continue";
    if (person)
        return "When that is put right: gonioctl continue, which resets alarms, homes an axis that has lost "
               "its position, and takes the step again";
    return "goniod tries again every " RETRY_S " s and goes on by itself when that works; "
           "gonioctl continue tries at once";
}

static void begin_hold(struct campaign *c, const char *text, bool planned, bool person) {
    bool lasts =
        !planned && !c->hold.planned && !person && !c->hold.person && c->hold.since_us > c->last_done_us;
    c->hold = (struct campaign_hold){.active = true,
                                     .planned = planned,
                                     .person = person,
                                     .next = what_follows(planned, person),
                                     .since_us = clock_now_us(c->clock)};
    snprintf(c->hold.text, sizeof c->hold.text, "%s", text);
    campaign_set_state(c, CAMPAIGN_HELD);
    if (lasts)
        return; /* the same condition, tried again: said once */
    json_t *event = json_pack("{s:s, s:b}", "text", text, "planned", planned);
    campaign_store_event(c, "hold", json_incref(event));
    json_object_set_new(event, "next", json_string(c->hold.next));
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
    begin_hold(c, text, planned, retry_us == 0);
    result = wait_for_go(c, retry_us == 0, retry_us ? since_us + retry_us : CLOCK_NEVER, e);
    c->hold.active = false;
    if (result < 0)
        return result;
    campaign_set_state(c, before);
    return planned ? 0 : after_wait(c, c->last_done_us < since_us ? c->last_done_us : since_us, "hold", e);
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

/* A holder without a motor is one place. */
static int place_of(const struct campaign *c, int surface) {
    const struct config_axis *holder = &c->setup.config->holder;
    const char *name =
        surface == MOUNTED_REFERENCE ? c->job->reference.holder : c->job->sample[surface].holder;
    const struct config_position *position = config_position_find(holder, name);
    return holder->kind == CONFIG_AXIS_MOTOR && position ? (int)(position - holder->position) : 0;
}

static bool shows_a_surface(const struct step *s) {
    return s->kind == STEP_SAMPLE || s->kind == STEP_REFERENCE || s->kind == STEP_OVERLAP ||
           (s->kind == STEP_HOLD && s->mounts);
}

static int surface_of(const struct step *s) {
    return s->sample < 0 ? MOUNTED_REFERENCE : s->sample;
}

/* What the plan reads at a place without having asked for it stands there from the start. Whoever resumes a session
 * of which samples were changed may have found anything in the holder. */
void campaign_mounted_at_start(struct campaign *c) {
    bool seen[CONFIG_POSITIONS] = {false}, changes = false;
    for (int p = 0; p < CONFIG_POSITIONS; p++)
        c->mounted[p] = MOUNTED_UNKNOWN;
    for (int k = 0; k < c->plan->n_steps; k++)
        changes |= c->plan->step[k].mounts;
    if (changes && *c->current->session)
        return;
    for (int k = 0; k < c->plan->n_steps; k++) {
        const struct step *s = &c->plan->step[k];
        int place = shows_a_surface(s) ? place_of(c, surface_of(s)) : -1;
        if (place < 0 || seen[place])
            continue;
        seen[place] = true;
        c->mounted[place] = s->kind == STEP_HOLD ? MOUNTED_UNKNOWN : surface_of(s);
    }
}

static int say_mount(const struct campaign *c, int surface, char *text, size_t size) {
    const struct config_axis *holder = &c->setup.config->holder;
    char name[64] = "the reference diffuser";
    if (surface != MOUNTED_REFERENCE)
        snprintf(name, sizeof name, "sample %s", c->job->sample[surface].name);
    if (holder->kind == CONFIG_AXIS_MOTOR)
        return snprintf(text, size, "mount %s at holder position %s", name,
                        holder->position[place_of(c, surface)].name);
    return snprintf(text, size, "put %s into the holder", name);
}

static struct axis *axis_to_turn(const struct campaign *c, const struct step *s, int which) {
    struct axis *axis = c->instruments.stage.axis[which];
    struct axis_status status;
    if (!s->target.used[which] || !axis || axis_config(axis)->kind != AXIS_MANUAL)
        return NULL;
    axis_status(axis, &status);
    return status.valid && status.position_udeg == s->target.udeg[which] ? NULL : axis;
}

/* In the words of the plan's holds; also for a reading that is taken out of its order. */
static bool say_what_is_missing(const struct campaign *c, const struct step *s, char *text, size_t size) {
    size_t n = 0;
    text[0] = 0;
    if (shows_a_surface(s) && c->mounted[place_of(c, surface_of(s))] != surface_of(s))
        n += say_mount(c, surface_of(s), text, size);
    for (int a = 0; a < STAGE_AXES; a++)
        if (axis_to_turn(c, s, a))
            n += snprintf(text + n, size - n, "%sturn the %s axis to %g deg", n ? "; " : "",
                          stage_axis_name(a), deg_from_udeg(s->target.udeg[a]));
    return n > 0;
}

static int confirm_turned(struct campaign *c, const struct step *s, struct err *e) {
    const struct wiring *w = c->setup.wiring;
    int result = 0;
    for (int a = 0; a < STAGE_AXES && result == 0; a++) {
        struct axis *axis = axis_to_turn(c, s, a);
        if (!axis)
            continue;
        result = axis_begin_move(axis, s->target.udeg[a], e);
        if (result == 0)
            axis_confirm(axis, s->target.udeg[a]);
        if (result == 0 && w->turned)
            result = w->turned(w->self, stage_axis_name(a), deg_from_udeg(s->target.udeg[a]), e);
    }
    return result;
}

static const char *position_of(const struct campaign *c, const struct step *s) {
    if (s->kind == STEP_SAMPLE)
        return c->job->sample[s->sample].holder;
    return s->kind == STEP_TRAP ? "trap" : c->job->reference.holder;
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
    char text[256];
    int result = 0;
    if (say_what_is_missing(c, s, text, sizeof text))
        result = campaign_hold(c, text, true, 0, e);
    if (result == 0)
        result = confirm_turned(c, s, e);
    if (result == 0 && shows_a_surface(s))
        c->mounted[place_of(c, surface_of(s))] = surface_of(s);
    return result == 0 ? done_by_hand(c, s, e) : result;
}
