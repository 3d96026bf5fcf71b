/*
 * process.h — runs another program to its end, its output into a file.
 *
 * Errors     -ERR_IO it cannot be started, or did not end with status 0; the sentence names it.
 * Checked    tests/unit/test_bench_fit.py
 */
#ifndef PROTO_PROCESS_H
#define PROTO_PROCESS_H

#include "proto/err.h"

/* argv[0] is looked for in PATH; NULL ends argv. stderr is ours. */
int process_run(const char *const *argv, int out_fd, struct err *e);

#endif
