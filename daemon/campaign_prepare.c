/* Before the first reading: the devices this plan uses, a session for each sample, the lamp warm. */
#include "daemon/campaign_private.h"

#include <ctype.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#define FIRST_STATUS_US (5 * US_PER_S) /* a drive that has not answered once by then is absent */
#define GEOMETRY_CONVENTION                                                                                  \
    "in plane; theta_i >= 0; theta_v > 0 on the mirror side; sample axis = theta_v, source axis = theta_i "  \
    "+ "                                                                                                     \
    "theta_v; mirrored: both negated"

/* ---- names and texts of sessions ---- */

void campaign_session_path(const struct campaign *c, const char *name, char path[PATH_MAX]) {
    snprintf(path, PATH_MAX, "%s/%s.gonio", c->setup.sessions_dir, name);
}

static void file_name_part(const char *from, char *to, size_t size) {
    size_t n = 0;
    for (; *from && n + 1 < size; from++)
        to[n++] = isalnum((unsigned char)*from) || strchr(".-", *from) ? *from : '-';
    to[n] = 0;
}

/* A name already taken gets -2, -3, ... */
static void name_session(const struct campaign *c, int sample, char name[192]) {
    char job[48], part[48], stamp[32], path[PATH_MAX];
    time_t s = clock_utc_us(c->clock) / US_PER_S;
    struct tm tm;
    file_name_part(c->job->name, job, sizeof job);
    file_name_part(c->job->sample[sample].name, part, sizeof part);
    strftime(stamp, sizeof stamp, "%Y%m%dT%H%M%SZ", gmtime_r(&s, &tm));
    for (int n = 1; n < 10000; n++) {
        char suffix[8] = "";
        if (n > 1)
            snprintf(suffix, sizeof suffix, "-%d", n);
        snprintf(name, 192, "%s_%s_%s%s", job, part, stamp, suffix);
        campaign_session_path(c, name, path);
        if (access(path, F_OK) != 0)
            return;
    }
}

static void set_json(struct campaign *c, int file, const char *key, json_t *json) {
    char *text = json_dumps(json, JSON_COMPACT);
    if (text)
        writer_text(c->writer, file, key, text);
    free(text);
    json_decref(json);
}

static json_t *sample_json(const struct job *job, const struct job_sample *s) {
    json_t *json = json_pack("{s:s, s:s, s:s, s:s, s:s, s:s, s:[f,f]}", "name", s->name, "job", job->name,
                             "series", job->series, "holder", s->holder, "paint", s->paint, "support",
                             s->support, "size_mm", s->size_mm[0], s->size_mm[1]);
    if (s->has_water)
        json_object_set_new(json, "water_percent", json_real(s->water_percent));
    if (s->notes)
        json_object_set_new(json, "notes", json_loads(s->notes, JSON_DECODE_ANY, NULL));
    return json;
}

static json_t *sibling_names(const struct campaign *c) {
    json_t *names = json_array();
    for (int i = 0; i < c->job->n_samples; i++)
        json_array_append_new(names, json_string(c->measured[i].name));
    return names;
}

