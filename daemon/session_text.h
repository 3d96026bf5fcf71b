/*
 * session_text.h — what goniod writes into a session besides its tables, for the verbs that print it.
 *
 * The texts "sample", "plan" ... are JSON; events "state" tell how the campaign went on and ended. The state of a
 * session is that of its last such event: "done", "aborted", ..., or "running" while it goes on; "interrupted" where
 * nobody writes it any more.
 * Errors     as session.h; -ERR_INPUT a text that should be JSON is not.
 * Checked    tests/unit/test_verbs_offline.c
 */
#ifndef DAEMON_SESSION_TEXT_H
#define DAEMON_SESSION_TEXT_H

#include <jansson.h>

#include "proto/session.h"

/* *json: NULL where the session holds no such text; the caller's to free. */
int session_text_json(struct session *s, const char *key, json_t **json, struct err *e);
int session_text_state(struct session *s, char *state, size_t size, struct err *e);
/* "2026-01-01 00:31:02"; returns buffer. */
const char *session_text_utc(int64_t utc_us, char *buffer, size_t size);

#endif
