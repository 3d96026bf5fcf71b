/*
 * file.h — a whole file into memory, with a limit, and a clear sentence when that cannot be.
 *
 * Only regular files: a directory, a device or a pipe is refused at once and nothing blocks. *text is
 * malloc'd and has a NUL after its *size bytes.
 * Errors     -ERR_IO with errno; -ERR_INPUT not a regular file, or longer than limit bytes.
 * Checked    tests/unit/test_file.c
 */
#ifndef PROTO_FILE_H
#define PROTO_FILE_H

#include <stddef.h>

#include "proto/err.h"

int file_read(const char *path, size_t limit, char **text, size_t *size, struct err *e);
/* FNV-1a of a text: which one was this. */
void file_hash(const char *text, size_t size, char hex[17]);
/* -ERR_INPUT at the first byte that is neither UTF-8 text nor a tab or line end; 0 where there is none. */
int file_check_text(const char *file, const char *text, size_t size, struct err *e);

#endif
