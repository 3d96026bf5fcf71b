#include "fit/render/verbs.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "proto/number.h"

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

int verb_options(int argc, char **argv, const struct option *known, const char *help,
                 int (*take)(int option, void *arg, struct err *e), void *arg, struct err *e) {
    int status = 0;
    optind = 1;
    for (int c; !status && (c = getopt_long(argc, argv, "o:", known, NULL)) != -1;) {
        if (c == 'h') {
            fputs(help, stdout);
            return 1;
        }
        status = c == '?' ? err_set(e, ERR_USAGE, "see goniorender %s --help", argv[0]) : take(c, arg, e);
    }
    return status;
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

int verb_spd(const char *text, const char *spd[SCENE_LIGHTS], int *n, struct err *e) {
    if (*n == SCENE_LIGHTS) {
        return err_set(e, ERR_USAGE, "--spd is given more than %d times", SCENE_LIGHTS);
    }
    spd[(*n)++] = text;
    return 0;
}

struct scene *verb_scene(const char *path, const struct scene_session *session, int n_sessions,
                         const char *wants, struct err_list *errors, struct err *e) {
    struct scene *scene = scene_read(path, session, n_sessions, errors);
    if (scene && scene->n_pictures > 1) {
        err_set(e, ERR_USAGE, "%s is a series of %d pictures; %s", path, scene->n_pictures, wants);
        scene_free(scene);
        return NULL;
    }
    return scene;
}

/* By doing it: rights do not tell of a read-only file system, and root has them all. */
static int try_beside(const char *path, struct err *e) {
    char part[4096];
    snprintf(part, sizeof part, "%s.part", path);
    int file = open(part, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666), saved_errno = errno;
    if (file >= 0) {
        close(file);
        unlink(part);
    }
    return file >= 0 || saved_errno == EEXIST
               ? 0
               : err_errno(e, ERR_IO, saved_errno, "%s cannot be written", path);
}

int verb_output(const char *path, struct err *e) {
    struct stat st;
    if (!path) {
        return 0;
    }
    if (stat(path, &st) != 0) {
        return try_beside(path, e);
    }
    if (S_ISDIR(st.st_mode)) {
        return err_set(e, ERR_IO, "%s is a folder; name a file in it", path);
    }
    if (access(path, W_OK) != 0) {
        int saved_errno = errno;
        return err_errno(e, ERR_IO, saved_errno, "%s cannot be written", path);
    }
    return S_ISREG(st.st_mode) ? try_beside(path, e) : 0;
}

int verb_report(const char *path, const json_t *json, struct err *e) {
    return json_dump_file(json, path, JSON_INDENT(1)) == 0
               ? 0
               : err_set(e, ERR_IO, "the report %s cannot be written", path);
}

int verb_lights(struct scene *scene, const char *const *spd, int n, struct err_list *errors, struct err *e) {
    int status = 0;
    if (n > scene->n_spds) {
        return err_set(e, ERR_USAGE, "%d spectra are given; the scene has lights of %d", n, scene->n_spds);
    }
    for (int j = 0; j < n && !status; j++) {
        status = spd_find(&scene->spd[j], spd[j], ".", errors, e);
        for (int i = 0; i < scene->n_lights && !status; i++) {
            if (scene->light[i].spd == j) {
                snprintf(scene->light[i].spd_name, sizeof scene->light[i].spd_name, "%s", spd[j]);
            }
        }
    }
    return status;
}

int verb_threads(const char *text, int *threads, struct err *e) {
    int64_t n;
    if (!number_read_int(text, &n) || n < 1 || n > 256) {
        return err_set(e, ERR_USAGE, "--threads is 1 to 256, not '%s'", text);
    }
    *threads = (int)n;
    return 0;
}
