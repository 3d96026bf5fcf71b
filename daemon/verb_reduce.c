/* reduce: derives every point again from the raw rows; are the stored ones the same, to the last bit? */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/reduce.h"
#include "daemon/verb_session.h"
#include "proto/session_linearity.h"

static const char *const TABLES[] = {"linearity", "bracket", "point", "point_band", "point_common"};
#define FIRST_OF_POINT 2
#define N_TABLES (sizeof TABLES / sizeof TABLES[0])

struct table { /* the lines of one table, as the dump prints them */
    char *text;
    size_t size;
    FILE *out;
};

struct derived {
    struct table table[N_TABLES];
    int64_t points, brackets, linearities;
};

static int open_tables(struct table *t, struct err *e) {
    for (size_t i = 0; i < N_TABLES; i++)
        if (!(t[i].out = open_memstream(&t[i].text, &t[i].size)))
            return err_set(e, ERR_NOMEM, "out of memory for the derived rows");
    return 0;
}

static void close_tables(struct table *t) {
    for (size_t i = 0; i < N_TABLES; i++)
        if (t[i].out) {
            fclose(t[i].out);
            t[i].out = NULL;
        }
}

static void free_tables(struct table *t) {
    close_tables(t);
    for (size_t i = 0; i < N_TABLES; i++)
        free(t[i].text);
}

static int derive_point(void *arg, struct point *p, struct err *e) {
    struct derived *d = arg;
    (void)e;
    p->id = ++d->points;
    for (size_t i = FIRST_OF_POINT; i < N_TABLES; i++)
        session_print_point(d->table[i].out, TABLES[i], p);
    return 0;
}

static int derive_bracket(void *arg, const struct bracket *b, struct err *e) {
    struct derived *d = arg;
    (void)e;
    session_print_bracket(d->table[1].out, ++d->brackets, b);
    return 0;
}

static int derive_linearity(void *arg, struct linearity *l, struct err *e) {
    struct derived *d = arg;
    (void)e;
    l->id = ++d->linearities;
    session_print_linearity(d->table[0].out, l);
    return 0;
}

static int derive(struct session *s, struct derived *d, struct err *e) {
    struct reduce_sink sink = {d, derive_point, derive_bracket, derive_linearity};
    int rc = open_tables(d->table, e);
    if (rc == 0)
        rc = reduce_anew(s, &sink, e);
    close_tables(d->table);
    return rc;
}

static int read_stored(struct session *s, struct table *t, struct err *e) {
    int rc = open_tables(t, e);
    for (size_t i = 0; rc == 0 && i < N_TABLES; i++)
        rc = session_dump_table(s, TABLES[i], t[i].out, e);
    close_tables(t);
    return rc;
}

static size_t line_length(const char *text) {
    return strcspn(text, "\n");
}

/* "point_id=3 band=17" of a line of either table. */
static void key_of(const char *line, char *key, size_t size) {
    const char *first = strchr(line, '\t'), *second = first ? strchr(first + 1, '\t') : NULL;
    const char *end = second ? strpbrk(second + 1, "\t\n") : NULL;
    if (!end || strncmp(line, "point_", 6) != 0)
        end = second;
    size_t n = first && end && end > first ? (size_t)(end - first - 1) : 0;
    snprintf(key, size, "%.*s", (int)n, n ? first + 1 : "");
    for (char *c = key; *c; c++)
        if (*c == '\t')
            *c = ' ';
}

/* The first value in which two lines of one row differ. */
static void name_difference(const char *table, const char *stored, const char *derived, struct err *e) {
    char key[80];
    size_t at = 0, n = line_length(stored), m = line_length(derived);
    key_of(n ? stored : derived, key, sizeof key);
    if (!n || !m) {
        err_set(e, ERR_STATE, "%s %s: %s", table, key,
                n ? "stored, but not derived again" : "derived, but not stored");
        return;
    }
    while (at < n && at < m && stored[at] == derived[at])
        at++;
    while (at > 0 && stored[at - 1] != '\t')
        at--;
    err_set(e, ERR_STATE, "%s %s: stored %.*s, derived %.*s", table, key, (int)strcspn(stored + at, "\t\n,"),
            stored + at, (int)strcspn(derived + at, "\t\n,"), derived + at);
}

static int compare(const struct table *stored, const struct table *derived, struct err *e) {
    for (size_t i = 0; i < N_TABLES; i++) {
        const char *a = stored[i].text, *b = derived[i].text;
        while (*a && *b && line_length(a) == line_length(b) && memcmp(a, b, line_length(a)) == 0) {
            a += line_length(a) + (a[line_length(a)] == '\n');
            b += line_length(b) + (b[line_length(b)] == '\n');
        }
        if (*a || *b) {
            name_difference(TABLES[i], a, b, e);
            return -ERR_STATE;
        }
    }
    return 0;
}

static void print_json(const char *path, const struct derived *d, const struct err *e) {
    json_t *all =
        json_pack("{s:s, s:b, s:I, s:I, s:s}", "session", path, "same", e->code == 0, "points",
                  (json_int_t)d->points, "brackets", (json_int_t)d->brackets, "first_difference", e->text);
    json_dumpf(all, stdout, JSON_COMPACT);
    putchar('\n');
    json_decref(all);
}

static int reduce(struct session *s, const char *path, bool json, struct err *e) {
    struct derived d = {0};
    struct table stored[N_TABLES] = {0};
    int rc = derive(s, &d, e);
    if (rc == 0)
        rc = read_stored(s, stored, e);
    if (rc == 0) {
        rc = compare(stored, d.table, e);
        for (size_t i = 0; !json && i < N_TABLES; i++)
            fwrite(d.table[i].text, 1, d.table[i].size, stdout);
        if (json)
            print_json(path, &d, e);
    }
    free_tables(d.table);
    free_tables(stored);
    return rc;
}

int verb_reduce(int argc, char **argv) {
    struct verb_args args;
    struct err e = {0};
    struct session *s = NULL;
    char path[600];
    int done = verb_parse(argc, argv, NULL, 1, 1, &args);
    if (done >= 0)
        return done;
    int rc = verb_session_path(&args, args.operand[0], path, sizeof path, &e);
    if (rc == 0)
        rc = session_open(&s, path, true, &e);
    if (rc == 0)
        rc = reduce(s, path, args.json, &e);
    session_close(s, NULL);
    return rc < 0 ? verb_fail(&e, NULL) : 0;
}
