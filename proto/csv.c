#include "proto/csv.h"

#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/file.h"
#include "proto/number.h"
#include "proto/yaml.h"

int csv_error(const struct csv *csv, const struct csv_cell *cell, struct err_list *errors, const char *format,
              ...) {
    va_list ap;
    va_start(ap, format);
    int rc = err_list_mistake(errors, csv->file, cell ? cell->line : 0, cell ? cell->column : 0, format, ap);
    va_end(ap);
    return rc;
}

static char *trim(char *text) {
    text += strspn(text, " \t");
    size_t size = strlen(text);
    while (size > 0 && strchr(" \t\r", text[size - 1]))
        text[--size] = '\0';
    return text;
}

static int add_note(struct csv *csv, char *line, char *start, int line_number) {
    char *colon = strchr(start + 1, ':');
    if (!colon)
        return 0;
    if (csv->n_notes == csv->note_capacity) {
        size_t capacity = csv->note_capacity ? 2 * csv->note_capacity : 8;
        struct csv_note *grown = realloc(csv->note, capacity * sizeof *grown);
        if (!grown)
            return -ERR_NOMEM;
        csv->note = grown;
        csv->note_capacity = capacity;
    }
    *colon = '\0';
    char *value = trim(colon + 1);
    csv->note[csv->n_notes++] =
        (struct csv_note){.key = trim(start + 1), .value = {value, line_number, (int)(value - line) + 1}};
    return 0;
}

/* Ends the cell at text in place, taking quotes off; *next is the text behind its comma, NULL after the last
 * cell. Returns NULL for a quote that does not close or has text behind it. */
static char *cut_cell(char *text, char **next) {
    char *start = text + strspn(text, " \t");
    if (*start != '"') {
        char *comma = strchr(start, ',');
        *next = comma ? comma + 1 : NULL;
        if (comma)
            *comma = '\0';
        return trim(start);
    }
    char *out = start, *in = start + 1;
    while (*in && (*in != '"' || in[1] == '"')) {
        in += *in == '"';
        *out++ = *in++;
    }
    if (*in != '"')
        return NULL;
    char *rest = in + 1 + strspn(in + 1, " \t\r");
    if (*rest != ',' && *rest != '\0')
        return NULL;
    *next = *rest == ',' ? rest + 1 : NULL;
    *out = '\0';
    return start;
}

static int reserve_row(struct csv *csv) {
    size_t needed = (csv->n_rows + 1) * csv->n_columns;
    if (needed <= csv->cell_capacity)
        return 0;
    size_t capacity = csv->cell_capacity ? 2 * csv->cell_capacity : 64 * csv->n_columns;
    struct csv_cell *grown = realloc(csv->cell, capacity * sizeof *grown);
    if (!grown)
        return -ERR_NOMEM;
    csv->cell = grown;
    csv->cell_capacity = capacity;
    return 0;
}

/* Splits a line into at most max cells; *n counts all of them. */
static int split(struct csv *csv, char *line, int line_number, struct csv_cell *cell, size_t max, size_t *n,
                 struct err_list *errors) {
    *n = 0;
    for (char *text = line; text;) {
        struct csv_cell here = {.line = line_number, .column = (int)(text - line) + 1};
        char *start = cut_cell(text, &text);
        if (!start)
            return csv_error(csv, &here, errors, "a quoted cell does not end with a quote and a comma");
        here.text = start;
        here.column = (int)(start - line) + 1;
        if (*n < max)
            cell[*n] = here;
        ++*n;
    }
    return 0;
}

static int take_names(struct csv *csv, char *line, int line_number, struct err_list *errors) {
    struct csv_cell here = {.line = line_number, .column = 1};
    if (strchr(line, ';') && !strchr(line, ','))
        return csv_error(csv, &here, errors,
                         "columns are separated by ';' here; use commas, and a point in numbers");
    csv->name = calloc(CSV_COLUMNS_MAX, sizeof *csv->name);
    if (!csv->name)
        return csv_error(csv, NULL, errors, "no memory left to read this file");
    int rc = split(csv, line, line_number, csv->name, CSV_COLUMNS_MAX, &csv->n_columns, errors);
    if (rc == 0 && csv->n_columns > CSV_COLUMNS_MAX)
        rc = csv_error(csv, &here, errors, "%zu columns; at most %d are read", csv->n_columns,
                       CSV_COLUMNS_MAX);
    return rc;
}

