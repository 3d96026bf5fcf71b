/* Every method of the socket is one row of METHODS: its right, its parameters, what it does. */
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/control_private.h"
#include "proto/rpc.h"

#define PARAMS_MAX 4
#define EVENTS_AT_ONCE 64

enum param_type { PARAM_STRING, PARAM_NUMBER, PARAM_BOOL, PARAM_OBJECT, PARAM_ARRAY };
static const char *const PARAM_TYPES[] = {"a string", "a number", "true or false", "an object", "an array"};

struct param {
    const char *name;
    enum param_type type;
    bool required;
};

struct method {
    const char *name;
    bool operate; /* else watch */
    struct param param[PARAMS_MAX];
    /* Answers at once (order NULL) or fills in an order whose outcome will be the answer. */
    void (*answer)(struct control_client *c, const struct rpc_request *rq);
    int (*order)(const json_t *params, struct desk_order *order, struct err *e);
    const char *doc;
};

static const struct method METHODS[];

static void reply_error(struct control_client *c, const json_t *id, int code, const struct err *e) {
    control_client_send(c, rpc_error_text(id, code, e, NULL));
}

/* ---- answered at once ---- */

static json_t *param_list(const struct method *m) {
    json_t *list = json_array();
    for (const struct param *p = m->param; p->name; p++)
        json_array_append_new(list, json_pack("{s:s, s:s, s:b}", "name", p->name, "type",
                                              PARAM_TYPES[p->type], "required", p->required));
    return list;
}

static void answer_methods(struct control_client *c, const struct rpc_request *rq) {
    json_t *list = json_array();
    for (const struct method *m = METHODS; m->name; m++)
        json_array_append_new(list, json_pack("{s:s, s:s, s:o, s:s}", "name", m->name, "right",
                                              m->operate ? "operate" : "watch", "params", param_list(m),
                                              "doc", m->doc));
    control_client_send(c, rpc_reply_text(rq->id, list));
    json_decref(list);
}

static void answer_version(struct control_client *c, const struct rpc_request *rq) {
    json_t *v = json_pack("{s:s, s:s, s:b}", "goniod", GONIOD_VERSION, "you", c->rights.who, "may_operate",
                          c->rights.operate);
    control_client_send(c, rpc_reply_text(rq->id, v));
    json_decref(v);
}

/* The snapshot is text already; splicing it in spares fifty clients a parse and a dump each. */
static void answer_status(struct control_client *c, const struct rpc_request *rq) {
    struct control *control = c->control;
    const struct desk_snapshot *s = desk_snapshot_get(control->options.desk);
    if (s->serial != control->snapshot_serial) {
        control->snapshot_serial = s->serial;
        control->snapshot_at_ms = uv_now(&control->loop);
    }
    char *id = json_dumps(rq->id, JSON_ENCODE_ANY | JSON_COMPACT);
    char *text = NULL;
    bool empty = s->size <= 2;
    if (asprintf(&text, "{\"jsonrpc\":\"2.0\",\"id\":%s,\"result\":{\"snapshot_age_ms\":%llu%s%s}\n",
                 id ? id : "null", (unsigned long long)(uv_now(&control->loop) - control->snapshot_at_ms),
                 empty ? "" : ",", s->json + 1) < 0)
        text = NULL;
    desk_snapshot_put(s);
    free(id);
    control_client_send(c, text);
}

static void answer_watch(struct control_client *c, const struct rpc_request *rq) {
    c->watching = json_object_get(rq->params, "on") != json_false();
    json_t *result =
        json_pack("{s:b, s:I}", "watching", c->watching, "last_event", (json_int_t)c->control->last_event);
    control_client_send(c, rpc_reply_text(rq->id, result));
    json_decref(result);
}

/* ---- orders ---- */

static int copy_name(char *to, size_t size, const json_t *value, const char *what, struct err *e) {
    const char *text = json_string_value(value);
    if (strlen(text) >= size)
        return err_set(e, ERR_USAGE, "the %s is longer than %zu characters", what, size - 1);
    strcpy(to, text);
    return 0;
}

static char *copy_text(const json_t *value, size_t *size) {
    *size = json_string_length(value);
    char *text = malloc(*size + 1);
    if (text)
        memcpy(text, json_string_value(value), *size + 1);
    return text;
}

static int take_file(const json_t *file, struct job_file *to, struct err *e) {
    json_t *name = json_object_get(file, "name"), *text = json_object_get(file, "text");
    if (!json_is_string(name) || !json_is_string(text))
        return err_set(e, ERR_USAGE, "each of \"files\" must be {\"name\": ..., \"text\": ...}");
    int rc = copy_name(to->name, sizeof to->name, name, "name of a file", e);
    if (rc == 0 && !(to->text = copy_text(text, &to->size)))
        rc = err_set(e, ERR_NOMEM, "no memory for %s", to->name);
    return rc;
}