static void write_texts(struct campaign *c, int sample) {
    const struct measured *m = &c->measured[sample];
    char seed[24];
    struct reduce_setup setup;
    snprintf(seed, sizeof seed, "%llu", (unsigned long long)c->setup.seed);
    campaign_reduce_setup(c, &setup);
    writer_text(c->writer, m->file, "job", c->job->text);
    writer_text(c->writer, m->file, "config", c->setup.config_text);
    if (c->setup.bench_text)
        writer_text(c->writer, m->file, "bench", c->setup.bench_text);
    writer_text(c->writer, m->file, "certificate", c->job->certificate.text);
    writer_text(c->writer, m->file, "goniod_version", GONIOD_VERSION);
    writer_text(c->writer, m->file, "geometry_convention", GEOMETRY_CONVENTION);
    writer_text(c->writer, m->file, "seed", c->setup.wiring->simulated ? seed : "");
    set_json(c, m->file, "files",
             json_pack("{s:s, s:s}", "job", c->job->file, "certificate", c->job->reference.certificate_file));
    set_json(c, m->file, "sample", sample_json(c->job, &c->job->sample[sample]));
    set_json(c, m->file, "siblings", sibling_names(c));
    set_json(c, m->file, "plan", plan_to_json(c->plan, c->job));
    set_json(c, m->file, "reduce_setup", reduce_setup_to_json(&setup));
    set_json(c, m->file, "fit_setup", campaign_fit_setup(c));
    const struct wiring *w = c->setup.wiring;
    json_t *truth = w->truth ? w->truth(w->self, &c->job->sample[sample], c->job->mean_nm) : NULL;
    if (truth)
        set_json(c, m->file, "truth", truth);
    for (int a = 0; a < STAGE_AXES; a++)
        if (c->instruments.profile[a] && c->plan->uses[a]) {
            char key[48];
            snprintf(key, sizeof key, "profile/%s", stage_axis_name(a));
            set_json(c, m->file, key,
                     json_pack("{s:s, s:s, s:s}", "id", c->instruments.profile[a]->id, "hash",
                               c->instruments.profile[a]->hash, "evidence",
                               profile_evidence_name(c->instruments.profile[a]->evidence)));
        }
    writer_calibration(c->writer, m->file, spectrometer_calibration(c->instruments.spectrometer));
}

/* ---- sessions ---- */

void campaign_reduce_setup(const struct campaign *c, struct reduce_setup *setup) {
    reduce_setup_stated(setup, c->job, c->setup.config);
    setup->calibration = *spectrometer_calibration(c->instruments.spectrometer);
}

static int create_session(struct campaign *c, int sample, struct err *e) {
    struct measured *m = &c->measured[sample];
    struct reduce_setup setup;
    char path[PATH_MAX];
    campaign_reduce_setup(c, &setup);
    campaign_session_path(c, m->name, path);
    m->campaign = c;
    m->points = fit_points_new();
    if (!m->points)
        return err_set(e, ERR_NOMEM, "no memory for the points of %s", m->name);
    int result = reducer_new(&m->reducer, &setup, e);
    if (result == 0)
        result = writer_create(c->writer, path, &m->file, e);
    if (result < 0)
        return result;
    m->used = true;
    write_texts(c, sample);
    return 0;
}

static int create_sessions(struct campaign *c, struct err *e) {
    for (int i = 0; i < c->job->n_samples; i++)
        name_session(c, i, c->measured[i].name);
    for (int i = 0; i < c->job->n_samples; i++) {
        int result = create_session(c, i, e);
        if (result < 0)
            return result;
    }
    campaign_store_event(
        c, "begin",
        json_pack("{s:i, s:I}", "steps", c->plan->n_steps, "utc_us", (json_int_t)clock_utc_us(c->clock)));
    return campaign_store_drain(c, NULL,
                                e); /* once begun it is done whole, or preparing again would double it */
}

/* ---- devices ---- */

int campaign_ready_spectrometer(struct campaign *c, struct err *e) {
    if (c->instruments.spectrometer)
        return 0;
    c->lamp = -1;
    int result = instruments_open_spectrometer(&c->instruments, &c->cancel, e);
    c->spectrometer_suspect |= result < 0;
    return result;
}

/* False: no motor, or none that this plan uses. */
static bool motor_status(const struct campaign *c, enum stage_axis which, struct axis_status *s) {
    const struct axis *axis = c->instruments.stage.axis[which];
    if (!c->plan->uses[which] || !axis || axis_config(axis)->kind != AXIS_MOTOR)
        return false;
    axis_status(axis, s);
    return true;
}

/* The first that has not answered yet; -1: all have. */
static int silent_motor(const struct campaign *c) {
    for (int a = 0; a < STAGE_AXES; a++) {
        struct axis_status s;
        if (motor_status(c, a, &s) && (!s.connected || s.read_us == INT64_MIN))
            return a;
    }
    return -1;
}

