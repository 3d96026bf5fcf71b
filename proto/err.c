#include "proto/err.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const char *const NAMES[ERR_CODES] = {
    [ERR_NONE] = "none",
    [ERR_USAGE] = "usage",
    [ERR_INPUT] = "input",
    [ERR_RANGE] = "range",
    [ERR_IO] = "io",
    [ERR_FULL] = "full",
    [ERR_TIMEOUT] = "timeout",
    [ERR_LINK] = "link",
    [ERR_BUSY] = "busy",
    [ERR_DEVICE] = "device",
    [ERR_PERMISSION] = "permission",
    [ERR_CANCELLED] = "cancelled",
    [ERR_STATE] = "state",
    [ERR_FIT] = "fit",
    [ERR_NOMEM] = "memory",
};

static int claim(struct err *e, enum err_code code, const char *format, va_list ap) {
    if (!e || e->code != ERR_NONE)
        return 0;
    memset(e, 0, sizeof *e);
    e->code = code;
    vsnprintf(e->text, sizeof e->text, format, ap);
    return 1;
}

int err_set(struct err *e, enum err_code code, const char *format, ...) {
    va_list ap;
    va_start(ap, format);
    claim(e, code, format, ap);
    va_end(ap);
    return -(int)code;
}

int err_errno(struct err *e, enum err_code code, int saved_errno, const char *format, ...) {
    va_list ap;
    va_start(ap, format);
    int mine = claim(e, code, format, ap);
    va_end(ap);
    if (mine) {
        size_t used = strlen(e->text);
        char reason[128];
        snprintf(e->text + used, sizeof e->text - used, ": %s",
                 strerror_r(saved_errno, reason, sizeof reason));
        e->saved_errno = saved_errno;
    }
    return -(int)code;
}

int err_at(struct err *e, enum err_code code, const char *file, int line, int column, const char *format,
           ...) {
    va_list ap;
    va_start(ap, format);
    int mine = claim(e, code, format, ap);
    va_end(ap);
    if (mine) {
        snprintf(e->file, sizeof e->file, "%s", file);
        e->line = line;
        e->column = column;
    }
    return -(int)code;
}

void err_clear(struct err *e) {
    if (e)
        memset(e, 0, sizeof *e);
}

const char *err_name(int code) {
    int positive = code < 0 ? -code : code;
    return positive < ERR_CODES ? NAMES[positive] : "unknown";
}

const char *err_format(const struct err *e, char *buffer, size_t size) {
    if (e->file[0] && e->line && e->column)
        snprintf(buffer, size, "%s:%d:%d: %s", e->file, e->line, e->column, e->text);
    else if (e->file[0] && e->line)
        snprintf(buffer, size, "%s:%d: %s", e->file, e->line, e->text);
    else if (e->file[0])
        snprintf(buffer, size, "%s: %s", e->file, e->text);
    else
        snprintf(buffer, size, "%s", e->text);
    return buffer;
}

int err_list_add(struct err_list *list, const struct err *e) {
    if (list->n == list->capacity) {
        size_t capacity = list->capacity ? 2 * list->capacity : 8;
        struct err *grown = realloc(list->item, capacity * sizeof *grown);
        if (!grown)
            return -ERR_NOMEM;
        list->item = grown;
        list->capacity = capacity;
    }
    list->item[list->n++] = *e;
    return 0;
}

static size_t of_file(const struct err_list *list, const char *file) {
    size_t n = 0;
    for (size_t i = 0; i < list->n; i++)
        n += strcmp(list->item[i].file, file) == 0;
    return n;
}

int err_list_mistake(struct err_list *list, const char *file, int line, int column, const char *format,
                     va_list arguments) {
    struct err e = {0};
    claim(&e, ERR_INPUT, format, arguments);
    snprintf(e.file, sizeof e.file, "%s", file);
    e.line = line;
    e.column = column;
    if (of_file(list, e.file) < ERR_LIST_OF_FILE)
        err_list_add(list, &e);
    return -ERR_INPUT;
}

void err_list_free(struct err_list *list) {
    free(list->item);
    memset(list, 0, sizeof *list);
}
