#include "proto/store.h"

#include <errno.h>
#include <math.h>
#include <sqlite3.h>
#include <stdlib.h>
#include <string.h>

#include "proto/crc.h"

#define KEPT_QUERIES 40

struct query {
    struct store *store;
    const char *sql;
    sqlite3_stmt *statement;
    uint32_t crc; /* of the values bound so far */
    int bound;
};

struct store {
    sqlite3 *db;
    char *path;
    struct query kept[KEPT_QUERIES];
    int n_kept;
};

static bool no_room(int rc, int saved_errno) {
    return rc == SQLITE_FULL || ((rc & 0xff) == SQLITE_IOERR &&
                                 (saved_errno == ENOSPC || saved_errno == EDQUOT || saved_errno == EFBIG));
}

static int fail(struct store *store, int rc, struct err *e) {
    int saved_errno = errno; /* of the call that just failed; sqlite3_system_errno is 0 for a refused write */
    const char *said = sqlite3_errmsg(store->db);
    if (no_room(rc, saved_errno))
        return err_set(e, ERR_FULL, "%s: no space left for the session; free some, then resume: %s",
                       store->path, said);
    switch (rc & 0xff) {
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
        return err_set(e, ERR_BUSY, "%s: in use by another program; try again when it is done", store->path);
    case SQLITE_NOTADB:
    case SQLITE_CORRUPT:
        return err_set(e, ERR_INPUT, "%s: damaged or not a session file (%s); `gonioctl verify` says more",
                       store->path, said);
    case SQLITE_CONSTRAINT:
        return err_set(e, ERR_STATE, "%s: refused: %s", store->path, said);
    case SQLITE_READONLY:
    case SQLITE_PERM:
        return err_set(e, ERR_PERMISSION, "%s: may not be written: %s", store->path, said);
    case SQLITE_NOMEM:
        return err_set(e, ERR_NOMEM, "%s: out of memory", store->path);
    case SQLITE_CANTOPEN:
    case SQLITE_IOERR:
        return err_errno(e, ERR_IO, saved_errno, "%s: %s", store->path, said);
    default:
        return err_set(e, ERR_IO, "%s: %s", store->path, said);
    }
}

int store_open(struct store **out, const char *path, bool read_only, struct err *e) {
    struct store *store = calloc(1, sizeof *store);
    if (!store || !(store->path = strdup(path))) {
        free(store);
        return err_set(e, ERR_NOMEM, "%s: out of memory", path);
    }
    int flags = read_only ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
    int rc = sqlite3_open_v2(path, &store->db, flags | SQLITE_OPEN_NOMUTEX, NULL);
    if (rc != SQLITE_OK) {
        int code = fail(store, rc, e);
        store_close(store);
        return code;
    }
    sqlite3_extended_result_codes(store->db, 1);
    sqlite3_busy_timeout(store->db, STORE_BUSY_MS);
    *out = store;
    return 0;
}

void store_close(struct store *store) {
    if (!store)
        return;
    for (int i = 0; i < store->n_kept; i++)
        sqlite3_finalize(store->kept[i].statement);
    sqlite3_close_v2(store->db);
    free(store->path);
    free(store);
}

int store_exec(struct store *store, const char *sql, struct err *e) {
    int rc = sqlite3_exec(store->db, sql, NULL, NULL, NULL);
    return rc == SQLITE_OK ? 0 : fail(store, rc, e);
}

int store_number(struct store *store, const char *sql, int64_t otherwise, int64_t *value, struct err *e) {
    struct query *q;
    int rc = store_prepare(store, sql, &q, e);
    if (rc < 0)
        return rc;
    rc = query_step(q, e);
    *value = rc == 1 ? query_int(q, 0) : otherwise;
    query_free(q);
    return rc < 0 ? rc : 0;
}

bool store_in_transaction(const struct store *store) {
    return !sqlite3_get_autocommit(store->db);
}

static int copy_pages(struct store *store, struct store *copy, struct err *e) {
    sqlite3_backup *backup = sqlite3_backup_init(copy->db, "main", store->db, "main");
    if (!backup)
        return fail(copy, sqlite3_errcode(copy->db), e);
    sqlite3_backup_step(backup, -1); /* all pages under one read transaction: one moment of the session */
    int rc = sqlite3_backup_finish(backup);
    return rc == SQLITE_OK ? 0 : fail(copy, rc, e);
}

int store_backup(struct store *store, const char *to, struct err *e) {
    struct store *copy;
    int rc = store_open(&copy, to, false, e);
    if (rc < 0)
        return rc;
    rc = copy_pages(store, copy, e);
    if (rc == 0)
        rc = store_exec(copy, "PRAGMA journal_mode = DELETE", e);
    store_close(copy);
    return rc;
}

bool store_settle(struct store *store) {
    sqlite3_wal_checkpoint_v2(store->db, NULL, SQLITE_CHECKPOINT_TRUNCATE, NULL, NULL);
    return sqlite3_exec(store->db, "PRAGMA journal_mode = DELETE", NULL, NULL, NULL) == SQLITE_OK;
}

static int prepare(struct store *store, const char *sql, struct query *q, struct err *e) {
    int rc = sqlite3_prepare_v3(store->db, sql, -1, SQLITE_PREPARE_PERSISTENT, &q->statement, NULL);
    if (rc != SQLITE_OK)
        return fail(store, rc, e);
    q->store = store;
    q->sql = sql;
    return 0;
}

