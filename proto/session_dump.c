#include "proto/session_internal.h"

#include <stdio.h>
#include <string.h>

/* Columns that hold an array of doubles; every other column of bytes is printed in hexadecimal. */
static bool holds_doubles(const char *column) {
    static const char *const names[] = {"rate", "sensitivity", "statistical", "common", "shared"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++)
        if (strcmp(names[i], column) == 0)
            return true;
    return false;
}

static void print_text(FILE *out, const char *text) {
    for (; *text; text++) {
        if (*text == '\\' || *text == '\t' || *text == '\n' || *text == '\r') {
            putc('\\', out);
            putc(*text == '\t' ? 't' : *text == '\n' ? 'n' : *text == '\r' ? 'r' : '\\', out);
        } else {
            putc(*text, out);
        }
    }
}

static void print_doubles(FILE *out, const uint8_t *bytes, size_t size) {
    double value;
    for (size_t at = 0; at + sizeof value <= size; at += sizeof value) {
        memcpy(&value, bytes + at, sizeof value);
        fprintf(out, "%s%.17g", at ? "," : "", value);
    }
}

static void print_hex(FILE *out, const uint8_t *bytes, size_t size) {
    static const char digits[] = "0123456789abcdef";
    char line[4096];
    size_t used = 0;
    for (size_t i = 0; i < size; i++) {
        line[used++] = digits[bytes[i] >> 4];
        line[used++] = digits[bytes[i] & 15];
        if (used == sizeof line) {
            fwrite(line, 1, used, out);
            used = 0;
        }
    }
    fwrite(line, 1, used, out);
}

static void print_value(FILE *out, struct query *q, int at) {
    size_t size;
    switch (query_type(q, at)) {
    case QUERY_NULL:
        break;
    case QUERY_INT:
        fprintf(out, "%lld", (long long)query_int(q, at));
        break;
    case QUERY_DOUBLE:
        fprintf(out, "%.17g", query_double(q, at));
        break;
    case QUERY_TEXT:
        print_text(out, query_text(q, at));
        break;
    case QUERY_BYTES: {
        const void *bytes = query_bytes(q, at, &size);
        if (holds_doubles(query_name(q, at)))
            print_doubles(out, bytes, size);
        else
            print_hex(out, bytes, size);
    }
    }
}

static void print_row(FILE *out, const char *table, struct query *q) {
    fputs(table, out);
    for (int at = 0; at < query_columns(q); at++) {
        if (strcmp(query_name(q, at), "crc") == 0)
            continue;
        fprintf(out, "\t%s=", query_name(q, at));
        print_value(out, q, at);
    }
    putc('\n', out);
}

int session_dump_table(struct session *s, const char *table, void *file, struct err *e) {
    char sql[96];
    if (!session_has_table(s, table))
        return 0;
    /* Every table's first two columns hold its key. */
    snprintf(sql, sizeof sql, "SELECT * FROM %s ORDER BY 1, 2", table);
    struct query *q;
    int rc = store_prepare(s->store, sql, &q, e);
    if (rc < 0)
        return rc;
    while ((rc = query_step(q, e)) == 1)
        print_row(file, table, q);
    query_free(q);
    return rc;
}

int session_dump(struct session *s, void *file, struct err *e) {
    int rc = 0;
    for (int i = 0; rc == 0 && SESSION_TABLES[i]; i++)
        rc = session_dump_table(s, SESSION_TABLES[i], file, e);
    if (rc == 0 && (fflush(file) != 0 || ferror(file)))
        rc = err_set(e, ERR_IO, "the dump of %s could not be written whole", s->path);
    return rc;
}