static bool have_answered(void *arg) {
    return silent_motor(arg) < 0;
}

/* An order of a goniod that was killed may still be under way: nothing that turns is left to itself. */
static int await_standstill(struct campaign *c, struct err *e) {
    struct stage *stage = &c->instruments.stage;
    if (stage_standstill(stage))
        return 0;
    stage_order_stop(stage);
    int result = bench_wait(c->bench, clock_now_us(c->clock) + CAMPAIGN_STANDSTILL_US, stage_standstill,
                            stage, &c->cancel);
    if (result == BENCH_DONE)
        return 0;
    return result < 0 ? err_set(e, -result, "stopped while waiting for the axes")
                      : err_set(e, ERR_BUSY, "an axis turns and does not stop; who else commands it?");
}

static int await_axes(struct campaign *c, struct err *e) {
    int64_t until_us = clock_now_us(c->clock) + FIRST_STATUS_US;
    int result = bench_wait(c->bench, until_us, have_answered, c, &c->cancel);
    if (result == BENCH_DONE)
        return await_standstill(c, e);
    if (result < 0)
        return err_set(e, -result, "stopped while waiting for the axes");
    int silent = silent_motor(c);
    if (silent < 0)
        return await_standstill(c, e);
    const struct config_axis *axis = instruments_axis(c->setup.config, silent);
    return err_set(e, ERR_LINK,
                   "the %s axis (unit %d on %s) does not answer: is it powered, and its number right?",
                   stage_axis_name(silent), axis->unit, axis->link);
}

int campaign_home_where_needed(struct campaign *c, struct err *e) {
    for (int a = 0; a < STAGE_AXES; a++) {
        struct axis_status s;
        if (!motor_status(c, a, &s) || s.valid)
            continue;
        int result = stage_home(&c->instruments.stage, a, &c->cancel, e);
        if (result == 0)
            result = instruments_record_drive(&c->instruments, a, true, false, e);
        if (result < 0)
            return result;
    }
    return 0;
}

static bool have_sessions(const struct campaign *c) {
    for (int i = 0; i < JOB_SAMPLES; i++)
        if (c->measured[i].used)
            return true;
    return false;
}

int campaign_prepare(struct campaign *c, struct err *e) {
    int result = 0;
    for (int a = 0; a < STAGE_AXES && result == 0; a++)
        result = c->plan->uses[a] ? instruments_check_commissioned(&c->instruments, a, e) : 0;
    if (result == 0)
        result = campaign_ready_spectrometer(c, e);
    if (result == 0 && !have_sessions(c))
        result = *c->current->session ? campaign_resume_sessions(c, e) : create_sessions(c, e);
    if (result == 0)
        result = instruments_open_stage(&c->instruments, c->plan->uses, e);
    if (result == 0)
        result = await_axes(c, e);
    if (result == 0)
        result = campaign_home_where_needed(c, e);
    return result;
}

/* ---- the lamp ---- */

static bool wanted_elsewhere(void *arg) {
    const struct campaign *c = arg;
    return c->want.pause;
}

int campaign_warm_up(struct campaign *c, struct err *e) {
    int result = campaign_ready_spectrometer(c, e);
    if (result == 0)
        result = campaign_set_lamp(c, true, e);
    if (result < 0)
        return result;
    if (c->lamp_since_us == INT64_MIN)
        c->lamp_since_us = clock_now_us(c->clock);
    int64_t warm_us = c->lamp_since_us + (int64_t)(c->setup.config->lamp_warm_up_min * US_PER_MIN);
    do {
        result = bench_wait(c->bench, warm_us, wanted_elsewhere, c, &c->cancel);
        if (result == BENCH_DONE && c->want.pause)
            result = campaign_pause(c, e);
    } while (result == 0 && clock_now_us(c->clock) < warm_us);
    return result < 0 ? err_set(e, -result, "stopped while the lamp was warming up") : 0;
}