int store_query(struct store *store, const char *sql, struct query **q, struct err *e) {
    for (int i = 0; i < store->n_kept; i++)
        if (strcmp(store->kept[i].sql, sql) == 0) {
            *q = &store->kept[i];
            return 0;
        }
    if (store->n_kept == KEPT_QUERIES)
        return err_set(e, ERR_NOMEM, "%s: more than %d kept statements", store->path, KEPT_QUERIES);
    *q = &store->kept[store->n_kept];
    int rc = prepare(store, sql, *q, e);
    if (rc == 0)
        store->n_kept++;
    return rc;
}

int store_prepare(struct store *store, const char *sql, struct query **out, struct err *e) {
    struct query *q = calloc(1, sizeof *q);
    if (!q)
        return err_set(e, ERR_NOMEM, "%s: out of memory", store->path);
    int rc = prepare(store, sql, q, e);
    if (rc < 0)
        free(q);
    else
        *out = q;
    return rc;
}

void query_free(struct query *q) {
    if (!q)
        return;
    sqlite3_finalize(q->statement);
    free(q);
}

static uint32_t crc_eight(uint32_t crc, char letter, const void *eight) {
    return crc32_add(crc32_add(crc, &letter, 1), eight, 8);
}

/* Whether a whole number is stored as an integer or as a real depends on its column, and says nothing. */
static uint32_t crc_number(uint32_t crc, double value) {
    int64_t whole = fabs(value) < 9007199254740992.0 ? (int64_t)value : 0; /* 2^53 */
    if (isnan(value))
        return crc32_add(crc, "n", 1);
    return (double)whole == value ? crc_eight(crc, 'i', &whole) : crc_eight(crc, 'd', &value);
}

static uint32_t crc_bytes(uint32_t crc, char letter, const void *bytes, size_t size) {
    int64_t length = (int64_t)size;
    return crc32_add(crc_eight(crc, letter, &length), bytes, size);
}

uint32_t query_crc(struct query *q, int first, int last) {
    uint32_t crc = 0;
    for (int at = first; at <= last; at++) {
        enum query_type type = query_type(q, at); /* asking for another type would change it */
        if (type == QUERY_INT) {
            int64_t whole = query_int(q, at);
            crc = crc_eight(crc, 'i', &whole);
        } else if (type == QUERY_TEXT || type == QUERY_BYTES) {
            size_t size;
            const void *bytes = query_bytes(q, at, &size);
            crc = crc_bytes(crc, type == QUERY_TEXT ? 't' : 'b', bytes, size);
        } else {
            crc = crc_number(crc, query_double(q, at));
        }
    }
    return crc;
}

void query_bind_int(struct query *q, int at, int64_t value) {
    q->crc = crc_eight(q->crc, 'i', &value);
    q->bound = at + 1;
    sqlite3_bind_int64(q->statement, at + 1, value);
}

void query_bind_double(struct query *q, int at, double value) {
    q->crc = crc_number(q->crc, value);
    q->bound = at + 1;
    sqlite3_bind_double(q->statement, at + 1, value);
}

void query_bind_text(struct query *q, int at, const char *text) {
    q->crc = crc_bytes(q->crc, 't', text, strlen(text));
    q->bound = at + 1;
    sqlite3_bind_text(q->statement, at + 1, text, -1, SQLITE_STATIC);
}

void query_bind_bytes(struct query *q, int at, const void *bytes, size_t size) {
    q->crc = crc_bytes(q->crc, 'b', bytes, size);
    q->bound = at + 1;
    sqlite3_bind_blob64(q->statement, at + 1, bytes ? bytes : "", size, SQLITE_STATIC);
}

void query_bind_null(struct query *q, int at) {
    q->crc = crc32_add(q->crc, "n", 1);
    q->bound = at + 1;
    sqlite3_bind_null(q->statement, at + 1);
}

int query_step(struct query *q, struct err *e) {
    int rc = sqlite3_step(q->statement);
    if (rc == SQLITE_ROW)
        return 1;
    if (rc == SQLITE_DONE)
        return 0;
    return fail(q->store, rc, e);
}

void query_reset(struct query *q) {
    sqlite3_reset(q->statement);
    sqlite3_clear_bindings(q->statement);
    q->crc = 0;
    q->bound = 0;
}

int query_run(struct query *q, int64_t *id, struct err *e) {
    int rc = query_step(q, e);
    if (rc == 0 && id)
        *id = sqlite3_last_insert_rowid(q->store->db);
    query_reset(q);
    return rc < 0 ? rc : 0;
}

int query_insert(struct query *q, int64_t *id, struct err *e) {
    sqlite3_bind_int64(q->statement, q->bound + 1, q->crc);
    return query_run(q, id, e);
}

int64_t query_int(struct query *q, int at) {
    return sqlite3_column_int64(q->statement, at);
}

double query_double(struct query *q, int at) {
    return query_type(q, at) == QUERY_NULL ? NAN : sqlite3_column_double(q->statement, at);
}

const char *query_text(struct query *q, int at) {
    const char *text = (const char *)sqlite3_column_text(q->statement, at);
    return text ? text : "";
}

const void *query_bytes(struct query *q, int at, size_t *size) {
    const void *bytes = sqlite3_column_blob(q->statement, at);
    *size = (size_t)sqlite3_column_bytes(q->statement, at);
    return bytes;
}

enum query_type query_type(struct query *q, int at) {
    switch (sqlite3_column_type(q->statement, at)) {
    case SQLITE_INTEGER:
        return QUERY_INT;
    case SQLITE_FLOAT:
        return QUERY_DOUBLE;
    case SQLITE_TEXT:
        return QUERY_TEXT;
    case SQLITE_BLOB:
        return QUERY_BYTES;
    default:
        return QUERY_NULL;
    }
}

int query_columns(struct query *q) {
    return sqlite3_column_count(q->statement);
}

const char *query_name(struct query *q, int at) {
    return sqlite3_column_name(q->statement, at);
}
