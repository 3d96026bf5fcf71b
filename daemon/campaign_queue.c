/* Orders from the desk, taken inside bench_wait: each is looked up in campaign_table, raises a request, and gets its
 * outcome at once. Nothing here waits. */
#include "daemon/campaign_private.h"
#include "daemon/plan_forecast.h"

#include <stdlib.h>
#include <string.h>
#include <sys/statvfs.h>

void campaign_job_free(struct campaign_job *job) {
    if (!job)
        return;
    if (job->planned) {
        plan_free(&job->plan);
        job_free(&job->job);
    }
    free(job);
}

bool campaign_must_end(const struct campaign *c) {
    return c->want.abort || c->want.interrupt;
}

void campaign_set_state(struct campaign *c, enum campaign_state state) {
    if (state == c->state)
        return;
    json_t *event =
        json_pack("{s:s, s:s}", "from", campaign_state_name(c->state), "to", campaign_state_name(state));
    c->state = state;
    campaign_store_event(c, "state", json_incref(event));
    if (state == CAMPAIGN_ABORTED || state == CAMPAIGN_FAILED || state == CAMPAIGN_DONE)
        campaign_notify(c, campaign_state_name(state), event);
    campaign_event(c, "state", false, event);
    campaign_publish(c);
}

/* ---- jobs ---- */

json_t *campaign_errors_json(const struct err_list *errors) {
    json_t *list = json_array();
    for (size_t i = 0; i < errors->n; i++) {
        const struct err *e = &errors->item[i];
        json_array_append_new(list, json_pack("{s:s, s:i, s:i, s:s}", "file", e->file, "line", e->line,
                                              "column", e->column, "text", e->text));
    }
    return list;
}

static double free_bytes(const char *dir) {
    struct statvfs fs;
    return statvfs(dir, &fs) < 0 ? 0 : (double)fs.f_bavail * fs.f_frsize;
}

/* A simulated bench has only so many paints; a real one has what a person mounts. */
static int check_samples(const struct campaign *c, const struct job *job, struct err_list *errors) {
    const struct wiring *w = c->setup.wiring;
    int result = 0;
    for (int i = 0; w->known && i < job->n_samples; i++) {
        struct err e = {0};
        char path[40];
        snprintf(path, sizeof path, "samples[%d]", i);
        if (w->known(w->self, &job->sample[i], &e) == 0)
            continue;
        job_complain(job, errors, path, "sample %s: %s", job->sample[i].name, e.text);
        result = -ERR_INPUT;
    }
    return result;
}

int campaign_job_plan(const struct campaign *c, const char *file, const char *text, size_t size,
                      const struct job_file *files, int n_files, struct campaign_job *out,
                      struct err_list *errors) {
    struct plan_devices devices = {.utc_s = atomic_load(&((struct campaign *)c)->utc_s),
                                   .free_bytes = free_bytes(c->setup.sessions_dir)};
    instruments_plan_devices(&c->instruments, &devices);
    int result = job_read_text(file, text, size, files, n_files, &out->job, errors);
    if (result < 0) {
        job_free(&out->job);
        return result;
    }
    result = plan_make(&out->job, c->setup.config, &devices, &out->plan, errors);
    int unknown = check_samples(c, &out->job, errors);
    result = result < 0 ? result : unknown;
    out->planned = result == 0;
    if (result < 0) {
        plan_free(&out->plan); /* also one that was refused holds its refusals */
        job_free(&out->job);
    } else {
        snprintf(out->name, sizeof out->name, "%s", out->job.name);
    }
    return result;
}

/* What the job's angles will tell; a job that cannot be forecast is a job all the same. */
static void add_forecast(const struct campaign *c, const struct campaign_job *job, json_t *plan, FILE *out) {
    struct plan_devices devices = {0};
    struct err e = {0};
    instruments_plan_devices(&c->instruments, &devices);
    json_t *forecast = plan_forecast(&job->plan, &job->job, c->setup.config, &devices, &e);
    if (forecast) {
        plan_forecast_print(forecast, out);
        json_object_set_new(plan, "forecast", forecast);
    } else {
        fprintf(out, "No forecast of uncertainties: %s\n", e.text);
    }
}

