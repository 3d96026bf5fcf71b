/* A plan may take longer than the control thread can spare, so it is made in one of libuv's workers. */
#include <stdlib.h>

#include "daemon/control_private.h"
#include "proto/rpc.h"

struct check {
    uv_work_t work;
    struct control *control;
    uint64_t client;
    json_t *id;
    struct desk_order order; /* owns the job's text */
    json_t *plan;
    struct err_list errors;
};

static void plan(uv_work_t *work) {
    struct check *k = work->data;
    const struct control_options *options = &k->control->options;
    k->plan = options->check(options->arg, &k->order.run, &k->errors);
}

static char *refusal(const struct check *k) {
    struct err e = {0};
    err_set(&e, ERR_INPUT, "the job has %zu mistake%s; nothing was started", k->errors.n,
            k->errors.n == 1 ? "" : "s");
    return rpc_error_text(k->id, rpc_code_of(&e), &e, &k->errors);
}

static void answer(uv_work_t *work, int status) {
    struct check *k = work->data;
    struct control_client *c = control_find_client(k->control, k->client);
    if (c)
        control_client_settle(c, status != 0 ? NULL : k->plan ? rpc_reply_text(k->id, k->plan) : refusal(k));
    json_decref(k->plan);
    json_decref(k->id);
    err_list_free(&k->errors);
    desk_order_free(&k->order);
    free(k);
}

void control_check(struct control_client *c, const json_t *id, struct desk_run *run) {
    struct check *k = calloc(1, sizeof *k);
    struct desk_order order = {.command = COMMAND_RUN, .run = *run};
    if (!k) {
        desk_order_free(&order);
        return;
    }
    k->work.data = k;
    k->control = c->control;
    k->client = c->number;
    k->id = json_deep_copy(id);
    k->order = order;
    c->owed++;
    if (uv_queue_work(&c->control->loop, &k->work, plan, answer) != 0)
        answer(&k->work, UV_ECANCELED);
}
