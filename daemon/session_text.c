#include "daemon/session_text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

int session_text_json(struct session *s, const char *key, json_t **json, struct err *e) {
    char *text;
    json_error_t problem;
    *json = NULL;
    int rc = session_get_text(s, key, &text, e);
    if (rc < 0 || !text)
        return rc;
    *json = json_loads(text, JSON_DECODE_ANY, &problem);
    if (!*json)
        rc = err_set(e, ERR_INPUT, "the session's text '%s' is no JSON: %s", key, problem.text);
    free(text);
    return rc;
}

struct last_state {
    char *state;
    size_t size;
};

/* "state" says where the campaign went; "end" is written last, just before the file is closed. */
static int see_event(void *arg, int64_t us, const char *kind, const char *text) {
    struct last_state *last = arg;
    (void)us;
    const char *member = strcmp(kind, "state") == 0 ? "to" : strcmp(kind, "end") == 0 ? "state" : NULL;
    json_t *json = member ? json_loads(text, 0, NULL) : NULL;
    const char *state = json_string_value(json_object_get(json, member));
    if (state)
        snprintf(last->state, last->size, "%s", state);
    json_decref(json);
    return 0;
}

static bool is_an_end(const char *state) {
    static const char *const ends[] = {"done", "aborted", "failed", "interrupted"};
    for (size_t i = 0; i < sizeof ends / sizeof ends[0]; i++)
        if (strcmp(state, ends[i]) == 0)
            return true;
    return false;
}

int session_text_state(struct session *s, char *state, size_t size, struct err *e) {
    snprintf(state, size, "unknown");
    bool written = session_is_written(s); /* before its events: the end is written before the lock goes */
    int rc = session_each_event(s, see_event, &(struct last_state){state, size}, e);
    if (rc == 0 && !is_an_end(state) && !written)
        snprintf(state, size, "interrupted");
    return rc;
}

const char *session_text_utc(int64_t utc_us, char *buffer, size_t size) {
    time_t seconds = (time_t)(utc_us / 1000000);
    struct tm tm;
    gmtime_r(&seconds, &tm);
    strftime(buffer, size, "%Y-%m-%d %H:%M:%S", &tm);
    return buffer;
}
