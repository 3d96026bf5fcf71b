/* A session goes on by the same road as after a pause: its rows are replayed through the reduction, the open bracket
 * ends, and the plan is run where it is not done. All sessions of the run go on together. */
#include "daemon/campaign_private.h"
#include "daemon/session_text.h"

#include <string.h>
#include <unistd.h>

#define GAP_US US_PER_S /* the session's time goes on this long after its last row */

static int open_session(const struct campaign *c, const char *name, struct session **s, struct err *e) {
    char path[PATH_MAX];
    if (strchr(name, '/') || *name == '.' || !*name)
        return err_set(e, ERR_USAGE, "\"%s\" is not the name of a session: give a name without a folder",
                       name);
    campaign_session_path(c, name, path);
    if (access(path, F_OK) < 0)
        return err_set(e, ERR_INPUT, "there is no session %s: `gonioctl sessions` lists them", name);
    return session_open(s, path, true, e);
}

/* ---- may it go on? ---- */

static int last_end(void *arg, int64_t us, const char *kind, const char *json) {
    char *state = arg;
    (void)us;
    if (!strcmp(kind, "end")) {
        json_t *end = json_loads(json, 0, NULL);
        const char *text = json_string_value(json_object_get(end, "state"));
        snprintf(state, 24, "%s", text ? text : "");
        json_decref(end);
    } else if (!strcmp(kind, "resume")) {
        state[0] = 0;
    }
    return 0;
}

static int check_unfinished(struct session *s, const char *name, struct err *e) {
    char state[24] = "";
    int result = session_each_event(s, last_end, state, e);
    if (result < 0)
        return result;
    if (!strcmp(state, "done"))
        return err_set(e, ERR_STATE, "session %s is complete: there is nothing to resume", name);
    if (!strcmp(state, "aborted"))
        return err_set(e, ERR_STATE, "session %s was aborted by a person: run its job anew", name);
    return 0;
}

static int check_text(struct session *s, const char *key, const char *now, const char *what, struct err *e) {
    char *text = NULL;
    int result = session_get_text(s, key, &text, e);
    if (result == 0 && (!text != !now || (text && strcmp(text, now) != 0)))
        result = err_set(e, ERR_STATE,
                         "%s has changed since the session began: put it back, or run the job anew", what);
    free(text);
    return result;
}

static int plan_from_texts(struct campaign *c, struct session *s, struct campaign_job *job, struct err *e) {
    char *text = NULL, *certificate = NULL;
    json_t *names = NULL;
    struct err_list errors = {0};
    int result = session_get_text(s, "job", &text, e);
    if (result == 0)
        result = session_get_text(s, "certificate", &certificate, e);
    if (result == 0)
        result = session_text_json(s, "files", &names, e);
    const char *job_name = json_string_value(json_object_get(names, "job"));
    const char *certificate_name = json_string_value(json_object_get(names, "certificate"));
    if (result == 0 && (!text || !certificate || !job_name || !certificate_name))
        result = err_set(e, ERR_INPUT, "the session does not hold its job and certificate");
    if (result == 0) {
        struct job_file file = {.text = certificate, .size = strlen(certificate)};
        snprintf(file.name, sizeof file.name, "%s", certificate_name);
        result = campaign_job_plan(c, job_name, text, strlen(text), &file, 1, job, &errors);
        if (result < 0 && errors.n > 0)
            *e = errors.item[0];
    }
    err_list_free(&errors);
    json_decref(names);
    free(text);
    free(certificate);
    return result;
}

/* What tells a step from another; its estimate may differ, where a profile knows its drive better today. */
static bool same_step(const json_t *then, const json_t *now) {
    static const char *const keys[] = {"kind",    "sample", "theta_i_deg", "theta_v_deg", "mirrored",
                                       "bracket", "opens",  "control",     "repeat",      "reference"};
    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++)
        if (!json_equal(json_object_get(then, keys[i]), json_object_get(now, keys[i])) &&
            (json_object_get(then, keys[i]) || json_object_get(now, keys[i])))
            return false;
    return true;
}

/* The rows name steps by their number. */
static int check_same_steps(struct session *s, const struct campaign_job *job, struct err *e) {
    json_t *now = plan_to_json(&job->plan, &job->job), *then;
    int result = session_text_json(s, "plan", &then, e);
    const json_t *a = json_object_get(then, "steps"), *b = json_object_get(now, "steps");
    bool same = json_array_size(a) == json_array_size(b);
    for (size_t i = 0; same && i < json_array_size(a); i++)
        same = same_step(json_array_get(a, i), json_array_get(b, i));
    json_decref(now);
    json_decref(then);
    if (result == 0 && !same)
        result = err_set(
            e, ERR_STATE,
            "the session was planned in other steps than this goniod plans today (another version, or "
            "another profile of a drive): run the job anew");
    return result;
}

