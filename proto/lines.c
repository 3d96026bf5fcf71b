#include "proto/lines.h"

#include <stdarg.h>
#include <string.h>

#include "proto/file.h"
#include "proto/number.h"

int lines_begin(struct lines *l, const char *file, const char *text, size_t size, struct err_list *errors) {
    struct err e = {0};
    *l = (struct lines){.file = file, .next = text, .end = text + size, .text = text};
    int rc = file_check_text(file, text, size, &e);
    if (rc != 0)
        err_list_add(errors, &e);
    return rc;
}

bool lines_next(struct lines *l) {
    if (l->next == l->end)
        return false;
    const char *newline = memchr(l->next, '\n', (size_t)(l->end - l->next));
    l->text = l->next;
    l->size = (size_t)((newline ? newline : l->end) - l->text);
    l->next = newline ? newline + 1 : l->end;
    l->number++;
    if (l->size > 0 && l->text[l->size - 1] == '\r')
        l->size--;
    return true;
}

static bool is_blank(char c) {
    return c == ' ' || c == '\t';
}

static size_t skip_blanks(const struct lines *l, size_t at) {
    while (at < l->size && is_blank(l->text[at]))
        at++;
    return at;
}

bool lines_blank(const struct lines *l) {
    return skip_blanks(l, 0) == l->size;
}

bool lines_keyword(const struct lines *l, const char *word, const char **rest, size_t *rest_size) {
    size_t n = strlen(word);
    if (l->size < n || memcmp(l->text, word, n) != 0 || (l->size > n && !is_blank(l->text[n])))
        return false;
    size_t from = skip_blanks(l, n);
    *rest = l->text + from;
    *rest_size = l->size - from;
    return true;
}

int lines_error(const struct lines *l, int column, struct err_list *errors, const char *format, ...) {
    va_list ap;
    va_start(ap, format);
    int rc = err_list_mistake(errors, l->file, l->number, column, format, ap);
    va_end(ap);
    return rc;
}

static int read_number(const struct lines *l, size_t from, size_t to, double *value,
                       struct err_list *errors) {
    char token[64];
    size_t size = to - from < sizeof token - 1 ? to - from : sizeof token - 1;
    memcpy(token, l->text + from, size);
    token[size] = '\0';
    if (size == 0)
        return lines_error(l, (int)from + 1, errors, "a number is missing before this comma");
    if (size < to - from || !number_read_double(token, value))
        return lines_error(l, (int)from + 1, errors, "'%.40s' is no number", token);
    return 0;
}

int lines_numbers(const struct lines *l, double *value, int *column, int max, struct err_list *errors) {
    int n = 0, status = 0;
    size_t at = skip_blanks(l, 0);
    while (at < l->size) {
        size_t to = at;
        while (to < l->size && l->text[to] != ',' && !is_blank(l->text[to]))
            to++;
        double number = 0;
        int rc = read_number(l, at, to, &number, errors);
        status = status ? status : rc;
        if (n < max) {
            value[n] = number;
            column[n] = (int)at + 1;
        }
        n++;
        at = skip_blanks(l, to);
        if (at < l->size && l->text[at] == ',')
            at = skip_blanks(l, at + 1);
    }
    return status ? status : n;
}