/* What stands between this plan and its start, and no plan can mend. */
static void add_before_start(const struct campaign *c, const struct plan *plan, json_t *json, FILE *out) {
    json_t *all = json_array();
    for (int a = 0; a < STAGE_AXES; a++) {
        struct err e = {0};
        if (!plan->uses[a] || instruments_check_commissioned(&c->instruments, a, &e) == 0)
            continue;
        fprintf(out, "%s  %s\n", json_array_size(all) ? "" : "Before the start:\n", e.text);
        json_array_append_new(all, json_string(e.text));
    }
    json_object_set_new(json, "before_start", all);
}

json_t *campaign_check(void *campaign, const struct desk_run *run, struct err_list *errors) {
    struct campaign_job *job = calloc(1, sizeof *job);
    json_t *plan = NULL;
    if (job && campaign_job_plan(campaign, run->name, run->text, run->size, run->file, run->n_files, job,
                                 errors) == 0) {
        char *text = NULL;
        size_t size = 0;
        FILE *out = open_memstream(&text, &size);
        plan = plan_to_json(&job->plan, &job->job);
        if (out) {
            plan_print(&job->plan, &job->job, out);
            add_before_start(campaign, &job->plan, plan, out);
            add_forecast(campaign, job, plan, out);
            fclose(out);
            json_object_set_new(plan, "text", json_string(text));
        }
        free(text);
    }
    campaign_job_free(job);
    return plan;
}

struct campaign_job *campaign_queue_next(struct campaign *c) {
    struct campaign_job *first = c->queue[0];
    memmove(c->queue, c->queue + 1, --c->n_queue * sizeof *c->queue);
    return first;
}

static void finish(struct campaign *c, const struct desk_order *order, int code, const char *text,
                   json_t *json) {
    char *out = json ? json_dumps(json, JSON_COMPACT) : NULL;
    json_decref(json);
    desk_finish(c->setup.desk, order->ticket, code, text, out);
}

static void enqueue(struct campaign *c, const struct desk_order *order, struct campaign_job *job) {
    job->number = ++c->last_number;
    job->waited = c->n_queue > 0 || !campaign_state_is_rest(c->state);
    c->queue[c->n_queue++] = job;
    if (campaign_state_is_rest(c->state))
        c->queue_waits = false;
    campaign_event(c, "queue", true, json_pack("{s:i}", "waiting", c->n_queue));
    finish(c, order, 0, "",
           json_pack("{s:i, s:i, s:s}", "job", job->number, "position", c->n_queue, "name", job->name));
    campaign_publish(c);
}

static struct campaign_job *new_job(struct campaign *c, const struct desk_order *order) {
    struct campaign_job *job = c->n_queue < CAMPAIGN_QUEUE ? calloc(1, sizeof *job) : NULL;
    if (!job)
        finish(c, order, ERR_BUSY, "the queue is full: wait until a campaign has ended", NULL);
    return job;
}

static void order_run(struct campaign *c, const struct desk_order *order) {
    const struct desk_run *run = &order->run;
    struct err_list errors = {0};
    struct campaign_job *job = new_job(c, order);
    if (!job)
        return;
    if (campaign_job_plan(c, run->name, run->text, run->size, run->file, run->n_files, job, &errors) == 0) {
        enqueue(c, order, job);
    } else {
        char text[80];
        snprintf(text, sizeof text, "the job has %zu mistake%s; nothing was started", errors.n,
                 errors.n == 1 ? "" : "s");
        finish(c, order, ERR_INPUT, text, campaign_errors_json(&errors));
        campaign_job_free(job);
    }
    err_list_free(&errors);
}

/* Read and planned here, so that a session that cannot go on is refused in the answer. */
static void order_resume_session(struct campaign *c, const struct desk_order *order) {
    struct err e = {0};
    struct campaign_job *job = new_job(c, order);
    if (!job)
        return;
    snprintf(job->session, sizeof job->session, "%s", order->session.name);
    int result = campaign_resume_plan(c, job->session, job, &e);
    if (result == 0) {
        enqueue(c, order, job);
        return;
    }
    finish(c, order, result, e.text, NULL);
    campaign_job_free(job);
}

/* ---- a campaign under way ---- */

static void stop_axes(struct campaign *c) {
    stage_order_stop(&c->instruments.stage);
    atomic_store(&c->cancel.raised, true);
}

static void begin_pausing(struct campaign *c) {
    if (c->state == CAMPAIGN_RUNNING || c->state == CAMPAIGN_PREPARING) {
        c->state_before_pause = c->state;
        campaign_set_state(c, CAMPAIGN_PAUSING);
    }
}

