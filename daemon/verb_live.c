/* Verbs that are one request to goniod and one answer. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/verb_live.h"
#include "proto/number.h"

#define ANSWER_MS 10000
#define DEVICES_MS 60000           /* each unit of each bus may time out */
#define MANUAL_MS (10 * 60 * 1000) /* a homing axis may search for minutes */

int live_call(const struct verb_args *args, const char *method, json_t *params, int silence_ms,
              json_t **result, struct err_list *errors, struct err *e) {
    struct rpc_client *client;
    int rc = rpc_connect(&client, args->socket, e);
    if (rc != 0) {
        json_decref(params);
        return rc;
    }
    rc = rpc_call(client, method, params, silence_ms, result, errors, e);
    rpc_close(client);
    return rc;
}

void live_print_json(const json_t *value) {
    json_dumpf(value, stdout, JSON_COMPACT | JSON_ENCODE_ANY);
    putchar('\n');
}

int live_ask(int argc, char **argv, const char *method, int silence_ms, const char *part,
             void (*print)(const json_t *)) {
    struct verb_args args;
    struct err e = {0};
    json_t *result = NULL;
    int done = verb_parse(argc, argv, NULL, 0, 0, &args);
    if (done >= 0)
        return done;
    if (live_call(&args, method, NULL, silence_ms, &result, NULL, &e) != 0)
        return verb_fail(&e, NULL);
    const json_t *shown = part ? json_object_get(result, part) : result;
    if (args.json)
        live_print_json(shown ? shown : json_null());
    else
        print(shown);
    json_decref(result);
    return 0;
}

/* Sends and prints `said` (or the JSON answer with --json). */
static int command(const struct verb_args *args, const char *method, json_t *params, const char *said) {
    struct err e = {0};
    json_t *result = NULL;
    if (live_call(args, method, params, MANUAL_MS, &result, NULL, &e) != 0)
        return verb_fail(&e, NULL);
    if (args->json)
        live_print_json(result);
    else
        puts(said);
    json_decref(result);
    return 0;
}

int verb_pause(int argc, char **argv) {
    static const struct verb_option OPTIONS[] = {
        {"--now", 0, NULL, "drops the current exposure set and stops the axes"}, {0}};
    struct verb_args args;
    int done = verb_parse(argc, argv, OPTIONS, 0, 0, &args);
    if (done >= 0)
        return done;
    return command(&args, "pause", json_pack("{s:b}", "now", args.option[0] != NULL),
                   args.option[0] ? "pausing now" : "pausing after the current exposure set");
}

int verb_resume(int argc, char **argv) {
    struct verb_args args;
    int done = verb_parse(argc, argv, NULL, 0, 1, &args);
    if (done >= 0)
        return done;
    json_t *params = args.n_operands ? json_pack("{s:s}", "session", args.operand[0]) : NULL;
    return command(&args, "resume", params, "resumed");
}

static int plain(int argc, char **argv, const char *method, const char *said) {
    struct verb_args args;
    int done = verb_parse(argc, argv, NULL, 0, 0, &args);
    return done >= 0 ? done : command(&args, method, NULL, said);
}

int verb_abort(int argc, char **argv) {
    return plain(argc, argv, "abort", "aborting: axes are ordered to stop, then the lamp goes off");
}

int verb_continue(int argc, char **argv) {
    return plain(argc, argv, "continue", "goes on");
}

int verb_stop(int argc, char **argv) {
    return plain(argc, argv, "stop", "stop ordered on every axis");
}

static void print_axis(const char *name, const json_t *a) {
    json_t *alarm = json_object_get(a, "alarm");
    printf("  %-8s", name);
    if (json_is_number(json_object_get(a, "position_deg")))
        printf("%10.3f deg", json_number_value(json_object_get(a, "position_deg")));
    printf("  %s", json_string_value(json_object_get(a, "phase")) ?: "");
    if (json_is_false(json_object_get(a, "connected")))
        printf(", NOT CONNECTED");
    if (json_is_false(json_object_get(a, "valid")))
        printf(", position not valid: home or commission it");
    if (json_is_false(json_object_get(a, "stop_confirmed")))
        printf(", STOP NOT CONFIRMED");
    if (json_integer_value(alarm))
        printf(", ALARM %02llXh %s", json_integer_value(alarm),
               json_string_value(json_object_get(a, "alarm_text")) ?: "");
    if (json_is_number(json_object_get(a, "age_ms")))
        printf("  (read %.1f s ago)", json_number_value(json_object_get(a, "age_ms")) / 1000);
    putchar('\n');
}

void live_print_axes(const json_t *axes) {
    const char *name;
    json_t *axis;
    json_object_foreach((json_t *)axes, name, axis) print_axis(name, axis);
}

int verb_where(int argc, char **argv) {
    return live_ask(argc, argv, "where", ANSWER_MS, "axes", live_print_axes);
}

int verb_home(int argc, char **argv) {
    struct verb_args args;
    int done = verb_parse(argc, argv, NULL, 1, 1, &args);
    return done >= 0 ? done : command(&args, "home", json_pack("{s:s}", "axis", args.operand[0]), "homed");
}

int verb_move(int argc, char **argv) {
    struct verb_args args;
    int done = verb_parse(argc, argv, NULL, 2, 2, &args);
    if (done >= 0)
        return done;
    double deg;
    if (!number_read_double(args.operand[1], &deg) || !isfinite(deg)) {
        fprintf(stderr, "gonioctl: move: '%s' is not an angle in degrees\n", args.operand[1]);
        return 2;
    }
    return command(&args, "move", json_pack("{s:s, s:f}", "axis", args.operand[0], "deg", deg),
                   "there, and settled");
}

static const char *word(const json_t *object, const char *key) {
    return json_string_value(json_object_get(object, key)) ?: "";
}

static void print_usb(const json_t *d) {
    if (json_object_get(d, "error")) {
        printf("  USB: %s\n", word(d, "error"));
        return;
    }
    printf("  USB %s  %s %s%s%s\n", word(d, "path"), word(d, "model"), word(d, "serial"),
           json_is_false(json_object_get(d, "can_open")) ? ", no permission: install drivers/60-goniod.rules"
                                                         : "",
           json_is_true(json_object_get(d, "busy")) ? ", held by another process" : "");
}

static void print_devices(const json_t *result) {
    size_t i;
    json_t *d, *s = json_object_get(result, "spectrometer");
    json_array_foreach(json_object_get(result, "usb"), i, d) print_usb(d);
    printf("  %s  spectrometer %s  %s\n", word(s, "link"), word(s, "model"), word(s, "answer"));
    json_array_foreach(json_object_get(result, "axes"), i, d)
        printf("  %s unit %lld  %s  %s\n", word(d, "link"),
               (long long)json_integer_value(json_object_get(d, "unit")), word(d, "axis"), word(d, "answer"));
}

int verb_devices(int argc, char **argv) {
    return live_ask(argc, argv, "devices", DEVICES_MS, NULL, print_devices);
}

static void print_queue(const json_t *queue) {
    size_t i;
    json_t *job;
    if (json_array_size(queue) == 0)
        puts("no job waits");
    json_array_foreach(queue, i, job)
        printf("  %lld  %s\n", (long long)json_integer_value(json_object_get(job, "number")),
               json_string_value(json_object_get(job, "name")) ?: "?");
}

int verb_queue(int argc, char **argv) {
    return live_ask(argc, argv, "status", ANSWER_MS, "queue", print_queue);
}
