/* sessions, verify, copy: the session files as files. */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "daemon/session_text.h"
#include "daemon/verb_session.h"

static int copy(const struct verb_args *args, struct err *e) {
    char path[600];
    int rc = verb_session_path(args, args->operand[0], path, sizeof path, e);
    return rc < 0 ? rc : session_copy(path, args->operand[1], e);
}

int verb_copy(int argc, char **argv) {
    struct verb_args args;
    struct err e = {0};
    int done = verb_parse(argc, argv, NULL, 2, 2, &args);
    if (done >= 0)
        return done;
    if (copy(&args, &e) < 0)
        return verb_fail(&e, NULL);
    if (args.json) {
        json_t *object = json_pack("{s:s}", "copy", args.operand[1]);
        json_dumpf(object, stdout, JSON_COMPACT);
        putchar('\n');
        json_decref(object);
    }
    return 0;
}

static void print_verdict(const char *path, const struct err_list *found, bool json) {
    json_t *list = json_array();
    for (size_t i = 0; i < found->n; i++) {
        if (!json)
            printf("%s\n", found->item[i].text);
        json_array_append_new(list, json_string(found->item[i].text));
    }
    if (json) {
        json_t *all = json_pack("{s:s, s:b, s:o}", "session", path, "sound", found->n == 0, "found", list);
        json_dumpf(all, stdout, JSON_COMPACT);
        putchar('\n');
        json_decref(all);
        return;
    }
    json_decref(list);
    if (found->n == 0)
        printf("%s: sound\n", path);
}

int verb_verify(int argc, char **argv) {
    struct verb_args args;
    struct err e = {0};
    struct err_list found = {0};
    char path[600];
    int done = verb_parse(argc, argv, NULL, 1, 1, &args);
    if (done >= 0)
        return done;
    int rc = verb_session_path(&args, args.operand[0], path, sizeof path, &e);
    if (rc == 0)
        rc = session_verify(path, &found, &e);
    bool judged = rc == 0 || found.n > 0;
    if (judged)
        print_verdict(path, &found, args.json);
    err_list_free(&found);
    if (judged)
        return rc == 0 ? 0 : 1;
    return verb_fail(&e, NULL);
}

struct listed { /* one line of `gonioctl sessions` */
    char name[256];
    char state[32], why[200];
    int64_t bytes;
    struct session_summary summary;
};

static void look_at(const char *path, struct listed *l) {
    struct session *s;
    struct err e = {0};
    struct stat st = {0};
    stat(path, &st);
    l->bytes = st.st_size;
    int rc = session_open(&s, path, true, &e);
    if (rc == 0) {
        rc = session_get_summary(s, &l->summary, &e);
        if (rc == 0)
            rc = session_text_state(s, l->state, sizeof l->state, &e);
        session_close(s, NULL);
    }
    if (rc < 0) {
        snprintf(l->state, sizeof l->state, "unreadable");
        snprintf(l->why, sizeof l->why, "%.190s", e.text);
    }
}

static json_t *listed_json(const struct listed *l) {
    char begun[40] = "";
    if (l->summary.n_exposures)
        session_text_utc(l->summary.first_utc_us, begun, sizeof begun);
    return json_pack("{s:s, s:s, s:s, s:I, s:I, s:I, s:I, s:s}", "session", l->name, "state", l->state,
                     "begun_utc", begun, "points_final", (json_int_t)l->summary.n_final, "points_provisional",
                     (json_int_t)l->summary.n_provisional, "exposures", (json_int_t)l->summary.n_exposures,
                     "bytes", (json_int_t)l->bytes, "why", l->why);
}

static void print_listed(const struct listed *l) {
    char begun[40] = "-", provisional[40] = "";
    if (l->summary.n_exposures)
        session_text_utc(l->summary.first_utc_us, begun, sizeof begun);
    if (l->summary.n_provisional)
        snprintf(provisional, sizeof provisional, "  %lld of them provisional",
                 (long long)l->summary.n_provisional);
    printf("%-52s %-12s %-19s %5lld points %8.1f MB%s%s%s\n", l->name, l->state, begun,
           (long long)(l->summary.n_final + l->summary.n_provisional), (double)l->bytes / 1e6, provisional,
           *l->why ? "  " : "", l->why);
}

static int is_session(const struct dirent *entry) {
    size_t n = strlen(entry->d_name);
    return n > 6 && strcmp(entry->d_name + n - 6, ".gonio") == 0;
}

static int list(const char *folder, bool json, struct err *e) {
    struct dirent **entry;
    int n = scandir(folder, &entry, is_session, alphasort);
    if (n < 0) {
        int saved_errno = errno;
        return err_errno(e, ERR_USAGE, saved_errno,
                         "the folder of sessions %s cannot be read; --sessions names another", folder);
    }
    json_t *all = json_array();
    for (int i = 0; i < n; i++) {
        struct listed l = {0};
        char path[1024];
        snprintf(l.name, sizeof l.name, "%s", entry[i]->d_name);
        snprintf(path, sizeof path, "%s/%s", folder, entry[i]->d_name);
        look_at(path, &l);
        if (json)
            json_array_append_new(all, listed_json(&l));
        else
            print_listed(&l);
        free(entry[i]);
    }
    free(entry);
    if (json) {
        json_t *object = json_pack("{s:s, s:O}", "folder", folder, "sessions", all);
        json_dumpf(object, stdout, JSON_COMPACT);
        putchar('\n');
        json_decref(object);
    }
    json_decref(all);
    return 0;
}

int verb_sessions(int argc, char **argv) {
    struct verb_args args;
    struct err e = {0};
    char folder[400];
    int done = verb_parse(argc, argv, NULL, 0, 0, &args);
    if (done >= 0)
        return done;
    verb_sessions_folder(args.sessions, F_OK, folder, sizeof folder);
    return list(folder, args.json, &e) < 0 ? verb_fail(&e, NULL) : 0;
}