static void order_pause(struct campaign *c) {
    c->want.pause = true;
    begin_pausing(c);
}

static void order_pause_now(struct campaign *c) {
    if (c->state == CAMPAIGN_PAUSED || c->state == CAMPAIGN_HELD) {
        c->want.pause = c->state == CAMPAIGN_HELD;
        return;
    }
    stage_order_stop(&c->instruments.stage);
    if (c->want.pause_now)
        return; /* under way already: a second cancel would end what makes the pause */
    c->want.pause_now = true;
    atomic_store(&c->cancel.raised, true);
    begin_pausing(c);
}

static void order_resume(struct campaign *c) {
    c->want.pause = c->want.pause_now = false;
    if (c->state == CAMPAIGN_PAUSED)
        c->want.go_on = true;
    else
        campaign_set_state(c, c->state_before_pause);
}

static void order_stop(struct campaign *c) {
    if (campaign_state_is_rest(c->state))
        stop_axes(c);
    else if (c->state == CAMPAIGN_HELD || c->state == CAMPAIGN_PAUSED)
        stage_order_stop(&c->instruments.stage);
    else if (c->state == CAMPAIGN_PARKING || c->state == CAMPAIGN_ABORTING) {
        c->want.abort = true;
        stop_axes(c);
    } else
        order_pause_now(c);
}

static void order_continue(struct campaign *c, const struct desk_order *order) {
    if (c->state == CAMPAIGN_HELD) {
        c->want.go_on = true;
        finish(c, order, 0, "", NULL);
    } else if (c->n_queue > 0) {
        c->queue_waits = false;
        finish(c, order, 0, "", NULL);
    } else {
        finish(c, order, ERR_STATE, "nothing waits in the queue", NULL);
    }
}

static void order_manual(struct campaign *c, const struct desk_order *order) {
    if (c->manual_pending) {
        finish(c, order, ERR_BUSY, "another order by hand is under way: wait for it, or `gonioctl stop`",
               NULL);
        return;
    }
    c->manual = *order;
    c->manual_pending = true;
}

/* Commands whose outcome is no more than "taken". */
static void obey(struct campaign *c, enum campaign_command command) {
    if (command == COMMAND_PAUSE)
        order_pause(c);
    else if (command == COMMAND_PAUSE_NOW)
        order_pause_now(c);
    else if (command == COMMAND_RESUME)
        order_resume(c);
    else if (command == COMMAND_STOP)
        order_stop(c);
    else {
        c->want.abort |= !campaign_state_is_rest(c->state);
        c->want.interrupt |= command == COMMAND_INTERRUPT;
        stop_axes(c); /* first of all, and without waiting (design 3) */
    }
}

static void dispatch(struct campaign *c, struct desk_order *order) {
    const struct campaign_rule *rule = &campaign_table[c->state][order->command];
    if (!rule->allowed) {
        finish(c, order, ERR_STATE, rule->why, NULL);
        return;
    }
    switch (order->command) {
    case COMMAND_RUN:
        order_run(c, order);
        break;
    case COMMAND_RESUME_SESSION:
        order_resume_session(c, order);
        break;
    case COMMAND_CONTINUE:
        order_continue(c, order);
        break;
    case COMMAND_MANUAL:
        order_manual(c, order);
        break;
    default:
        obey(c, order->command);
        finish(c, order, 0, "", NULL);
    }
}

/* ---- the bench service ---- */

static int64_t due_us(void *self) {
    (void)self;
    return CLOCK_NEVER;
}

static void run(void *self) {
    struct campaign *c = self;
    struct desk_order order;
    desk_campaign_clear(c->setup.desk);
    while (desk_take_order(c->setup.desk, &order)) {
        dispatch(c, &order);
        desk_order_free(&order);
    }
}

static int descriptors(void *self, struct pollfd *fd, int max) {
    const struct campaign *c = self;
    if (max < 1)
        return 0;
    fd[0] = (struct pollfd){.fd = desk_campaign_fd(c->setup.desk), .events = POLLIN};
    return 1;
}

int campaign_queue_start(struct campaign *c, struct err *e) {
    struct bench_service service = {
        .name = "orders", .self = c, .due_us = due_us, .run = run, .descriptors = descriptors};
    atomic_store(&c->utc_s, clock_utc_us(c->clock) / US_PER_S);
    return bench_add(c->bench, &service) < 0 ? err_set(e, ERR_RANGE, "too many services on the bench") : 0;
}
