#include "daemon/verb_session.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define SESSION_PATH_MAX 500 /* SQLite takes 512, its journal's ending included */
#define SYSTEM_FOLDER "/var/lib/goniod/sessions"

const char *verb_sessions_folder(const char *named, int need, char *buffer, size_t size) {
    const char *set = getenv("GONIOD_SESSIONS"), *data = getenv("XDG_DATA_HOME"), *home = getenv("HOME");
    if (named)
        snprintf(buffer, size, "%s", named);
    else if (set && *set)
        snprintf(buffer, size, "%s", set);
    else if (access(SYSTEM_FOLDER, need) == 0 || (!(data && *data) && !(home && *home)))
        snprintf(buffer, size, SYSTEM_FOLDER);
    else if (data && *data)
        snprintf(buffer, size, "%s/goniod", data);
    else
        snprintf(buffer, size, "%s/.local/share/goniod", home);
    return buffer;
}

int verb_session_path(const struct verb_args *args, const char *session, char *path, size_t size,
                      struct err *e) {
    char folder[400];
    verb_sessions_folder(args->sessions, F_OK, folder, sizeof folder);
    if (strlen(session) > SESSION_PATH_MAX)
        return err_set(e, ERR_USAGE, "the path of a session is at most %d characters long, not %zu",
                       SESSION_PATH_MAX, strlen(session));
    snprintf(path, size, "%s", session);
    if (access(path, F_OK) == 0)
        return 0;
    snprintf(path, size, "%s/%s", folder, session);
    if (access(path, F_OK) == 0)
        return 0;
    snprintf(path, size, "%s/%s.gonio", folder, session);
    if (access(path, F_OK) == 0)
        return 0;
    return err_set(e, ERR_USAGE,
                   "there is no session %s, neither as a path nor in %s; 'gonioctl sessions' lists them",
                   session, folder);
}