int campaign_resume_plan(struct campaign *c, const char *name, struct campaign_job *job, struct err *e) {
    struct session *s;
    int result = open_session(c, name, &s, e);
    if (result < 0)
        return result;
    result = check_unfinished(s, name, e);
    if (result == 0)
        result = check_text(s, "config", c->setup.config_text, "the config of the bench", e);
    if (result == 0)
        result = check_text(s, "bench", c->setup.bench_text, "the file of the simulated bench", e);
    if (result == 0)
        result = plan_from_texts(c, s, job, e);
    if (result == 0)
        result = check_same_steps(s, job, e);
    session_close(s, NULL);
    return result;
}

/* ---- replay ---- */

struct replay {
    struct campaign *c;
    struct measured *m;
    int sample;
    int *step; /* of each exposure, by id */
    int64_t n;
    int64_t last_us;
};

static void note_light(struct campaign *c, const struct exposure *x) {
    struct light *l = campaign_light_of(c, &c->plan->step[x->step]);
    const struct calibration *k = spectrometer_calibration(c->instruments.spectrometer);
    double peak = 1e-6;
    for (int i = 0; i < x->n_scans; i++)
        peak = fmax(peak, reduce_peak(k, x->counts + (size_t)i * x->pixels));
    *l = (struct light){.known = true, .rate = peak / x->exposure_us, .growth = 1};
}

static int seen_exposure(void *arg, const struct exposure *x) {
    struct replay *r = arg;
    struct campaign *c = r->c;
    int *larger = realloc(r->step, (x->id + 1) * sizeof *larger);
    if (!larger || x->step < 0 || x->step >= c->plan->n_steps)
        return -ERR_INPUT;
    r->step = larger;
    r->step[x->id] = x->step;
    r->n = x->id;
    r->m->last_exposure = x->id;
    int *attempt = x->kind == EXPOSURE_DARK ? c->dark_attempt : c->attempt;
    if (attempt[x->step] <= x->attempt)
        attempt[x->step] = x->attempt + 1;
    if (x->kind != EXPOSURE_DARK && x->saturated_pixels == 0)
        note_light(c, x);
    if (x->end_us > r->last_us)
        r->last_us = x->end_us;
    if (x->bracket > c->last_bracket)
        c->last_bracket = x->bracket;
    if (x->opens > c->last_bracket)
        c->last_bracket = x->opens;
    if (c->setup.wiring->seen_before)
        c->setup.wiring->seen_before(c->setup.wiring->self, &c->job->sample[r->sample], x);
    return fit_points_exposure(r->m->points, x->id, x->mirrored);
}

static int seen_event(void *arg, int64_t us, const char *kind, const char *json) {
    struct replay *r = arg;
    (void)kind;
    (void)json;
    if (us > r->last_us)
        r->last_us = us;
    return 0;
}

/* The rows are there already: only the present state is taken from them. */
static int replayed_point(void *arg, struct point *p, struct err *e) {
    struct replay *r = arg;
    p->id = ++r->m->last_point;
    r->m->n_provisional += p->provisional ? 1 : p->supersedes ? -1 : 0;
    r->m->n_points += p->supersedes ? 0 : 1;
    if (!p->provisional)
        campaign_mark_done(r->c, r->step[p->exposure_id]);
    return fit_points_add(r->m->points, p) < 0
               ? err_set(e, ERR_NOMEM, "no memory for the points of %s", r->m->name)
               : 0;
}

static int replayed_bracket(void *arg, const struct bracket *b, struct err *e) {
    struct replay *r = arg;
    (void)e;
    fit_points_bracket(r->m->points, b);
    return 0;
}

static int replayed_linearity(void *arg, struct linearity *l, struct err *e) {
    struct replay *r = arg;
    (void)e;
    campaign_mark_done(r->c, l->step);
    return 0;
}

static int check_same_spectrometer(struct campaign *c, struct session *s, struct err *e) {
    struct calibration then;
    const struct calibration *now = spectrometer_calibration(c->instruments.spectrometer);
    int result = session_get_calibration(s, &then, e);
    if (result == 0 && (strcmp(then.serial, now->serial) != 0 || strcmp(then.model, now->model) != 0))
        result = err_set(e, ERR_STATE, "the session was measured with spectrometer %s, and %s is connected",
                         then.serial, now->serial);
    return result;
}

