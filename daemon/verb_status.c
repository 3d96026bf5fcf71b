/* What goniod does now, in words. */
#include <stdio.h>
#include <string.h>

#include "daemon/verb_live.h"

const char *live_duration(double seconds, char *buffer, size_t size) {
    long s = seconds > 0 ? (long)(seconds + 0.5) : 0;
    if (s >= 3600)
        snprintf(buffer, size, "%ld h %02ld min", s / 3600, s % 3600 / 60);
    else if (s >= 90)
        snprintf(buffer, size, "%ld min", (s + 30) / 60);
    else
        snprintf(buffer, size, "%ld s", s);
    return buffer;
}

static const char *text(const json_t *object, const char *key) {
    return json_string_value(json_object_get(object, key));
}

static void print_progress(const json_t *s) {
    json_t *progress = json_object_get(s, "progress"), *points = json_object_get(s, "points");
    if (json_integer_value(json_object_get(points, "total")) == 0)
        return;
    char left[40], low[40], high[40];
    if (progress)
        printf("  %.0f %% done", 100 * json_number_value(json_object_get(progress, "fraction")));
    if (json_object_get(s, "left_s"))
        printf(", %s left (%s to %s)",
               live_duration(json_number_value(json_object_get(s, "left_s")), left, sizeof left),
               live_duration(json_number_value(json_object_get(s, "left_low_s")), low, sizeof low),
               live_duration(json_number_value(json_object_get(s, "left_high_s")), high, sizeof high));
    if (points)
        printf(", %lld of %lld points (%lld provisional)",
               (long long)json_integer_value(json_object_get(points, "done")),
               (long long)json_integer_value(json_object_get(points, "total")),
               (long long)json_integer_value(json_object_get(points, "provisional")));
    if (progress || points)
        putchar('\n');
}

static void print_spectrometer(const json_t *s) {
    json_t *d = json_object_get(s, "spectrometer");
    if (!d)
        return;
    bool open = json_is_true(json_object_get(d, "open"));
    printf("  spectrometer %s %s", text(d, "model") ?: "", open ? text(d, "serial") ?: "" : "not open");
    if (json_number_value(json_object_get(d, "exposure_ms")) > 0)
        printf(", %.3f ms", json_number_value(json_object_get(d, "exposure_ms")));
    if (json_is_number(json_object_get(d, "temperature_c")))
        printf(", %.1f degC", json_number_value(json_object_get(d, "temperature_c")));
    const json_t *lamp = json_object_get(s, "lamp");
    if (json_is_boolean(lamp))
        printf(", lamp %s", json_is_true(lamp) ? "on" : "off");
    else if (lamp)
        printf(", lamp not known");
    if (json_object_get(d, "age_ms"))
        printf("  (read %.1f s ago)", json_number_value(json_object_get(d, "age_ms")) / 1000);
    putchar('\n');
}

void live_print_status(const json_t *s) {
    const char *job = text(json_object_get(s, "job"), "name");
    size_t i;
    json_t *name;
    printf("%s%s%s%s%s\n", text(s, "state") ?: "starting", job ? ": " : "", job ? job : "",
           text(s, "phase") && *text(s, "phase") ? ", " : "", text(s, "phase") ?: "");
    if (text(s, "hold") && *text(s, "hold"))
        printf("  HELD: %s. %s\n", text(s, "hold"), text(s, "hold_next") ?: "");
    if (text(s, "why") && *text(s, "why"))
        printf("  %s\n", text(s, "why"));
    if (text(s, "warning") && *text(s, "warning") && strcmp(text(s, "warning"), text(s, "why") ?: "") != 0)
        printf("  warning: %s\n", text(s, "warning"));
    print_progress(s);
    live_print_axes(json_object_get(s, "axes"));
    print_spectrometer(s);
    json_array_foreach(json_object_get(s, "sessions"), i, name)
        printf("  session %s\n", json_string_value(name) ?: "");
    if (json_array_size(json_object_get(s, "queue")))
        printf("  %zu more in the queue%s\n", json_array_size(json_object_get(s, "queue")),
               json_is_true(json_object_get(s, "queue_waits"))
                   ? ", waiting for you: `gonioctl continue` lets them go on"
                   : "");
    printf("  snapshot %.1f s old\n", json_number_value(json_object_get(s, "snapshot_age_ms")) / 1000);
}

int verb_status(int argc, char **argv) {
    return live_ask(argc, argv, "status", 10000, NULL, live_print_status);
}

int verb_watch(int argc, char **argv) {
    struct verb_args args;
    struct err e = {0};
    struct rpc_client *client;
    int done = verb_parse(argc, argv, NULL, 0, 0, &args);
    if (done >= 0)
        return done;
    if (rpc_connect(&client, args.socket, &e) != 0)
        return verb_fail(&e, NULL);
    int rc = rpc_call(client, "watch", NULL, 10000, NULL, NULL, &e);
    while (rc == 0) {
        json_t *event;
        rc = rpc_next_event(client, -1, &event, &e);
        if (rc == 0) {
            live_print_json(event);
            fflush(stdout);
            json_decref(event);
        }
    }
    rpc_close(client);
    return verb_fail(&e, NULL);
}
