#include "proto/session_internal.h"

#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* The copy appears under its name only when it is whole, and never replaces a file. */
int session_copy(const char *from, const char *to, struct err *e) {
    char part[PATH_MAX];
    struct session *s;
    if (access(to, F_OK) == 0)
        return err_set(e, ERR_BUSY, "%s: exists already; nothing is overwritten", to);
    if (snprintf(part, sizeof part, "%s.part", to) >= (int)sizeof part)
        return err_set(e, ERR_USAGE, "%s: the name is too long", to);
    int rc = session_open(&s, from, true, e);
    if (rc < 0)
        return rc;
    unlink(part);
    rc = store_backup(s->store, part, e);
    if (rc == 0)
        rc = session_rename(part, to, e);
    unlink(part);
    session_close(s, NULL);
    return rc;
}

struct finding { /* rows of sql are what is wrong; the first column says which row, the second may say more */
    const char *sql, *sentence;
};

static const struct finding FINDINGS[] = {
    {"SELECT id, '' FROM exposure WHERE start_us >= end_us OR (kind <> 'dark' AND settled_us >= start_us)",
     "exposure %lld: settled < start < end does not hold%s; its points cannot be trusted"},
    /* Times bound an integration from outside: sets of one unchanged state may overlap by their bounds. */
    {"SELECT a.id, '' FROM exposure AS a JOIN exposure AS b ON b.id = a.id + 1 WHERE b.start_us < a.end_us "
     "AND"
     " (b.settled_us <> a.settled_us OR b.lamp <> a.lamp OR b.exposure_us <> a.exposure_us OR b.end_us <= "
     "a.end_us)",
     "exposure %lld: the next one begins before it ends%s"},
    {"SELECT a.id, '' FROM exposure AS a JOIN exposure AS b ON b.id = a.id + 1 WHERE a.kind <> 'dark' AND"
     " b.settled_us > a.settled_us AND b.settled_us <= a.end_us",
     "exposure %lld: the stage moved before it ended%s"},
    {"SELECT id, '' FROM exposure WHERE length(counts) <> 2 * n_scans * pixels",
     "exposure %lld: the bytes of its spectra do not fit its scans and pixels%s"},
    {"SELECT p.id, '' FROM point AS p LEFT JOIN exposure AS x ON x.id = p.exposure_id WHERE x.id IS NULL",
     "point %lld: its exposure is missing%s"},
    {"SELECT p.id, x.kind FROM point AS p JOIN exposure AS x ON x.id = p.exposure_id WHERE x.kind <> "
     "'sample'",
     "point %lld: its exposure is not of a sample but of kind %s"},
    {"SELECT p.id, '' FROM point AS p LEFT JOIN point AS old ON old.id = p.supersedes WHERE p.supersedes IS "
     "NOT NULL"
     " AND (old.id IS NULL OR old.id >= p.id OR NOT old.provisional OR old.exposure_id <> p.exposure_id)",
     "point %lld: it supersedes a row that is missing, later, final or of another exposure%s"},
    {"SELECT exposure_id, count(*) FROM point AS p WHERE NOT EXISTS (SELECT 1 FROM point AS later WHERE"
     " later.supersedes = p.id) GROUP BY exposure_id HAVING count(*) > 1",
     "exposure %lld: %s points stand for it; one was expected"},
    {"SELECT DISTINCT c.point_id, '' FROM (SELECT point_id FROM point_band UNION SELECT point_id FROM "
     "point_common) AS c"
     " LEFT JOIN point AS p ON p.id = c.point_id WHERE p.id IS NULL",
     "point %lld: its bands are there, its row is missing%s"},
    {"SELECT p.id, p.bracket FROM point AS p WHERE NOT p.provisional AND NOT EXISTS (SELECT 1 FROM bracket "
     "AS b WHERE"
     " b.number = p.bracket AND b.ended_by = 'reference')",
     "point %lld: it is final, but bracket %s was never closed"},
    {"SELECT m.id, '' FROM estimation AS m LEFT JOIN point AS p ON p.id = m.last_point_id WHERE p.id IS NULL "
     "AND"
     " m.last_point_id <> 0",
     "estimate %lld: the last point it rests on is missing%s"},
};

static int add_finding(struct err_list *found, const char *path, const char *text) {
    struct err e = {0};
    err_at(&e, ERR_INPUT, path, 0, 0, "%s", text);
    return err_list_add(found, &e);
}

static int look_for(struct session *s, const struct finding *f, struct err_list *found, struct err *e) {
    struct query *q;
    int rc = store_prepare(s->store, f->sql, &q, e);
    if (rc < 0)
        return rc;
    while ((rc = query_step(q, e)) == 1) {
        char text[300];
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
        snprintf(text, sizeof text, f->sentence, (long long)query_int(q, 0), query_text(q, 1));
#pragma GCC diagnostic pop
        rc = add_finding(found, s->path, text);
        if (rc < 0)
            break;
    }
    query_free(q);
    return rc;
}

/* SQLite's own check answers "ok" or one sentence a row. */
static int check_structure(struct session *s, struct err_list *found, struct err *e) {
    struct query *q;
    int rc = store_prepare(s->store, "PRAGMA integrity_check(20)", &q, e);
    if (rc < 0)
        return rc;
    while ((rc = query_step(q, e)) == 1)
        if (strcmp(query_text(q, 0), "ok") != 0)
            add_finding(found, s->path, query_text(q, 0));
    query_free(q);
    return rc;
}