static int order_run(const json_t *params, struct desk_order *order, struct err *e) {
    const json_t *job = json_object_get(params, "job"), *files = json_object_get(params, "files");
    const json_t *name = json_object_get(job, "name"), *text = json_object_get(job, "text");
    order->command = COMMAND_RUN;
    if (!json_is_string(name) || !json_is_string(text))
        return err_set(e, ERR_USAGE, "\"job\" must be {\"name\": FILE NAME, \"text\": YAML}");
    if (json_array_size(files) > JOB_FILES)
        return err_set(e, ERR_USAGE, "a job may name at most %d files", JOB_FILES);
    int rc = copy_name(order->run.name, sizeof order->run.name, name, "name of the job file", e);
    if (rc == 0 && !(order->run.text = copy_text(text, &order->run.size)))
        rc = err_set(e, ERR_NOMEM, "no memory for the job");
    for (size_t i = 0; rc == 0 && i < json_array_size(files); i++)
        rc = take_file(json_array_get(files, i), &order->run.file[order->run.n_files++], e);
    return rc;
}

static int order_pause(const json_t *params, struct desk_order *order, struct err *e) {
    (void)e;
    order->command = json_is_true(json_object_get(params, "now")) ? COMMAND_PAUSE_NOW : COMMAND_PAUSE;
    return 0;
}

static void drop_ending(char *name) {
    size_t n = strlen(name);
    if (n > 6 && strcmp(name + n - 6, ".gonio") == 0)
        name[n - 6] = '\0';
}

static int order_resume(const json_t *params, struct desk_order *order, struct err *e) {
    const json_t *session = json_object_get(params, "session");
    order->command = session ? COMMAND_RESUME_SESSION : COMMAND_RESUME;
    if (!session)
        return 0;
    if (strchr(json_string_value(session), '/'))
        return err_set(e, ERR_USAGE, "a session is resumed by its name, not by a path: %s",
                       json_string_value(session));
    int rc = copy_name(order->session.name, sizeof order->session.name, session, "name of the session", e);
    if (rc == 0)
        drop_ending(order->session.name); /* `gonioctl sessions` prints the file's name */
    return rc;
}

static int order_continue(const json_t *params, struct desk_order *order, struct err *e) {
    (void)params;
    (void)e;
    order->command = COMMAND_CONTINUE;
    return 0;
}

static int order_abort(const json_t *params, struct desk_order *order, struct err *e) {
    (void)params;
    (void)e;
    order->command = COMMAND_ABORT;
    return 0;
}

static int order_stop(const json_t *params, struct desk_order *order, struct err *e) {
    (void)params;
    (void)e;
    order->command = COMMAND_STOP;
    return 0;
}

static int manual(enum desk_manual_kind kind, const json_t *params, struct desk_order *order, struct err *e) {
    struct desk_manual *m = &order->manual;
    const json_t *axis = json_object_get(params, "axis"), *answer = json_object_get(params, "answer");
    order->command = COMMAND_MANUAL;
    m->kind = kind;
    m->deg = json_number_value(json_object_get(params, "deg"));
    double average = json_number_value(json_object_get(params, "average"));
    m->average = average > 0 ? (int)fmin(average, INT_MAX) : 0;
    m->exposure_ms = json_number_value(json_object_get(params, "exposure_ms"));
    m->lamp = json_object_get(params, "lamp") != json_false();
    int rc = axis ? copy_name(m->axis, sizeof m->axis, axis, "name of the axis", e) : 0;
    return rc == 0 && answer ? copy_name(m->answer, sizeof m->answer, answer, "answer", e) : rc;
}

static int order_devices(const json_t *params, struct desk_order *order, struct err *e) {
    return manual(MANUAL_DEVICES, params, order, e);
}

static int order_where(const json_t *params, struct desk_order *order, struct err *e) {
    return manual(MANUAL_WHERE, params, order, e);
}

static int order_home(const json_t *params, struct desk_order *order, struct err *e) {
    return manual(MANUAL_HOME, params, order, e);
}

static int order_move(const json_t *params, struct desk_order *order, struct err *e) {
    return manual(MANUAL_MOVE, params, order, e);
}

static int order_spectrum(const json_t *params, struct desk_order *order, struct err *e) {
    return manual(MANUAL_SPECTRUM, params, order, e);
}

static int order_commission(const json_t *params, struct desk_order *order, struct err *e) {
    return manual(MANUAL_COMMISSION, params, order, e);
}

