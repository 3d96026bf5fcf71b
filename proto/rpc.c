#include "proto/rpc.h"

#include <stdlib.h>
#include <string.h>

static int refuse(int code, struct err *e, const char *sentence) {
    err_set(e, ERR_INPUT, "%s", sentence);
    return code;
}

int rpc_parse(const char *line, size_t size, struct rpc_request *rq, struct err *e) {
    json_error_t why;
    memset(rq, 0, sizeof *rq);
    rq->root = json_loadb(line, size, JSON_REJECT_DUPLICATES, &why);
    if (!rq->root) {
        err_set(e, ERR_INPUT, "the line is not one JSON object: %s at byte %d", why.text, why.position);
        return RPC_PARSE;
    }
    if (!json_is_object(rq->root))
        return refuse(RPC_REQUEST, e,
                      "a request is a JSON object, one a line; arrays (batches) are not taken");
    json_t *id = json_object_get(rq->root, "id");
    if (id && !json_is_string(id) && !json_is_number(id))
        return refuse(RPC_REQUEST, e, "\"id\" must be a number or a string");
    rq->id = id;
    const char *version = json_string_value(json_object_get(rq->root, "jsonrpc"));
    if (!version || strcmp(version, "2.0") != 0)
        return refuse(RPC_REQUEST, e, "\"jsonrpc\" must be \"2.0\"");
    rq->method = json_string_value(json_object_get(rq->root, "method"));
    if (!rq->method)
        return refuse(RPC_REQUEST, e, "\"method\" must be a string; the method \"methods\" lists all");
    rq->params = json_object_get(rq->root, "params");
    if (rq->params && !json_is_object(rq->params))
        return refuse(RPC_PARAMS, e, "\"params\" must be an object with named values");
    return 0;
}

void rpc_request_free(struct rpc_request *rq) {
    json_decref(rq->root);
    memset(rq, 0, sizeof *rq);
}

/* Takes the message over. */
static char *line_text(json_t *message) {
    size_t size = json_dumpb(message, NULL, 0, JSON_COMPACT);
    char *text = size ? malloc(size + 2) : NULL;
    if (text) {
        json_dumpb(message, text, size, JSON_COMPACT);
        text[size] = '\n';
        text[size + 1] = '\0';
    }
    json_decref(message);
    return text;
}

/* jansson's reference count is the one thing a borrowed value has changed. */
static json_t *shared(const json_t *value) {
    return value ? json_incref((json_t *)value) : json_null();
}

char *rpc_reply_text(const json_t *id, const json_t *result) {
    return line_text(
        json_pack("{s:s, s:o, s:o}", "jsonrpc", "2.0", "id", shared(id), "result", shared(result)));
}

static json_t *mistakes(const struct err_list *errors) {
    json_t *list = json_array();
    for (size_t i = 0; i < errors->n; i++) {
        const struct err *m = &errors->item[i];
        json_array_append_new(list, json_pack("{s:s, s:i, s:i, s:s}", "file", m->file, "line", m->line,
                                              "column", m->column, "text", m->text));
    }
    return list;
}

void rpc_read_mistakes(const json_t *list, struct err_list *errors) {
    size_t i;
    json_t *m;
    json_array_foreach(list, i, m) {
        struct err one = {0};
        const char *file = json_string_value(json_object_get(m, "file"));
        const char *text = json_string_value(json_object_get(m, "text"));
        err_at(&one, ERR_INPUT, file ? file : "", (int)json_integer_value(json_object_get(m, "line")),
               (int)json_integer_value(json_object_get(m, "column")), "%s", text ? text : "");
        err_list_add(errors, &one);
    }
}

char *rpc_error_text(const json_t *id, int code, const struct err *e, const struct err_list *errors) {
    json_t *data = json_pack("{s:s}", "code", err_name(e->code));
    if (errors && errors->n)
        json_object_set_new(data, "errors", mistakes(errors));
    json_t *error = json_pack("{s:i, s:s, s:o}", "code", code, "message", e->text, "data", data);
    return line_text(json_pack("{s:s, s:o, s:o}", "jsonrpc", "2.0", "id", shared(id), "error", error));
}

char *rpc_event_text(const json_t *params) {
    return line_text(
        json_pack("{s:s, s:s, s:o}", "jsonrpc", "2.0", "method", "event", "params", shared(params)));
}

int rpc_code_of(const struct err *e) {
    return RPC_OWN - e->code;
}
