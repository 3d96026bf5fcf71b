/*
 * rpc.h — JSON-RPC 2.0, one object a line, over goniod's socket: the messages of both sides and the client.
 *
 * A request {"jsonrpc":"2.0","id":1,"method":"status","params":{}} gets {"jsonrpc":"2.0","id":1,"result":...} or
 * {"jsonrpc":"2.0","id":1,"error":{"code":-32002,"message":"one sentence","data":{...}}}. Events are requests
 * without an id: {"jsonrpc":"2.0","method":"event","params":{...}}. docs/protocol.md lists the methods.
 *
 * Codes      -32700 not JSON, -32600 not a request, -32601 no such method, -32602 wrong parameters;
 *            -32000 - enum err_code for goniod's own, data.code names it, data.errors lists file, line, column,
 *            text of each mistake.
 * Domain     a line of at most RPC_LINE_MAX bytes, UTF-8, ends with \n.
 * Threads    a struct rpc_client belongs to one thread. A call waits until goniod has been silent for silence_ms,
 *            -1 = for ever (clients only; goniod's server lives in daemon/control.c and never blocks).
 * Checked    tests/unit/test_rpc.c, tests/wire/test_protocol.py, tests/fuzz/fuzz_rpc.c
 */
#ifndef PROTO_RPC_H
#define PROTO_RPC_H

#include <stddef.h>
#include <jansson.h>

#include "proto/err.h"

#define RPC_LINE_MAX (8 * 1024 * 1024) /* a job with its certificate table */

enum rpc_code {
    RPC_PARSE = -32700,
    RPC_REQUEST = -32600,
    RPC_METHOD = -32601,
    RPC_PARAMS = -32602,
    RPC_OWN = -32000
};

struct rpc_request {
    json_t *id; /* NULL = a notification */
    const char *method;
    json_t *params; /* an object; NULL = none */
    json_t *root;   /* owns all of it */
};

/* Returns 0 or the JSON-RPC error code, with the sentence in e. rq->id is set wherever it could be read. */
int rpc_parse(const char *line, size_t size, struct rpc_request *rq, struct err *e);
void rpc_request_free(struct rpc_request *rq);

/* Each returns one line ending in \n for the caller to free. References to id and result are borrowed. */
char *rpc_reply_text(const json_t *id, const json_t *result);
char *rpc_error_text(const json_t *id, int code, const struct err *e, const struct err_list *errors);
char *rpc_event_text(const json_t *params);
/* The list in data.errors back into struct errs. */
void rpc_read_mistakes(const json_t *list, struct err_list *errors);
int rpc_code_of(const struct err *e);

struct rpc_client;

/* path NULL: GONIOD_SOCKET, else /run/goniod/goniod.sock where it exists, else $XDG_RUNTIME_DIR/goniod.sock.
 */
const char *rpc_default_socket(void);
int rpc_connect(struct rpc_client **client, const char *path, struct err *e);
void rpc_close(struct rpc_client *client);
int rpc_descriptor(const struct rpc_client *client);

/* params is taken over (may be NULL). result is the caller's. An error of the server comes back as its own
 * err code and sentence; its list of mistakes, if any, through errors (may be NULL). Events that arrive
 * meanwhile are kept. */
int rpc_call(struct rpc_client *client, const char *method, json_t *params, int silence_ms, json_t **result,
             struct err_list *errors, struct err *e);
/* The next event, kept or awaited. -ERR_TIMEOUT if none came; -ERR_CANCELLED if a signal interrupted the
 * wait. */
int rpc_next_event(struct rpc_client *client, int silence_ms, json_t **params, struct err *e);

#endif
