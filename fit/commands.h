/*
 * commands.h — the subcommands of goniofit: argc and argv from the subcommand's name on; the exit status returned.
 *
 * Exit status 0 done; 1 the work failed (a fit was refused or did not converge); 2 bad usage or bad input, nothing
 * was started. Results go to stdout, messages to stderr; a mistake in a file is FILE:LINE:COLUMN: sentence.
 * Checked    tests/unit/test_goniofit.py
 */
#ifndef FIT_COMMANDS_H
#define FIT_COMMANDS_H

#include "proto/err.h"

int command_fit(int argc, char **argv);
int command_eval(int argc, char **argv);
int command_stability(int argc, char **argv);
int command_bench(int argc, char **argv);
int command_complain(const char *command, const struct err *e); /* prints; 1 where a fit failed, else 2 */
int command_complain_all(struct err_list *errors);              /* prints, frees; as command_complain */

#endif
