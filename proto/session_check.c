#include "proto/session_internal.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

/* Without replacing. File systems of memory sticks know no hard links, those of networks no such renaming. */
static int give_name(const char *part, const char *to, struct err *e) {
    if (renameat2(AT_FDCWD, part, AT_FDCWD, to, RENAME_NOREPLACE) == 0)
        return 0;
    int saved_errno = errno;
    if (saved_errno == EINVAL || saved_errno == ENOSYS) {
        if (link(part, to) == 0)
            return 0;
        saved_errno = errno;
    }
    return err_errno(e, saved_errno == EEXIST ? ERR_BUSY : ERR_IO, saved_errno, "cannot name the copy %s",
                     to);
}

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
        rc = give_name(part, to, e);
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

int session_verify(const char *path, struct err_list *found, struct err *e) {
    struct session *s;
    int rc = session_open(&s, path, true, e);
    if (rc < 0)
        return rc;
    rc = check_structure(s, found, e);
    for (size_t i = 0; rc == 0 && i < sizeof FINDINGS / sizeof FINDINGS[0]; i++)
        rc = look_for(s, &FINDINGS[i], found, e);
    session_close(s, NULL);
    if (rc == 0 && found->n)
        rc = err_set(e, ERR_INPUT, "%s: %zu thing%s wrong; the first: %s", path, found->n,
                     found->n == 1 ? "" : "s", found->item[0].text);
    return rc;
}
