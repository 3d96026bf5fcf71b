/*
 * lines.h — a text line by line, and the numbers of a line with the column of each.
 *
 * Numbers are separated by blanks, tabs, or one comma; a line ends in LF or CRLF. The text need not end in NUL.
 * Errors     lines_numbers: -ERR_INPUT with file:line:column in errors; at most ERR_LIST_OF_FILE of one.
 * Checked    tests/unit/test_surface_files.c, tests/fuzz/fuzz_astm.c, tests/fuzz/fuzz_alta.c
 */
#ifndef PROTO_LINES_H
#define PROTO_LINES_H

#include <stdbool.h>
#include <stddef.h>

#include "proto/err.h"

struct lines {
    const char *file, *next, *end; /* next: where the following line begins */
    const char *text;              /* the present line, size bytes, without its end */
    size_t size;
    int number; /* from 1 */
};

/* -ERR_INPUT where the bytes are no text (file_check_text). */
int lines_begin(struct lines *l, const char *file, const char *text, size_t size, struct err_list *errors);
bool lines_next(struct lines *l);
bool lines_blank(const struct lines *l);
/* The first bytes are this word, and a blank or the end follows; *rest is the text behind it (size *rest_size). */
bool lines_keyword(const struct lines *l, const char *word, const char **rest, size_t *rest_size);
/* How many numbers the line holds; the first max of them into value and column. */
int lines_numbers(const struct lines *l, double *value, int *column, int max, struct err_list *errors);
int lines_error(const struct lines *l, int column, struct err_list *errors, const char *format, ...)
    __attribute__((format(printf, 4, 5))); /* -ERR_INPUT */

#endif
