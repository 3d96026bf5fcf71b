/*
 * verbs.h — every verb of gonioctl: `int verb_NAME(argc, argv)` with argv[0] the verb, returning the exit status.
 *
 * Exit status: 0 done, 1 the work failed, 2 bad usage or bad input (nothing was started). Results go to
 * stdout, messages to stderr; with --json one object on stdout. Live verbs speak to goniod's socket; the
 * others open the session read-only and need no daemon.
 *
 * verb_parse reads the options all verbs share (--socket, --sessions, --json, --help) and the verb's own by
 * its table.
 * Checked    tests/unit/test_verbs_offline.c, tests/scenario/test_control.c
 */
#ifndef DAEMON_VERBS_H
#define DAEMON_VERBS_H

#include <stdbool.h>

#include "proto/err.h"

#define VERB_OPERANDS 256
#define VERB_OPTIONS 8

struct verb_option {
    const char *name;  /* "--average" */
    char letter;       /* 'o' for -o; 0 = none */
    const char *value; /* what stands for its value in the usage, "N"; NULL = a flag */
    const char *doc;
};

struct verb_args {
    const char *operand[VERB_OPERANDS];
    int n_operands;
    const char *option[VERB_OPTIONS]; /* value of the verb's k-th option, "" for a flag, NULL = not given */
    const char *socket, *sessions;    /* NULL = default */
    bool json;
};

struct verb {
    const char *name;
    int (*run)(int argc, char **argv);
    const char *operands; /* "SESSION [--dump]" */
    const char *doc;
    bool live;
};
extern const struct verb VERBS[]; /* ends with name == NULL */

/* Returns -1 to go on, or the exit status: 0 after --help, 2 for bad usage (said on stderr). options ends
 * with name == NULL, or is NULL. */
int verb_parse(int argc, char **argv, const struct verb_option *options, int min_operands, int max_operands,
               struct verb_args *args);
/* Prints "gonioctl: ..." on stderr, each mistake of the list first; returns 2 for usage and input errors,
 * else 1. */
int verb_fail(const struct err *e, const struct err_list *errors);

int verb_check(int argc, char **argv);
int verb_run(int argc, char **argv);
int verb_queue(int argc, char **argv);
int verb_status(int argc, char **argv);
int verb_watch(int argc, char **argv);
int verb_pause(int argc, char **argv);
int verb_resume(int argc, char **argv);
int verb_abort(int argc, char **argv);
int verb_continue(int argc, char **argv);
int verb_devices(int argc, char **argv);
int verb_where(int argc, char **argv);
int verb_home(int argc, char **argv);
int verb_move(int argc, char **argv);
int verb_stop(int argc, char **argv);
int verb_spectrum(int argc, char **argv);
int verb_commission(int argc, char **argv);
int verb_sessions(int argc, char **argv);
int verb_show(int argc, char **argv);
int verb_verify(int argc, char **argv);
int verb_copy(int argc, char **argv);
int verb_reduce(int argc, char **argv);
int verb_replay(int argc, char **argv);
int verb_export(int argc, char **argv);
int verb_plot(int argc, char **argv);
int verb_compare(int argc, char **argv);

#endif