static int take_row(struct csv *csv, char *line, int line_number, struct err_list *errors) {
    struct csv_cell here = {.line = line_number, .column = 1};
    size_t n;
    if (reserve_row(csv) != 0)
        return csv_error(csv, NULL, errors, "no memory left to read this file");
    int rc =
        split(csv, line, line_number, csv->cell + csv->n_rows * csv->n_columns, csv->n_columns, &n, errors);
    if (rc == 0 && n != csv->n_columns)
        rc = csv_error(csv, &here, errors, "%zu cells, but the column names are %zu", n, csv->n_columns);
    if (rc == 0)
        csv->n_rows++;
    return rc;
}

static int take_line(struct csv *csv, char *line, int line_number, struct err_list *errors) {
    char *start = line + strspn(line, " \t\r");
    if (*start == '\0')
        return 0;
    if (*start == '#')
        return add_note(csv, line, start, line_number);
    if (!csv->name)
        return take_names(csv, line, line_number, errors);
    return take_row(csv, line, line_number, errors);
}

static int take_lines(struct csv *csv, char *text, struct err_list *errors) {
    int rc = 0, line_number = 0;
    while (text) {
        char *end = strchr(text, '\n');
        if (end)
            *end = '\0';
        int broken = take_line(csv, text, ++line_number, errors);
        if (broken != 0)
            rc = broken;
        if (broken != 0 && csv->n_rows == 0 && csv->n_columns == 0)
            return rc; /* without names no row can be judged */
        text = end ? end + 1 : NULL;
    }
    if (rc == 0 && csv->n_rows == 0)
        rc = csv_error(csv, NULL, errors,
                       csv->name ? "there are column names but no rows" : "the file is empty");
    return rc;
}

int csv_parse(const char *file, const char *text, size_t size, struct csv *csv, struct err_list *errors) {
    static const char byte_order_mark[] = "\xEF\xBB\xBF";
    struct err e = {0};
    memset(csv, 0, sizeof *csv);
    snprintf(csv->file, sizeof csv->file, "%s", file);
    if (file_check_text(file, text, size, &e) != 0) {
        err_list_add(errors, &e);
        return -ERR_INPUT;
    }
    csv->buffer = malloc(size + 1);
    if (!csv->buffer)
        return csv_error(csv, NULL, errors, "no memory left to read this file");
    memcpy(csv->buffer, text, size);
    csv->buffer[size] = '\0';
    bool marked = strncmp(csv->buffer, byte_order_mark, 3) == 0;
    int rc = take_lines(csv, csv->buffer + (marked ? 3 : 0), errors);
    if (rc != 0)
        csv_free(csv);
    return rc;
}

void csv_free(struct csv *csv) {
    free(csv->name);
    free(csv->cell);
    free(csv->note);
    free(csv->buffer);
    memset(csv, 0, sizeof *csv);
}

static int claim_column(const struct csv *csv, size_t c, const char *const *wanted, int *column,
                        struct err_list *errors) {
    const struct csv_cell *name = &csv->name[c];
    int w = 0;
    while (wanted[w] && strcmp(wanted[w], name->text) != 0)
        w++;
    if (!wanted[w]) {
        const char *near = yaml_nearest(name->text, wanted);
        return csv_error(csv, name, errors, "unknown column '%.64s'%s%s%s", name->text,
                         near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "");
    }
    if (column[w] >= 0)
        return csv_error(csv, name, errors, "the column '%s' stands here a second time", name->text);
    column[w] = (int)c;
    return 0;
}

int csv_columns(const struct csv *csv, const char *const *wanted, int n_required, int *column,
                struct err_list *errors) {
    int rc = 0;
    for (int w = 0; wanted[w]; w++)
        column[w] = -1;
    for (size_t c = 0; c < csv->n_columns; c++)
        if (claim_column(csv, c, wanted, column, errors) != 0)
            rc = -ERR_INPUT;
    for (int w = 0; w < n_required; w++)
        if (column[w] < 0)
            rc = csv_error(csv, &csv->name[0], errors, "the column '%s' is missing", wanted[w]);
    return rc;
}

const struct csv_note *csv_note_find(const struct csv *csv, const char *key) {
    for (size_t i = 0; i < csv->n_notes; i++)
        if (strcmp(csv->note[i].key, key) == 0)
            return &csv->note[i];
    return NULL;
}

int csv_number(const struct csv *csv, const struct csv_cell *cell, const char *what, double low, double high,
               double *value, struct err_list *errors) {
    double read;
    if (!number_read_double(cell->text, &read))
        return csv_error(csv, cell, errors, "%s must be a number, not '%.40s'", what, cell->text);
    if (read < low || read > high)
        return csv_error(csv, cell, errors, "%s is %.40s; it must be from %.10g to %.10g", what, cell->text,
                         low, high);
    *value = read;
    return 0;
}
