/*
 * sha256.h — the SHA-256 of a file, so that a picture names the very bytes it was made from.
 *
 * Source     FIPS 180-4.
 * Errors     -ERR_IO with errno.
 * Checked    tests/unit/test_render_paint.c: the examples of FIPS 180-4
 */
#ifndef FIT_RENDER_SHA256_H
#define FIT_RENDER_SHA256_H

#include <stddef.h>

#include "proto/err.h"

void sha256_of_bytes(const void *bytes, size_t size, char hex[65]);
int sha256_of_file(const char *path, char hex[65], struct err *e);

#endif
