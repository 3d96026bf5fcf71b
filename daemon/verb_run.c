/* check and run: send the text of a job and of each file it names; run --wait watches it to its end. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "daemon/job.h"
#include "daemon/verb_live.h"

#define PLAN_MS 120000
#define ANSWER_MS 10000
#define LOOK_MS 250 /* between two looks at the status */
#define BAR 28

static json_t *job_params(const char *path, struct err_list *errors) {
    char *text = NULL;
    struct job_file files[JOB_FILES];
    size_t size = 0;
    int n = 0;
    if (job_load_files(path, &text, &size, files, &n, errors) != 0)
        return NULL;
    json_t *list = json_array();
    for (int i = 0; i < n; i++)
        json_array_append_new(
            list, json_pack("{s:s, s:s%}", "name", files[i].name, "text", files[i].text, files[i].size));
    json_t *params =
        json_pack("{s:{s:s, s:s%}, s:o}", "job", "name", path, "text", text, size, "files", list);
    job_files_free(files, n);
    free(text);
    if (!params) {
        struct err e = {0};
        err_at(&e, ERR_INPUT, path, 0, 0, "the job or a file it names is not UTF-8 text");
        err_list_add(errors, &e);
    }
    return params;
}

static int ask(const struct verb_args *args, const char *method, json_t *params, json_t **result) {
    struct err_list errors = {0};
    struct err e = {0};
    int rc = live_call(args, method, params, PLAN_MS, result, &errors, &e);
    int status = rc == 0 ? 0 : verb_fail(&e, &errors);
    err_list_free(&errors);
    return status;
}

/* The texts of all jobs, or every mistake in reading them; 0 or the exit status. */
static int read_jobs(const struct verb_args *args, json_t **all) {
    struct err_list errors = {0};
    struct err e = {0};
    *all = json_array();
    for (int i = 0; i < args->n_operands; i++) {
        json_t *params = job_params(args->operand[i], &errors);
        if (params)
            json_array_append_new(*all, params);
        else
            err_set(&e, ERR_INPUT, "nothing was sent and nothing was started");
    }
    int status = e.code ? verb_fail(&e, &errors) : 0;
    err_list_free(&errors);
    return status;
}

int verb_check(int argc, char **argv) {
    struct verb_args args;
    json_t *plan = NULL, *jobs = NULL;
    int done = verb_parse(argc, argv, NULL, 1, 1, &args);
    if (done >= 0)
        return done;
    int status = read_jobs(&args, &jobs);
    if (status == 0)
        status = ask(&args, "check", json_incref(json_array_get(jobs, 0)), &plan);
    json_decref(jobs);
    if (status == 0 && args.json)
        live_print_json(plan);
    else if (status == 0)
        fputs(json_string_value(json_object_get(plan, "text")) ?: "", stdout);
    json_decref(plan);
    return status;
}

static volatile sig_atomic_t interrupted;

static void on_interrupt(int number) {
    (void)number;
    interrupted = 1;
}

static const json_t *ended(const json_t *status, json_int_t number) {
    size_t i;
    json_t *job;
    json_array_foreach(json_object_get(status, "jobs_ended"), i,
                       job) if (json_integer_value(json_object_get(job, "number")) == number) return job;
    return NULL;
}

/* Columns of the terminal on stderr; 80 where it does not say. */
static int columns(void) {
    struct winsize size = {0};
    return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col ? size.ws_col : 80;
}

/* One line, cut to the terminal's width: a line that wraps could not be drawn over. */
static void draw(const json_t *status) {
    double fraction = json_number_value(json_object_get(json_object_get(status, "progress"), "fraction"));
    const char *state = json_string_value(json_object_get(status, "state"));
    const char *phase = json_string_value(json_object_get(status, "phase"));
    char left[40] = "", line[160];
    int width = columns(), bar = width < 60 ? 8 : BAR, filled = (int)(fraction * bar);
    if (json_object_get(status, "left_s"))
        live_duration(json_number_value(json_object_get(status, "left_s")), left, sizeof left);
    snprintf(line, sizeof line, "[%.*s%*s] %3d %% %s%s%s%s%s", filled, "############################",
             bar - filled, "", (int)(100 * fraction), state ?: "", phase && *phase ? ", " : "", phase ?: "",
             *left ? ", left: " : "", left);
    fprintf(stderr, "\r\033[K%.*s", width - 1, line);
}

static void say_hold(const json_t *status, char *told, size_t size) {
    const char *hold = json_string_value(json_object_get(status, "hold")) ?: "";
    if (*hold && strcmp(hold, told) != 0)
        fprintf(stderr, "\nheld: %s. %s\n", hold,
                json_string_value(json_object_get(status, "hold_next")) ?: "");
    snprintf(told, size, "%s", hold);
}

