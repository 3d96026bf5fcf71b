/* The recording's job on the simulated bench: a whole goniod but for the control socket and the estimates. A hold is
 * answered at once, since the simulated person does what it asks. */
#include "daemon/replay_private.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/campaign.h"
#include "daemon/session_text.h"
#include "daemon/simulate.h"

#define HOLDS_AT_A_STEP 24 /* more than one step can ask of a person: then the hold is a failure */

struct lab {
    struct clock clock;
    struct bench bench;
    struct config config;
    struct simulate *simulate;
    struct wiring wiring;
    struct desk *desk;
    struct campaign *campaign;
    int64_t asked;          /* ticket of the order that has no outcome yet, 0 = none */
    int holds, holds_since; /* answered since so many steps were done */
    bool over;
    enum campaign_state ended;
    struct err failure;
};

/* ---- the person at the bench ---- */

static void take_outcomes(struct lab *lab) {
    struct desk_outcome o;
    while (desk_take_outcome(lab->desk, &o)) {
        if (o.ticket == lab->asked)
            lab->asked = 0;
        if (o.code && !lab->failure.code)
            err_set(&lab->failure, ERR_STATE, "the simulated bench refuses the job: %.200s %.250s", o.text,
                    o.json ? o.json : "");
        free(o.json);
    }
}

static bool is_over(const struct lab *lab) {
    enum campaign_state state = campaign_state(lab->campaign);
    return lab->failure.code || (campaign_state_is_rest(state) && state != CAMPAIGN_IDLE);
}

static int64_t due_us(void *self) {
    struct lab *lab = self;
    take_outcomes(lab);
    if (lab->over || lab->asked)
        return CLOCK_NEVER;
    bool due = is_over(lab) || campaign_state(lab->campaign) == CAMPAIGN_HELD;
    return due ? clock_now_us(&lab->clock) : CLOCK_NEVER;
}

static void post(struct lab *lab, enum campaign_command command) {
    struct desk_order order = {.command = command};
    desk_post(lab->desk, &order, &lab->asked, &lab->failure);
}

/* The published status says it best. */
static void say_why(struct lab *lab, const char *key) {
    const struct desk_snapshot *s = desk_snapshot_get(lab->desk);
    json_t *json = json_loads(s->json, 0, NULL);
    const char *why = json_string_value(json_object_get(json, key));
    err_set(&lab->failure, ERR_STATE, "the simulated campaign came to its end as %s: %s",
            campaign_state_name(lab->ended), why ? why : "");
    json_decref(json);
    desk_snapshot_put(s);
}

static void answer(void *self) {
    struct lab *lab = self;
    int steps = campaign_steps_done(lab->campaign);
    lab->ended = campaign_state(lab->campaign);
    lab->holds = steps == lab->holds_since ? lab->holds + 1 : 1;
    lab->holds_since = steps;
    if (!is_over(lab) && lab->holds <= HOLDS_AT_A_STEP) {
        post(lab, COMMAND_CONTINUE);
        return;
    }
    lab->over = true;
    if (!lab->failure.code && lab->ended != CAMPAIGN_DONE)
        say_why(lab, lab->ended == CAMPAIGN_HELD ? "hold" : "why");
    post(lab, COMMAND_INTERRUPT);
}

/* ---- the bench ---- */

/* The simulated devices answer in the places of the real ones; nobody is told about it. */
static int stand_in(struct config_axis *axis, int unit, struct err *e) {
    if (axis->kind != CONFIG_AXIS_MOTOR)
        return 0;
    if (strcmp(axis->profile, "om-az") != 0)
        return err_set(e, ERR_INPUT, "the simulated bench has om-az axes, and none like %s", axis->profile);
    snprintf(axis->link, sizeof axis->link, "sim:modbus");
    axis->unit = unit;
    return 0;
}

static int read_config(struct lab *lab, const struct recording *r, enum replay_surface which, struct err *e) {
    struct err_list errors = {0};
    struct config *c = &lab->config;
    int rc = config_read_text("config of the session", r->config, strlen(r->config), c, &errors);
    if (rc < 0 && errors.n)
        *e = errors.item[0];
    err_list_free(&errors);
    snprintf(c->spectrometer.link, sizeof c->spectrometer.link, "sim:usb");
    if (which == REPLAY_ESTIMATE) /* its parameters belong to this P, and to no other */
        c->optics.polarisation_p = r->estimate.polarisation;
    c->n_notify = 0;
    if (rc == 0)
        rc = stand_in(&c->source, 1, e);
    if (rc == 0)
        rc = stand_in(&c->sample, 2, e);
    return rc == 0 ? stand_in(&c->holder, 3, e) : rc;
}

