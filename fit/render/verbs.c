#include "fit/render/verbs.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static volatile sig_atomic_t cancelled;

static void cancel(int number) {
    cancelled = 1;
    signal(number, SIG_DFL);
}

const volatile sig_atomic_t *verb_cancel(void) {
    signal(SIGINT, cancel);
    signal(SIGTERM, cancel);
    return &cancelled;
}

static int exit_status(int code) {
    return code == ERR_USAGE || code == ERR_INPUT || code == ERR_RANGE || code == ERR_STATE ? 2 : 1;
}

int verb_complain(const char *command, const struct err *e) {
    char text[1024];
    fprintf(stderr, "goniorender %s: %s\n", command, err_format(e, text, sizeof text));
    return exit_status(e->code);
}

int verb_complain_all(struct err_list *errors) {
    char text[1024];
    for (size_t i = 0; i < errors->n; i++) {
        fprintf(stderr, "%s\n", err_format(&errors->item[i], text, sizeof text));
    }
    err_list_free(errors);
    return 2;
}

char *verb_line(int argc, char **argv) {
    size_t size = sizeof "goniorender";
    for (int i = 0; i < argc; i++) {
        size += strlen(argv[i]) + 1;
    }
    char *line = malloc(size);
    if (!line) {
        return NULL;
    }
    char *end = stpcpy(line, "goniorender");
    for (int i = 0; i < argc; i++) {
        *end++ = ' ';
        end = stpcpy(end, argv[i]);
    }
    return line;
}

void verb_numbered(const char *path, int number, char *out, size_t size) {
    const char *dot = strrchr(path, '.');
    int stem = dot ? (int)(dot - path) : (int)strlen(path);
    snprintf(out, size, "%.*s-%03d%s", stem, path, number, dot ? dot : "");
}

int verb_session(char *text, struct scene_session session[SCENE_PAINTS], int *n, struct err *e) {
    char *equals = strchr(text, '=');
    if (!equals || equals == text || !equals[1]) {
        return err_set(e, ERR_USAGE, "--session is MATERIAL=FILE, not '%s'", text);
    }
    if (*n == SCENE_PAINTS) {
        return err_set(e, ERR_USAGE, "--session is given more than %d times", SCENE_PAINTS);
    }
    *equals = 0;
    session[(*n)++] = (struct scene_session){text, equals + 1};
    return 0;
}
