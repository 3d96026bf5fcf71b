/* What the campaign publishes: a snapshot of everything a person may ask for, with the stamp of each reading, and
 * events. Both only hand text to the desk; nobody who reads them can hold the campaign up. */
#include "daemon/campaign_private.h"

#include <stdarg.h>

#define SNAPSHOT_REAL_US (250 * US_PER_MS)
#define SNAPSHOT_VIRTUAL_US (5 * US_PER_S) /* a few milliseconds of a person's time */
#define NEVER_DONE_EARLY 0.999             /* 100 % is said by the state alone */

static json_t *stamp(int64_t us) {
    return us == INT64_MIN || us == CLOCK_NEVER ? json_null() : json_integer(us);
}

static const char *phase_name(enum axis_phase phase) {
    static const char *const name[] = {
        [AXIS_IDLE] = "idle",         [AXIS_MOVING] = "moving",
        [AXIS_SETTLING] = "settling", [AXIS_HOMING] = "homing",
        [AXIS_STOPPING] = "stopping", [AXIS_WAITING_PERSON] = "waiting for a person",
        [AXIS_FAULT] = "fault"};
    return name[phase];
}

static json_t *axis_json(const struct axis *axis) {
    struct axis_status s;
    axis_status(axis, &s);
    return json_pack("{s:f, s:f, s:s, s:o, s:b, s:b, s:b, s:i, s:s}", "deg", deg_from_udeg(s.position_udeg),
                     "target_deg", deg_from_udeg(s.target_udeg), "phase", phase_name(s.phase), "read_us",
                     stamp(s.read_us), "valid", s.valid, "connected", s.connected, "stop_confirmed",
                     s.stop_confirmed, "alarm", s.alarm, "alarm_text", s.alarm_text);
}

json_t *campaign_stage_json(const struct campaign *c) {
    json_t *all = json_object();
    for (int a = 0; a < STAGE_AXES; a++)
        if (c->instruments.stage.axis[a])
            json_object_set_new(all, stage_axis_name(a), axis_json(c->instruments.stage.axis[a]));
    return all;
}

static json_t *sessions_json(const struct campaign *c) {
    json_t *all = json_array();
    for (int i = 0; i < JOB_SAMPLES && c->job; i++) {
        const struct measured *m = &c->measured[i];
        if (!m->used)
            continue;
        json_t *one = json_pack("{s:s, s:s, s:i, s:i}", "name", m->name, "sample", c->job->sample[i].name,
                                "points", m->n_points, "provisional", m->n_provisional);
        if (m->has_estimate)
            json_object_set_new(one, "estimate", estimate_to_json(&m->estimate));
        json_array_append_new(all, one);
    }
    return all;
}

/* What is left is the plan's estimate, stretched by how it has fared so far. */
static json_t *progress_json(const struct campaign *c) {
    if (!c->plan || !c->done)
        return json_null();
    double total = fmax((double)c->plan->estimate_us, 1);
    double done = (double)c->estimate_done_us;
    double elapsed = (double)(clock_now_us(c->clock) - c->started_us);
    double stretch = done > 0.05 * total ? fmin(fmax(elapsed / done, 0.5), 3) : 1;
    double left = fmax(total - done, 0);
    double fraction = fmin(done / total, NEVER_DONE_EARLY);
    if (c->state == CAMPAIGN_DONE)
        fraction = 1;
    return json_pack("{s:f, s:i, s:i, s:i, s:f, s:f, s:f, s:f}", "fraction", fraction, "step", c->step,
                     "steps_done", c->n_done, "steps", c->plan->n_steps, "elapsed_s", elapsed / US_PER_S,
                     "left_s", left * stretch / US_PER_S, "left_low_s",
                     left * c->plan->estimate_low_us / total * fmin(stretch, 1) / US_PER_S, "left_high_s",
                     left * c->plan->estimate_high_us / total * fmax(stretch, 1) / US_PER_S);
}

