/*
 * process.h — runs another program to its end with its output into a file, or starts one and goes on.
 *
 * Errors     -ERR_IO it cannot be started, or did not end with status 0; the sentence names it.
 * Checked    tests/unit/test_bench_fit.py, tests/unit/test_estimator.c, tests/scenario/test_campaign_failures.c
 */
#ifndef PROTO_PROCESS_H
#define PROTO_PROCESS_H

#include <sys/types.h>

#include "proto/err.h"

/* argv[0] is looked for in PATH; NULL ends argv. stderr is ours. */
int process_run(const char *const *argv, int out_fd, struct err *e);
/* argv[0] is a path. out_fd -1: stdout is ours. No signal is blocked or ignored in the child, whatever is here.
 * Returns 0 or the errno; the caller waits for the child. */
int process_start(const char *const *argv, int in_fd, int out_fd, pid_t *child);

#endif