static void answer_check(struct control_client *c, const struct rpc_request *rq) {
    struct desk_order order = {0};
    struct err e = {0};
    if (order_run(rq->params, &order, &e) == 0) {
        control_check(c, rq->id, &order.run);
        return;
    }
    reply_error(c, rq->id, RPC_PARAMS, &e);
    desk_order_free(&order);
}

#define JOB_PARAMS                                                                                           \
    {                                                                                                        \
        {"job", PARAM_OBJECT, true}, {                                                                       \
            "files", PARAM_ARRAY, false                                                                      \
        }                                                                                                    \
    }

static const struct method METHODS[] = {
    {"methods", false, {{0}}, answer_methods, NULL, "this list"},
    {"version", false, {{0}}, answer_version, NULL, "goniod's version and what you may do"},
    {"status",
     false,
     {{0}},
     answer_status,
     NULL,
     "the snapshot: state, progress, devices, the age of each reading"},
    {"watch", false, {{"on", PARAM_BOOL, false}}, answer_watch, NULL, "events from now on, or no more"},
    {"check", false, JOB_PARAMS, answer_check, NULL, "the plan of a job, or all its mistakes; nothing moves"},
    {"run", true, JOB_PARAMS, NULL, order_run, "queues a job"},
    {"pause",
     true,
     {{"now", PARAM_BOOL, false}},
     NULL,
     order_pause,
     "after the current exposure set, or now"},
    {"resume",
     true,
     {{"session", PARAM_STRING, false}},
     NULL,
     order_resume,
     "the paused campaign, or a session that was cut off"},
    {"continue", true, {{0}}, NULL, order_continue, "a person has done what the hold asked for"},
    {"abort", true, {{0}}, NULL, order_abort, "stops every axis, shuts the shutter, ends the campaign"},
    {"stop", true, {{0}}, NULL, order_stop, "stops every axis now; a campaign is then paused"},
    {"devices", true, {{0}}, NULL, order_devices, "what answers on USB and on each bus"},
    {"where", false, {{0}}, NULL, order_where, "where each axis stands"},
    {"home", true, {{"axis", PARAM_STRING, true}}, NULL, order_home, "homes an axis"},
    {"move",
     true,
     {{"axis", PARAM_STRING, true}, {"deg", PARAM_NUMBER, true}},
     NULL,
     order_move,
     "moves an axis to an angle"},
    {"spectrum",
     true,
     {{"average", PARAM_NUMBER, false}, {"exposure_ms", PARAM_NUMBER, false}, {"lamp", PARAM_BOOL, false}},
     NULL,
     order_spectrum,
     "takes a spectrum"},
    {"commission",
     true,
     {{"axis", PARAM_STRING, true}, {"answer", PARAM_STRING, false}},
     NULL,
     order_commission,
     "the next step of commissioning an axis"},
    {0}};

/* ---- dispatch ---- */

static bool fits(enum param_type type, const json_t *v) {
    switch (type) {
    case PARAM_STRING:
        return json_is_string(v);
    case PARAM_NUMBER:
        return json_is_number(v);
    case PARAM_BOOL:
        return json_is_boolean(v);
    case PARAM_OBJECT:
        return json_is_object(v);
    case PARAM_ARRAY:
        return json_is_array(v);
    }
    return false;
}

static const struct param *param_find(const struct method *m, const char *name) {
    const struct param *p = m->param;
    while (p->name && strcmp(p->name, name) != 0)
        p++;
    return p->name ? p : NULL;
}

static int check_params(const struct method *m, json_t *params, struct err *e) {
    const char *name;
    json_t *value;
    json_object_foreach(params, name, value) {
        const struct param *p = param_find(m, name);
        if (!p)
            return err_set(e, ERR_USAGE, "%s has no parameter \"%.40s\"; the method \"methods\" lists them",
                           m->name, name);
        if (!fits(p->type, value))
            return err_set(e, ERR_USAGE, "\"%s\" of %s must be %s", name, m->name, PARAM_TYPES[p->type]);
    }
    for (const struct param *p = m->param; p->name; p++)
        if (p->required && !json_object_get(params, p->name))
            return err_set(e, ERR_USAGE, "%s needs the parameter \"%s\", %s", m->name, p->name,
                           PARAM_TYPES[p->type]);
    return 0;
}

static const struct method *method_find(const char *name) {
    const struct method *m = METHODS;
    while (m->name && strcmp(m->name, name) != 0)
        m++;
    return m->name ? m : NULL;
}

static struct control_pending *free_pending(struct control *control) {
    for (int i = 0; i < DESK_ORDERS; i++)
        if (control->pending[i].ticket == 0)
            return &control->pending[i];
    return NULL;
}

