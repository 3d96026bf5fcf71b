/* What the campaign publishes: a snapshot of everything a person may ask for, with the stamp of each reading, and
 * events. Both only hand text to the desk; nobody who reads them can hold the campaign up. */
#include "daemon/campaign_private.h"

#include <stdarg.h>
#include <string.h>

#define SNAPSHOT_REAL_US (250 * US_PER_MS)
#define SNAPSHOT_VIRTUAL_US (20 * US_PER_S) /* some 20 milliseconds of a person's time */
#define NEVER_DONE_EARLY 0.999              /* 100 % is said by the state alone */

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

static json_t *axis_json(const struct axis *axis, int64_t now_us) {
    struct axis_status s;
    axis_status(axis, &s);
    json_t *age = s.read_us == INT64_MIN ? json_null() : json_real((now_us - s.read_us) / (double)US_PER_MS);
    return json_pack("{s:f, s:f, s:s, s:o, s:o, s:b, s:b, s:b, s:i, s:s}", "position_deg",
                     deg_from_udeg(s.position_udeg), "target_deg", deg_from_udeg(s.target_udeg), "phase",
                     phase_name(s.phase), "read_us", stamp(s.read_us), "age_ms", age, "valid", s.valid,
                     "connected", s.connected, "stop_confirmed", s.stop_confirmed, "alarm", s.alarm,
                     "alarm_text", s.alarm_text);
}

json_t *campaign_stage_json(const struct campaign *c) {
    json_t *all = json_object();
    for (int a = 0; a < STAGE_AXES; a++)
        if (c->instruments.stage.axis[a])
            json_object_set_new(all, stage_axis_name(a),
                                axis_json(c->instruments.stage.axis[a], clock_now_us(c->clock)));
    return all;
}

json_t *campaign_session_names(const struct campaign *c) {
    json_t *all = json_array();
    for (int i = 0; i < JOB_SAMPLES; i++)
        if (c->measured[i].used)
            json_array_append_new(all, json_string(c->measured[i].name));
    return all;
}

static json_t *estimates_json(const struct campaign *c) {
    json_t *all = json_array();
    for (int i = 0; i < JOB_SAMPLES; i++)
        if (c->measured[i].used && c->measured[i].has_estimate)
            json_array_append_new(all, json_pack("{s:s, s:o}", "session", c->measured[i].name, "estimate",
                                                 estimate_to_json(&c->measured[i].estimate)));
    return all;
}

static json_t *points_json(const struct campaign *c) {
    int done = 0, provisional = 0;
    if (!c->plan)
        return json_null();
    for (int i = 0; i < JOB_SAMPLES; i++) {
        done += c->measured[i].n_points;
        provisional += c->measured[i].n_provisional;
    }
    return json_pack("{s:i, s:i, s:i}", "done", done, "total", c->plan->n_points, "provisional", provisional);
}

/* Of the step at hand, at most what the plan allows for it: a warm-up or a test of linearity takes many minutes. */
static int64_t under_way_us(const struct campaign *c) {
    if (c->step < 0 || c->done[c->step] || campaign_state_is_rest(c->state))
        return 0;
    int64_t since_us = clock_now_us(c->clock) - c->step_since_us;
    return since_us < c->plan->step[c->step].estimate_us ? since_us : c->plan->step[c->step].estimate_us;
}

/* What is left is the plan's estimate, stretched by how it has fared so far. */
static void set_progress(const struct campaign *c, json_t *all) {
    if (!c->plan || !c->done)
        return;
    double total = fmax((double)c->plan->estimate_us, 1),
           done = (double)(c->estimate_done_us + under_way_us(c));
    double elapsed = (double)(clock_now_us(c->clock) - c->started_us);
    double stretch = done > 0.05 * total ? fmin(fmax(elapsed / done, 0.5), 3) : 1;
    double left_s = fmax(total - done, 0) / US_PER_S;
    double fraction = c->state == CAMPAIGN_DONE ? 1 : fmin(done / total, NEVER_DONE_EARLY);
    json_object_set_new(all, "progress",
                        json_pack("{s:f, s:i, s:i, s:i, s:f}", "fraction", fraction, "step", c->step,
                                  "steps_done", c->n_done, "steps", c->plan->n_steps, "elapsed_s",
                                  elapsed / US_PER_S));
    json_object_set_new(all, "left_s", json_real(left_s * stretch));
    json_object_set_new(all, "left_low_s",
                        json_real(left_s * fmin(stretch, c->plan->estimate_low_us / total)));
    json_object_set_new(all, "left_high_s",
                        json_real(left_s * fmax(stretch, c->plan->estimate_high_us / total)));
}