static json_t *job_json(const struct campaign *c) {
    if (!c->current || !c->job)
        return json_null();
    const char *kind[] = {
        [STEP_WARM_UP] = "lamp warm-up", [STEP_HOLD] = "hold",        [STEP_REFERENCE] = "reference",
        [STEP_SAMPLE] = "sample",        [STEP_TRAP] = "stray light", [STEP_PARK] = "parking"};
    json_t *json = json_pack("{s:i, s:s, s:s}", "number", c->current->number, "name", c->job->name, "phase",
                             c->step >= 0 ? kind[c->plan->step[c->step].kind] : "preparing");
    if (c->step >= 0)
        json_object_set_new(json, "text", json_string(c->plan->step[c->step].text));
    return json;
}

static json_t *queue_json(const struct campaign *c) {
    json_t *all = json_array();
    for (int i = 0; i < c->n_queue; i++)
        json_array_append_new(all, json_pack("{s:i, s:s, s:s}", "number", c->queue[i]->number, "name",
                                             c->queue[i]->name, "resumes", c->queue[i]->session));
    return all;
}

static json_t *spectrometer_json(const struct campaign *c) {
    return json_pack("{s:b, s:s, s:f, s:f, s:o, s:i}", "open", c->instruments.spectrometer != NULL, "model",
                     c->instruments.model->name, "exposure_ms", c->last_exposure_us / (double)US_PER_MS,
                     "peak", c->last_peak, "read_us", stamp(c->last_set_us ? c->last_set_us : INT64_MIN),
                     "lamp", c->lamp);
}

static json_t *hold_json(const struct campaign *c) {
    if (!c->hold.active)
        return json_null();
    return json_pack("{s:s, s:b, s:I}", "text", c->hold.text, "planned", c->hold.planned, "since_us",
                     (json_int_t)c->hold.since_us);
}

void campaign_publish(struct campaign *c) {
    json_t *all = json_pack(
        "{s:s, s:I, s:I, s:b, s:o, s:o, s:o, s:o, s:o, s:o, s:o, s:b, s:s, s:s}", "state",
        campaign_state_name(c->state), "now_us", (json_int_t)clock_now_us(c->clock), "utc_us",
        (json_int_t)clock_utc_us(c->clock), "simulated", c->setup.wiring->simulated, "job", job_json(c),
        "progress", progress_json(c), "hold", hold_json(c), "sessions", sessions_json(c), "stage",
        campaign_stage_json(c), "spectrometer", spectrometer_json(c), "queue", queue_json(c), "queue_waits",
        c->queue_waits, "warning", c->warning, "failure", c->failure.text);
    c->published_us = clock_now_us(c->clock);
    atomic_store(&c->utc_s, clock_utc_us(c->clock) / US_PER_S);
    desk_publish(c->setup.desk, json_dumps(all, JSON_COMPACT));
    json_decref(all);
}

void campaign_event(struct campaign *c, const char *kind, bool coalesce, json_t *json) {
    json_object_set_new(json, "at_us", json_integer(clock_now_us(c->clock)));
    desk_event_post(c->setup.desk, kind, coalesce, json_dumps(json, JSON_COMPACT));
    json_decref(json);
}

void campaign_warn(struct campaign *c, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(c->warning, sizeof c->warning, format, arguments);
    va_end(arguments);
    json_t *event = json_pack("{s:s}", "text", c->warning);
    campaign_store_event(c, "warning", json_incref(event));
    campaign_notify(c, "warning", event);
    campaign_event(c, "warning", false, event);
}

/* ---- the bench service ---- */

static struct campaign *of_stamp(void *self) {
    return (struct campaign *)((char *)self - offsetof(struct campaign, published_us));
}

static int64_t due_us(void *self) {
    const struct campaign *c = of_stamp(self);
    return c->published_us + (c->clock->is_virtual ? SNAPSHOT_VIRTUAL_US : SNAPSHOT_REAL_US);
}

static void run(void *self) {
    struct campaign *c = of_stamp(self);
    campaign_notify_reap();
    campaign_publish(c);
}

int campaign_status_start(struct campaign *c) {
    struct bench_service service = {.name = "status", .self = &c->published_us, .due_us = due_us, .run = run};
    return bench_add(c->bench, &service);
}
