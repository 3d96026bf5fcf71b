/*
 * verbs.h — the subcommands of goniorender: argc and argv from the subcommand's name on; the exit status returned.
 *
 * Exit status 0 done; 1 the work failed or was interrupted; 2 bad usage or bad input, nothing was started. Results go
 * to stdout, messages to stderr; a mistake in a file is FILE:LINE:COLUMN: sentence.
 * Checked    tests/unit/test_render_files.py, test_goniorender.py
 */
#ifndef FIT_RENDER_VERBS_H
#define FIT_RENDER_VERBS_H

#include <getopt.h>
#include <signal.h>

#include <jansson.h>

#include "fit/render/render.h"
#include "proto/err.h"

int verb_render(int argc, char **argv);
int verb_recolour(int argc, char **argv);
int verb_diff(int argc, char **argv);
int verb_sheet(int argc, char **argv);
int verb_bench(int argc, char **argv);
int verb_stability(int argc, char **argv);
int verb_complain(const char *command, const struct err *e);
int verb_complain_all(struct err_list *errors); /* prints, frees */
/* Becomes 1 at the first SIGINT or SIGTERM after the call; the second ends the process. */
const volatile sig_atomic_t *verb_cancel(void);
/* The options of a subcommand: each goes to take, with its argument in optarg; `h` prints help, and 1 is returned.
 * optind then counts the words up to the first that is no option. */
int verb_options(int argc, char **argv, const struct option *known, const char *help,
                 int (*take)(int option, void *arg, struct err *e), void *arg, struct err *e);
/* The words as one line, as a person would type them; malloc. */
char *verb_line(int argc, char **argv);
/* One word MATERIAL=FILE of the command line, which it cuts at its first `=`. */
int verb_session(char *text, struct scene_session session[SCENE_PAINTS], int *n, struct err *e);
/* FILE-007.png for FILE.png, where a series has several pictures. */
void verb_numbered(const char *path, int number, char *out, size_t size);
/* --spd given once more. */
int verb_spd(const char *text, const char *spd[SCENE_LIGHTS], int *n, struct err *e);
/* A scene of one picture; wants: what cannot be done with a series. NULL: e says why, or errors every mistake of it. */
struct scene *verb_scene(const char *path, const struct scene_session *session, int n_sessions,
                         const char *wants, struct err_list *errors, struct err *e);
/* The first n spectra of the scene's lights become these. */
int verb_lights(struct scene *scene, const char *const *spd, int n, struct err_list *errors, struct err *e);
/* Whether a file of that name could be written or replaced, before the work that fills it; NULL: none is wished. */
int verb_output(const char *path, struct err *e);
/* What --report asks for. */
int verb_report(const char *path, const json_t *json, struct err *e);
int verb_threads(const char *text, int *threads, struct err *e);
/* The uncertainty of the picture of a scene as an EXR, its figures into origin["uncertainty"]. */
int verb_uncertainty(const char *path, const struct scene *scene, const struct render_options *options,
                     json_t *origin, struct err *e);

#endif
