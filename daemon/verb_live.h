/*
 * verb_live.h — what the live verbs share: one request over goniod's socket, and printing of parts of the
 * status.
 * Checked    tests/wire/test_campaign_wire.c, tests/wire/test_bad_input.py
 */
#ifndef DAEMON_VERB_LIVE_H
#define DAEMON_VERB_LIVE_H

#include <jansson.h>

#include "daemon/verbs.h"
#include "proto/rpc.h"

/* Connects, calls, closes. params is taken over. */
int live_call(const struct verb_args *args, const char *method, json_t *params, int silence_ms,
              json_t **result, struct err_list *errors, struct err *e);
/* A verb without operands: asks, and prints the member `part` of the answer (NULL = all) in words or as JSON. */
int live_ask(int argc, char **argv, const char *method, int silence_ms, const char *part,
             void (*print)(const json_t *));
void live_print_json(const json_t *value);
void live_print_axes(const json_t *axes);
/* "1 h 05 min", "12 min", "40 s". Returns buffer. */
const char *live_duration(double seconds, char *buffer, size_t size);
void live_print_status(const json_t *status);

#endif