static int replay(struct campaign *c, struct session *s, struct replay *r, struct err *e) {
    struct reduce_setup setup;
    campaign_reduce_setup(c, &setup);
    r->m->campaign = c;
    r->m->points = fit_points_new();
    int result =
        r->m->points ? check_same_spectrometer(c, s, e) : err_set(e, ERR_NOMEM, "no memory to resume");
    if (result == 0)
        result = reducer_new(&r->m->reducer, &setup, e);
    if (result == 0)
        result = session_each_exposure(s, seen_exposure, r, e);
    if (result == 0)
        result = session_each_event(s, seen_event, r, e);
    struct reduce_sink sink = {
        .arg = r, .point = replayed_point, .bracket = replayed_bracket, .linearity = replayed_linearity};
    if (result == 0)
        result = reduce_replay(s, r->m->reducer, &sink, e);
    if (result < 0)
        err_set(e, -result, "the rows of session %s do not fit its job", r->m->name);
    return result;
}

static int resume_one(struct campaign *c, int sample, const char *name, int64_t *last_us, struct err *e) {
    struct measured *m = &c->measured[sample];
    struct replay r = {.c = c, .m = m, .sample = sample};
    struct session *s;
    char path[PATH_MAX];
    snprintf(m->name, sizeof m->name, "%s", name);
    int result = open_session(c, name, &s, e);
    if (result < 0)
        return result;
    result = check_unfinished(s, name, e);
    if (result == 0)
        result = replay(c, s, &r, e);
    session_close(s, NULL);
    free(r.step);
    campaign_session_path(c, name, path);
    if (result == 0)
        result = writer_open(c->writer, path, &m->file, e);
    m->used = result == 0;
    if (r.last_us > *last_us)
        *last_us = r.last_us;
    return result;
}

/* The sessions of the run, by sample; the session that was named stands in its own place among them. */
static json_t *siblings_of(struct campaign *c, const char *name, struct err *e) {
    struct session *s;
    json_t *names;
    if (open_session(c, name, &s, e) < 0)
        return NULL;
    int result = session_text_json(s, "siblings", &names, e);
    session_close(s, NULL);
    if (json_is_array(names) && json_array_size(names) == (size_t)c->job->n_samples)
        return names;
    json_decref(names);
    if (result == 0)
        err_set(e, ERR_INPUT, "session %s does not say which sessions belong to its run", name);
    return NULL;
}

/* What is left of samples that cannot go on is no work; their sessions stay as they are. */
static void leave_out(struct campaign *c, int sample, const struct err *why) {
    for (int k = 0; k < c->plan->n_steps; k++)
        if (c->plan->step[k].kind == STEP_SAMPLE && c->plan->step[k].sample == sample)
            campaign_mark_done(c, k);
    campaign_warn(c, "sample %s is left as it is: %s", c->job->sample[sample].name, why->text);
}

static void mark_own_references(struct campaign *c) {
    for (int k = 0; k < c->plan->n_steps; k++) {
        const struct step *s = &c->plan->step[k];
        if (s->kind == STEP_SAMPLE && c->done[k] && s->reference >= 0 && !c->plan->step[s->reference].control)
            campaign_mark_done(c, s->reference);
    }
}

static void again(void *arg, int step) {
    (void)arg;
    (void)step; /* only steps with a final point were marked done */
}

static int end_open_brackets(struct campaign *c, struct err *e) {
    int result = 0;
    for (int i = 0; i < c->job->n_samples && result == 0; i++) {
        struct measured *m = &c->measured[i];
        struct reduce_sink sink = campaign_store_sink(m, c);
        if (m->used)
            result = reducer_end_bracket(m->reducer, "resume", &sink, again, c, e);
    }
    return result;
}

int campaign_resume_sessions(struct campaign *c, struct err *e) {
    int64_t last_us = 0;
    json_t *names = siblings_of(c, c->current->session, e);
    if (!names)
        return -e->code;
    int result = 0;
    for (int i = 0; i < c->job->n_samples && result == 0; i++) {
        const char *name = json_string_value(json_array_get(names, i));
        struct err why = {0};
        int one = resume_one(c, i, name ? name : "", &last_us, &why);
        if (one < 0 && name && strcmp(name, c->current->session) != 0)
            leave_out(c, i, &why);
        else if (one < 0) {
            *e = why;
            result = one;
        }
    }
    json_decref(names);
    if (result < 0)
        return result;
    c->offset_us = last_us + GAP_US - clock_now_us(c->clock);
    mark_own_references(c);
    campaign_store_event(
        c, "resume",
        json_pack("{s:i, s:I}", "steps_done", c->n_done, "utc_us", (json_int_t)clock_utc_us(c->clock)));
    result = end_open_brackets(c, e);
    return result == 0 ? campaign_store_drain(c, NULL, e) : result;
}
