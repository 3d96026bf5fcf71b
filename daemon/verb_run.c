/* check and run: send the text of a job and of each file it names; run --wait watches it to its end. */
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
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

/* Sends one job; 0 or the exit status. */
static int send_job(const struct verb_args *args, const char *method, const char *path, json_t **result) {
    struct err_list errors = {0};
    struct err e = {0};
    json_t *params = job_params(path, &errors);
    if (!params)
        err_set(&e, ERR_INPUT, "%s was not sent; nothing was started", path);
    int rc = params ? live_call(args, method, params, PLAN_MS, result, &errors, &e) : -ERR_INPUT;
    int status = rc == 0 ? 0 : verb_fail(&e, &errors);
    err_list_free(&errors);
    return status;
}

int verb_check(int argc, char **argv) {
    struct verb_args args;
    json_t *plan = NULL;
    int done = verb_parse(argc, argv, NULL, 1, 1, &args);
    if (done >= 0)
        return done;
    int status = send_job(&args, "check", args.operand[0], &plan);
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

static void draw(const json_t *status) {
    double fraction = json_number_value(json_object_get(json_object_get(status, "progress"), "fraction"));
    const char *state = json_string_value(json_object_get(status, "state"));
    const char *phase = json_string_value(json_object_get(status, "phase"));
    char left[40] = "";
    int filled = (int)(fraction * BAR);
    if (json_object_get(status, "left_s"))
        live_duration(json_number_value(json_object_get(status, "left_s")), left, sizeof left);
    fprintf(stderr, "\r\033[K[%.*s%*s] %3d %% %s%s%s%s%s", filled, "############################",
            BAR - filled, "", (int)(100 * fraction), state ?: "", phase && *phase ? ", " : "", phase ?: "",
            *left ? ", left: " : "", left);
}

static void say_hold(const json_t *status, char *told, size_t size) {
    const char *hold = json_string_value(json_object_get(status, "hold")) ?: "";
    if (*hold && strcmp(hold, told) != 0)
        fprintf(stderr, "\nheld for you: %s. Then: gonioctl continue\n", hold);
    snprintf(told, size, "%s", hold);
}

static int report_end(const json_t *job) {
    const char *state = json_string_value(json_object_get(job, "state")) ?: "?";
    const char *why = json_string_value(json_object_get(job, "why"));
    size_t i;
    json_t *session;
    json_array_foreach(json_object_get(job, "sessions"), i, session)
        printf("%s\n", json_string_value(session) ?: "");
    fprintf(stderr, "%s: %s%s%s\n", json_string_value(json_object_get(job, "name")) ?: "?", state,
            why && *why ? ": " : "", why ?: "");
    return strcmp(state, "done") == 0 ? 0 : 1;
}

/* Looks at the status until the job has ended. Ctrl-C detaches; the campaign goes on. */
static int wait_for(struct rpc_client *client, json_int_t number) {
    bool bar = isatty(STDERR_FILENO);
    char told[256] = "";
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
        int rc = end ? report_end(end) : 0;
        json_decref(status);
        if (end || interrupted)
            return rc;
        /* This connection watches nothing, so only time passes here, or goniod goes away. */
        rpc_next_event(client, LOOK_MS, &event, &e);
        json_decref(event);
    }
}

static int wait_for_all(const struct verb_args *args, const json_int_t *number, int n) {
    struct err e = {0};
    struct rpc_client *client;
    int worst = 0;
    if (rpc_connect(&client, args->socket, &e) != 0)
        return verb_fail(&e, NULL);
    signal(SIGINT, on_interrupt);
    for (int i = 0; i < n && !interrupted; i++) {
        int status = wait_for(client, number[i]);
        worst = status > worst ? status : worst;
    }
    if (interrupted)
        fprintf(stderr, "detached; the campaign goes on. See: gonioctl status\n");
    rpc_close(client);
    return worst;
}

int verb_run(int argc, char **argv) {
    static const struct verb_option OPTIONS[] = {
        {"--wait", 'w', NULL, "shows progress until the last job has ended"}, {0}};
    struct verb_args args;
    int done = verb_parse(argc, argv, OPTIONS, 1, VERB_OPERANDS, &args);
    if (done >= 0)
        return done;
    json_int_t number[VERB_OPERANDS];
    for (int i = 0; i < args.n_operands; i++) {
        json_t *result = NULL;
        int status = send_job(&args, "run", args.operand[i], &result);
        if (status != 0)
            return status;
        number[i] = json_integer_value(json_object_get(result, "job"));
        if (args.json)
            live_print_json(result);
        else
            fprintf(stderr, "job %lld: %s\n", (long long)number[i], args.operand[i]);
        json_decref(result);
    }
    return args.option[0] ? wait_for_all(&args, number, args.n_operands) : 0;
}