/* How a job ended: in words, and into `job` for --json. */
static int report_end(const json_t *end, json_t *job, bool json) {
    const char *state = json_string_value(json_object_get(end, "state")) ?: "?";
    const char *why = json_string_value(json_object_get(end, "why"));
    size_t i;
    json_t *session;
    if (!json)
        json_array_foreach(json_object_get(end, "sessions"), i, session)
            printf("%s\n", json_string_value(session) ?: "");
    fprintf(stderr, "%s: %s%s%s\n", json_string_value(json_object_get(end, "name")) ?: "?", state,
            why && *why ? ": " : "", why ?: "");
    json_object_update_missing(job, (json_t *)end);
    return strcmp(state, "done") == 0 ? 0 : 1;
}

/* Looks at the status until the job has ended. Ctrl-C detaches; the campaign goes on. */
static int wait_for(struct rpc_client *client, json_t *job, bool json) {
    json_int_t number = json_integer_value(json_object_get(job, "job"));
    bool bar = isatty(STDERR_FILENO);
    char told[sizeof((struct err *)0)->text] = "";
    for (;;) {
        struct err e = {0};
        json_t *status = NULL, *event = NULL;
        if (rpc_call(client, "status", NULL, ANSWER_MS, &status, NULL, &e) != 0 && !interrupted)
            return verb_fail(&e, NULL);
        const json_t *end = ended(status, number);
        if (bar && !interrupted)
            draw(status);
        say_hold(status, told, sizeof told);
        if (bar && (end || interrupted))
            fprintf(stderr, "\r\033[K");
        int rc = end ? report_end(end, job, json) : 0;
        json_decref(status);
        if (end || interrupted)
            return rc;
        /* This connection watches nothing, so only time passes here, or goniod goes away. */
        rpc_next_event(client, LOOK_MS, &event, &e);
        json_decref(event);
    }
}

static int wait_for_all(const struct verb_args *args, json_t *queued) {
    struct err e = {0};
    struct rpc_client *client;
    int worst = 0;
    size_t i;
    json_t *job;
    if (rpc_connect(&client, args->socket, &e) != 0)
        return verb_fail(&e, NULL);
    signal(SIGINT, on_interrupt);
    json_array_foreach(queued, i, job) {
        int status = interrupted ? 0 : wait_for(client, job, args->json);
        worst = status > worst ? status : worst;
    }
    if (interrupted)
        fprintf(stderr, "detached; the campaign goes on. See: gonioctl status\n");
    rpc_close(client);
    return worst;
}

/* Several jobs are one order: each is checked before the first is queued. */
static int check_all(const struct verb_args *args, const json_t *jobs) {
    int status = 0;
    for (size_t i = 0; json_array_size(jobs) > 1 && status == 0 && i < json_array_size(jobs); i++) {
        json_t *plan = NULL;
        status = ask(args, "check", json_incref(json_array_get(jobs, i)), &plan);
        json_decref(plan);
    }
    return status;
}

static int queue_all(const struct verb_args *args, const json_t *jobs, json_t *queued) {
    int status = 0;
    for (size_t i = 0; status == 0 && i < json_array_size(jobs); i++) {
        json_t *result = NULL;
        status = ask(args, "run", json_incref(json_array_get(jobs, i)), &result);
        if (status == 0 && !args->json)
            fprintf(stderr, "job %lld: %s\n", (long long)json_integer_value(json_object_get(result, "job")),
                    args->operand[i]);
        if (status == 0)
            json_array_append_new(queued, result);
    }
    return status;
}

int verb_run(int argc, char **argv) {
    static const struct verb_option OPTIONS[] = {
        {"--wait", 'w', NULL, "shows progress until the last job has ended"}, {0}};
    struct verb_args args;
    json_t *jobs = NULL, *queued = json_array();
    int status = verb_parse(argc, argv, OPTIONS, 1, VERB_OPERANDS, &args);
    if (status < 0) {
        status = read_jobs(&args, &jobs);
        if (status == 0)
            status = check_all(&args, jobs);
        if (status == 0)
            status = queue_all(&args, jobs, queued);
        if (status == 0 && args.option[0])
            status = wait_for_all(&args, queued);
        if (args.json && json_array_size(queued)) {
            json_t *all = json_pack("{s:O}", "jobs", queued);
            live_print_json(all);
            json_decref(all);
        }
    }
    json_decref(jobs);
    json_decref(queued);
    return status;
}
