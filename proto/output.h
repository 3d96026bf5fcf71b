/*
 * output.h — what a program writes for a person: whole or not at all, and never over a file that is there.
 *
 * output_check  whether output_open could make the file, for work that takes long before there is anything to write.
 * output_open   makes the file. One that exists already is left alone; a device or a pipe is written to.
 * output_close  closes it. A file that was not written whole, or whose maker failed (rc < 0), is removed.
 * output_end    for the end of main: the status, or 1 and a sentence where stdout did not take everything.
 * Errors     -ERR_BUSY the file exists; -ERR_IO, -ERR_FULL with errno.
 * Checked    tests/unit/test_output.c, tests/unit/test_verbs_offline.c, tests/wire/test_bad_input.py
 */
#ifndef PROTO_OUTPUT_H
#define PROTO_OUTPUT_H

#include <stdio.h>

#include "proto/err.h"

int output_check(const char *path, struct err *e);
FILE *output_open(const char *path, struct err *e);
int output_close(FILE *out, const char *path, int rc, struct err *e);
int output_end(const char *program, int status);

#endif