static json_t *job_json(const struct campaign *c) {
    const json_t *last = c->n_ended ? c->ended[c->n_ended - 1] : NULL;
    if (!c->current && !last)
        return json_null();
    if (!c->current)
        return json_pack("{s:O, s:O}", "number", json_object_get(last, "number"), "name",
                         json_object_get(last, "name"));
    return json_pack("{s:i, s:s}", "number", c->current->number, "name", c->current->name);
}

static json_t *queue_json(const struct campaign *c) {
    json_t *all = json_array();
    for (int i = 0; i < c->n_queue; i++)
        json_array_append_new(all, json_pack("{s:i, s:s, s:s}", "number", c->queue[i]->number, "name",
                                             c->queue[i]->name, "resumes", c->queue[i]->session));
    return all;
}

static json_t *ended_json(const struct campaign *c) {
    json_t *all = json_array();
    for (int i = 0; i < c->n_ended; i++)
        json_array_append(all, c->ended[i]);
    return all;
}

static json_t *spectrometer_json(const struct campaign *c) {
    const struct spectrometer *s = c->instruments.spectrometer;
    int64_t age_us = clock_now_us(c->clock) - c->last_set_us;
    json_t *json =
        json_pack("{s:b, s:s, s:s, s:f, s:f}", "open", s != NULL, "model", c->instruments.model->name,
                  "serial", s ? spectrometer_calibration(s)->serial : "", "exposure_ms",
                  c->last_exposure_us / (double)US_PER_MS, "peak", c->last_peak);
    if (c->last_set_us) {
        json_object_set_new(json, "read_us", json_integer(c->last_set_us));
        json_object_set_new(json, "age_ms", json_real((double)(age_us / US_PER_MS)));
    }
    if (isfinite(c->last_temperature_c))
        json_object_set_new(json, "temperature_c", json_real(c->last_temperature_c));
    return json;
}

static json_t *snapshot_json(const struct campaign *c) {
    bool rests = campaign_state_is_rest(c->state);
    const char *phase = c->plan && c->step >= 0 && !rests ? step_kind_name(c->plan->step[c->step].kind) : "";
    json_t *all =
        json_pack("{s:s, s:I, s:I, s:b, s:o, s:s, s:s, s:s, s:s, s:s}", "state",
                  campaign_state_name(c->state), "now_us", (json_int_t)clock_now_us(c->clock), "utc_us",
                  (json_int_t)clock_utc_us(c->clock), "simulated", c->setup.wiring->simulated, "job",
                  job_json(c), "phase", phase, "hold", c->hold.active ? c->hold.text : "", "hold_next",
                  c->hold.active ? c->hold.next : "", "warning", c->warning, "why", c->failure.text);
    set_progress(c, all);
    json_object_set_new(all, "points", points_json(c));
    json_object_set_new(all, "sessions", campaign_session_names(c));
    json_object_set_new(all, "estimates", estimates_json(c));
    json_object_set_new(all, "axes", campaign_stage_json(c));
    json_object_set_new(all, "spectrometer", spectrometer_json(c));
    json_object_set_new(all, "lamp", c->lamp < 0 ? json_null() : json_boolean(c->lamp));
    json_object_set_new(all, "queue", queue_json(c));
    json_object_set_new(all, "queue_waits", json_boolean(c->queue_waits));
    json_object_set_new(all, "jobs_ended", ended_json(c));
    return all;
}

void campaign_publish(struct campaign *c) {
    json_t *all = snapshot_json(c);
    c->published_us = clock_now_us(c->clock);
    atomic_store(&c->utc_s, clock_utc_us(c->clock) / US_PER_S);
    desk_publish(c->setup.desk, json_dumps(all, JSON_COMPACT));
    json_decref(all);
}

/* What became of the job at hand, kept for who asks later. Takes the names of its sessions before they are let go. */
void campaign_job_ended(struct campaign *c, enum campaign_state state, json_t *sessions) {
    json_t *job =
        json_pack("{s:i, s:s, s:s, s:s, s:o}", "number", c->current->number, "name", c->current->name,
                  "state", campaign_state_name(state), "why", c->failure.text, "sessions", sessions);
    if (c->n_ended == CAMPAIGN_ENDED) {
        json_decref(c->ended[0]);
        memmove(c->ended, c->ended + 1, --c->n_ended * sizeof *c->ended);
    }
    c->ended[c->n_ended++] = job;
    c->all_ended++;
    campaign_event(c, "end", false, json_deep_copy(job));
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