static bool same_in(struct session *s, struct query *of_schema) {
    struct query *q;
    if (store_query(s->store,
                    "SELECT 1 FROM sqlite_master WHERE type = ? AND name = ? AND tbl_name = ? AND sql = ?",
                    &q, NULL) < 0)
        return false;
    for (int i = 0; i < query_columns(of_schema); i++)
        query_bind_text(q, i, query_text(of_schema, i));
    bool same = query_step(q, NULL) == 1;
    query_reset(q);
    return same;
}

static int compare_schema(struct session *s, struct store *fresh, struct err_list *found, struct err *e) {
    struct query *q;
    int rc = store_prepare(
        fresh, "SELECT type, name, tbl_name, sql FROM sqlite_master WHERE type IN ('table', 'view')", &q, e);
    if (rc < 0)
        return rc;
    while ((rc = query_step(q, e)) == 1) {
        char text[200];
        snprintf(text, sizeof text, "%.60s: is not defined as in a session; the file was damaged",
                 query_text(q, 1));
        if (!same_in(s, q) && (rc = add_finding(found, s->path, text)) < 0)
            break;
    }
    query_free(q);
    return rc;
}

/* The file names its tables and columns in plain text, which has no checksum: it must read as this goniod writes it. */
static int check_schema(struct session *s, struct err_list *found, struct err *e) {
    struct store *fresh;
    if (s->user_version != SESSION_USER_VERSION)
        return 0;
    int rc = store_open(&fresh, ":memory:", false, e);
    if (rc < 0)
        return rc;
    rc = session_make_schema(fresh, e);
    if (rc == 0)
        rc = compare_schema(s, fresh, found, e);
    store_close(fresh);
    return rc;
}

static int add_damaged(struct session *s, const char *table, struct query *q, const char *what,
                       struct err_list *found) {
    char text[300], second[40] = "";
    if (strcmp(query_name(q, 0), "id") != 0 && strcmp(query_name(q, 0), "key") != 0)
        snprintf(second, sizeof second, ", %s %s", query_name(q, 1), query_text(q, 1));
    snprintf(text, sizeof text, "%s, %s %.60s%s: %s; the file was damaged after it was written", table,
             query_name(q, 0), query_text(q, 0), second, what);
    return add_finding(found, s->path, text);
}

/* Rows of an older goniod have no checksum. One damaged row may have lost its own; several facts lack it only together. */
static bool begun_without_checksums(struct session *s) {
    struct query *q;
    if (store_prepare(s->store, "SELECT count(*) > 1 FROM fact WHERE crc IS NULL", &q, NULL) < 0)
        return true;
    bool without = query_step(q, NULL) == 1 && query_int(q, 0);
    query_free(q);
    return without;
}

/* Of each row the checksum that was stored with it, and whether rows that are numbered have all their numbers. */
static int check_rows(struct session *s, const char *table, bool old, struct err_list *found, struct err *e) {
    struct query *q;
    char sql[80];
    if (!session_has_table(s, table))
        return 0;
    snprintf(sql, sizeof sql, "SELECT * FROM %s", table);
    int rc = store_prepare(s->store, sql, &q, e);
    if (rc < 0)
        return rc;
    int last = query_columns(q) - 1, first = strcmp(query_name(q, 0), "id") == 0;
    bool checked = strcmp(query_name(q, last), "crc") == 0;
    int64_t number = 0;
    while (rc >= 0 && (rc = query_step(q, e)) == 1) {
        bool without = checked && query_type(q, last) == QUERY_NULL;
        if (without && !old)
            rc = add_damaged(s, table, q, "its checksum is missing", found);
        else if (checked && !without && query_int(q, last) != query_crc(q, first, last - 1))
            rc = add_damaged(s, table, q, "its values do not match their checksum", found);
        if (rc >= 0 && first == 1 && query_int(q, 0) != number + 1)
            rc = add_damaged(s, table, q, "the row before it is missing", found);
        number = query_int(q, 0); /* one gap is one finding, not one for every row behind it */
    }
    query_free(q);
    return rc < 0 ? rc : 0;
}

int session_verify(const char *path, struct err_list *found, struct err *e) {
    struct session *s;
    int rc = session_open(&s, path, true, e);
    if (rc < 0)
        return rc;
    rc = check_structure(s, found, e);
    if (rc == 0)
        rc = check_schema(s, found, e);
    for (size_t i = 0; rc == 0 && i < sizeof FINDINGS / sizeof FINDINGS[0]; i++)
        rc = look_for(s, &FINDINGS[i], found, e);
    bool old = rc == 0 && begun_without_checksums(s);
    for (int i = 0; rc == 0 && SESSION_TABLES[i]; i++)
        rc = check_rows(s, SESSION_TABLES[i], old, found, e);
    session_close(s, NULL);
    if (rc == 0 && found->n)
        rc = err_set(e, ERR_INPUT, "%s: %zu thing%s wrong; the first: %s", path, found->n,
                     found->n == 1 ? "" : "s", found->item[0].text);
    return rc;
}
