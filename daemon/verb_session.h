/*
 * verb_session.h — SESSION on a command line: a name in the folder of sessions, or a path.
 *
 * The folder: --sessions, else GONIOD_SESSIONS, else /var/lib/goniod/sessions where it exists (for goniod: where it may
 * write), else $XDG_DATA_HOME/goniod, else ~/.local/share/goniod. The ending .gonio may be left out.
 * Errors     -ERR_USAGE there is no such session; the sentence says where it was looked for.
 * Checked    tests/unit/test_verbs_offline.c
 */
#ifndef DAEMON_VERB_SESSION_H
#define DAEMON_VERB_SESSION_H

#include <stddef.h>

#include "daemon/verbs.h"

/* named may be NULL. need: F_OK, or W_OK as goniod itself. Returns buffer. */
const char *verb_sessions_folder(const char *named, int need, char *buffer, size_t size);
int verb_session_path(const struct verb_args *args, const char *session, char *path, size_t size,
                      struct err *e);

#endif