static void put_on_desk(struct control_client *c, const struct method *m, const struct rpc_request *rq) {
    struct desk_order order = {0};
    struct err e = {0};
    struct control_pending *p = free_pending(c->control);
    int rc = p ? m->order(rq->params, &order, &e)
               : err_set(&e, ERR_BUSY, "64 orders wait already; try again soon");
    if (rc == 0)
        rc = desk_post(c->control->options.desk, &order, &p->ticket, &e);
    if (rc != 0) {
        desk_order_free(&order);
        reply_error(c, rq->id, e.code == ERR_USAGE ? RPC_PARAMS : rpc_code_of(&e), &e);
        return;
    }
    if (m->operate)
        fprintf(stderr, "goniod: %s by %s\n", m->name, c->rights.who);
    p->client = c->number;
    p->id = json_incref(rq->id);
    c->owed++;
}

static void call(struct control_client *c, const struct rpc_request *rq) {
    const struct method *m = method_find(rq->method);
    struct err e = {0};
    if (!m) {
        err_set(&e, ERR_USAGE, "there is no method \"%.40s\"; the method \"methods\" lists all", rq->method);
        reply_error(c, rq->id, RPC_METHOD, &e);
    } else if (m->operate && !c->rights.operate) {
        err_set(&e, ERR_PERMISSION,
                "not allowed: %s needs a group named under access.operate of goniod.yaml, and you are %s",
                m->name, c->rights.who);
        reply_error(c, rq->id, rpc_code_of(&e), &e);
    } else if (check_params(m, rq->params, &e) != 0) {
        reply_error(c, rq->id, RPC_PARAMS, &e);
    } else if (m->answer) {
        m->answer(c, rq);
    } else {
        put_on_desk(c, m, rq);
    }
}

void control_handle_line(struct control_client *c, const char *line, size_t size) {
    struct rpc_request rq;
    struct err e = {0};
    int code = rpc_parse(line, size, &rq, &e);
    if (code != 0)
        reply_error(c, rq.id, code, &e);
    else if (!rq.id) {
        err_set(&e, ERR_USAGE, "a request needs an \"id\", so that its answer can be told apart");
        reply_error(c, NULL, RPC_REQUEST, &e);
    } else {
        call(c, &rq);
    }
    rpc_request_free(&rq);
}

/* ---- from the desk ---- */

static char *outcome_text(const json_t *id, const struct desk_outcome *o) {
    json_t *json = o->json ? json_loads(o->json, 0, NULL) : NULL;
    char *text;
    if (o->code == 0) {
        json_t *result = json ? json_incref(json) : json_object();
        text = rpc_reply_text(id, result);
        json_decref(result);
    } else {
        struct err e = {0};
        struct err_list errors = {0};
        err_set(&e, (enum err_code)abs(o->code), "%s", o->text);
        rpc_read_mistakes(json, &errors);
        text = rpc_error_text(id, rpc_code_of(&e), &e, &errors);
        err_list_free(&errors);
    }
    json_decref(json);
    return text;
}

static void deliver(struct control *control, const struct desk_outcome *o) {
    for (int i = 0; i < DESK_ORDERS; i++) {
        struct control_pending *p = &control->pending[i];
        if (p->ticket != o->ticket)
            continue;
        struct control_client *c = control_find_client(control, p->client);
        if (c)
            control_client_settle(c, outcome_text(p->id, o));
        json_decref(p->id);
        *p = (struct control_pending){0};
        return;
    }
}

static void broadcast(struct control *control, const struct desk_event *event) {
    json_t *params = event->json ? json_loads(event->json, 0, NULL) : NULL;
    if (!params)
        params = json_object();
    json_object_set_new(params, "event", json_string(event->kind));
    json_object_set_new(params, "serial", json_integer(event->serial));
    char *text = rpc_event_text(params);
    for (struct control_client *c = control->clients, *next; text && c; c = next) {
        next = c->next;
        control_client_event(c, text, strlen(text));
    }
    free(text);
    json_decref(params);
}

static void send_events(struct control *control) {
    struct desk_event events[EVENTS_AT_ONCE];
    int n;
    while ((n = desk_events_after(control->options.desk, control->last_event, events, EVENTS_AT_ONCE)) > 0) {
        for (int i = 0; i < n; i++) {
            broadcast(control, &events[i]);
            control->last_event = events[i].serial;
            desk_event_free(&events[i]);
        }
    }
}

void control_take_from_desk(struct control *control) {
    struct desk_outcome outcome;
    desk_control_clear(control->options.desk);
    /* Events first: whoever waits for the outcome of an order has then seen what led to it. */
    send_events(control);
    while (desk_take_outcome(control->options.desk, &outcome)) {
        deliver(control, &outcome);
        free(outcome.json);
    }
}