static int open_bench(struct lab *lab, const struct recording *r, const struct replay_options *o,
                      struct err *e) {
    const struct simulate_options truth = {.seed = o->seed, .nominal = o->surface == REPLAY_ESTIMATE};
    clock_init_virtual(&lab->clock);
    if (r->utc_start_us)
        lab->clock.utc_start_us = r->utc_start_us;
    bench_init(&lab->bench, &lab->clock);
    int rc = read_config(lab, r, o->surface, e);
    if (rc == 0)
        rc = simulate_new(&lab->simulate, &truth, &lab->config, &lab->clock, e);
    for (int i = 0; i < r->n_surfaces && rc == 0; i++)
        rc = simulate_mount_instead(lab->simulate, r->surface[i].sample, &r->surface[i].surface, e);
    if (rc == 0)
        simulate_wiring(lab->simulate, &lab->wiring);
    return rc;
}

static int open_campaign(struct lab *lab, const struct recording *r, const struct replay_options *o,
                         const char *dir, struct err *e) {
    struct err_list errors = {0};
    const struct campaign_setup setup = {.config = &lab->config,
                                         .config_text = r->config,
                                         .sessions_dir = dir,
                                         .state_dir = dir,
                                         .desk = lab->desk,
                                         .bench = &lab->bench,
                                         .wiring = &lab->wiring,
                                         .seed = o->seed,
                                         .without_estimates = true};
    int rc = campaign_new(&lab->campaign, &setup, &errors);
    if (rc < 0 && errors.n)
        *e = errors.item[0];
    err_list_free(&errors);
    struct bench_service person = {.name = "person", .self = lab, .due_us = due_us, .run = answer};
    return rc == 0 && bench_add(&lab->bench, &person) < 0
               ? err_set(e, ERR_RANGE, "too many services on the bench")
               : rc;
}

static int post_job(struct lab *lab, const struct recording *r, struct err *e) {
    struct desk_order order = {.command = COMMAND_RUN};
    struct desk_run *run = &order.run;
    char *job = strdup(r->job), *certificate = strdup(r->certificate);
    if (!job || !certificate) {
        free(job);
        free(certificate);
        return err_set(e, ERR_NOMEM, "no memory for the job");
    }
    snprintf(run->name, sizeof run->name, "%s", r->job_file);
    run->text = job;
    run->size = strlen(job);
    run->n_files = 1;
    snprintf(run->file[0].name, sizeof run->file[0].name, "%s", r->certificate_file);
    run->file[0].text = certificate;
    run->file[0].size = strlen(certificate);
    int rc = desk_post(lab->desk, &order, &lab->asked, e);
    if (rc < 0)
        desk_order_free(&order);
    return rc;
}

/* ---- its session ---- */

static bool is_of_sample(const char *path, const char *sample) {
    struct session *s;
    json_t *json = NULL;
    if (session_open(&s, path, true, NULL) < 0)
        return false;
    session_text_json(s, "sample", &json, NULL);
    const char *name = json_string_value(json_object_get(json, "name"));
    bool same = name && strcmp(name, sample) == 0;
    json_decref(json);
    session_close(s, NULL);
    return same;
}

static int find_session(const struct recording *r, const char *dir, char path[PATH_MAX], struct err *e) {
    DIR *folder = opendir(dir);
    bool found = false;
    for (struct dirent *d; folder && !found && (d = readdir(folder));) {
        const char *ending = strrchr(d->d_name, '.');
        if (!ending || strcmp(ending, ".gonio") != 0)
            continue;
        snprintf(path, PATH_MAX, "%s/%s", dir, d->d_name);
        found = is_of_sample(path, r->sample);
    }
    if (folder)
        closedir(folder);
    return found ? 0 : err_set(e, ERR_STATE, "the simulated campaign left no session of %s", r->sample);
}

int replay_measure(const struct recording *r, const struct replay_options *options, const char *dir,
                   char path[PATH_MAX], struct err *e) {
    struct lab *lab = calloc(1, sizeof *lab);
    if (!lab)
        return err_set(e, ERR_NOMEM, "no memory for the simulated bench");
    int rc = open_bench(lab, r, options, e);
    if (rc == 0)
        rc = desk_new(&lab->desk, e);
    if (rc == 0)
        rc = open_campaign(lab, r, options, dir, e);
    if (rc == 0)
        rc = post_job(lab, r, e);
    if (rc == 0)
        rc = campaign_serve(lab->campaign);
    if (rc == 0 && lab->failure.code) {
        *e = lab->failure;
        rc = -e->code;
    }
    campaign_free(lab->campaign);
    desk_free(lab->desk);
    simulate_free(lab->simulate);
    free(lab);
    return rc == 0 ? find_session(r, dir, path, e) : rc;
}
