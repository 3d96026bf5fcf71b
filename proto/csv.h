/*
 * csv.h — a table of numbers in text: notes, one line of column names, rows; every mistake with its place.
 *
 *     # geometry: 45:0          notes, before the column names or anywhere
 *     lambda_nm,beta,u          names; their order is free
 *     380,0.985,0.004           rows; blank lines and other comments are passed over
 *
 * Shapes     name[n_columns]; cell[row * n_columns + column]; all text lies in one buffer of the struct.
 *            A cell may be quoted ("a, b"). line and column count from 1.
 * Domain     UTF-8, lines end in LF or CRLF, separator comma, decimal point.
 * Errors     csv_parse adds every mistake to errors (at most ERR_LIST_OF_FILE of one file) and returns
 *            -ERR_INPUT; nothing needs freeing then.
 * Source     RFC 4180, without line breaks inside cells.
 * Checked    tests/unit/test_csv.c, tests/fuzz/fuzz_certificate.c
 */
#ifndef PROTO_CSV_H
#define PROTO_CSV_H

#include <stddef.h>

#include "proto/err.h"

#define CSV_COLUMNS_MAX 512

struct csv_cell {
    const char *text;
    int line, column;
};

struct csv_note { /* "# key: value"; place of the value */
    const char *key;
    struct csv_cell value;
};

struct csv {
    char file[256];
    size_t n_columns, n_rows, n_notes;
    struct csv_cell *name, *cell;
    struct csv_note *note;
    char *buffer;
    size_t cell_capacity, note_capacity;
};

int csv_parse(const char *file, const char *text, size_t size, struct csv *csv, struct err_list *errors);
void csv_free(struct csv *csv);

/* Index of each wanted column (NULL ends the list) in column[]; -1 where it is missing. Unknown and doubled
 * names are reported, missing ones only for the first n_required. */
int csv_columns(const struct csv *csv, const char *const *wanted, int n_required, int *column,
                struct err_list *errors);
const struct csv_note *csv_note_find(const struct csv *csv, const char *key); /* NULL if absent */
/* A number within low..high from a cell; what: its name for the sentence. Reports and returns -ERR_INPUT. */
int csv_number(const struct csv *csv, const struct csv_cell *cell, const char *what, double low, double high,
               double *value, struct err_list *errors);
int csv_error(const struct csv *csv, const struct csv_cell *cell, struct err_list *errors, const char *format,
              ...) __attribute__((format(printf, 4, 5))); /* -ERR_INPUT */

#endif
