/*
 * store.h — the few calls of SQLite that a session file needs; the only file that knows sqlite3.h.
 *
 * A struct store is one connection, a struct query one prepared statement. store_query keeps the statement for the
 * life of the connection (for statements in frequent use); store_prepare makes one the caller frees. Parameters and
 * columns count from 0. query_run steps a statement that returns no rows, and resets it.
 *
 * Checksum   query_insert binds one more value after those bound: the CRC-32 of them all, in their order; query_crc is
 *            that of columns first to last of a row. A value is a letter and bytes, numbers little-endian: n for NULL;
 *            i and 8 bytes for a whole number; d and 8 bytes of IEEE 754 for another; t or b, 8 bytes of length and the
 *            bytes for text or bytes.
 * Values     NaN is stored as NULL and NULL is read as NaN, 0, "" or no bytes; -0 comes back as 0. Text and bytes of
 *            a column live until the next step or reset; bound ones must live until the step.
 * Threads    one at a time per store. Nothing here sleeps longer than STORE_BUSY_MS, inside SQLite.
 * Errors     -ERR_FULL no space, quota or file size limit; -ERR_BUSY locked by another connection; -ERR_INPUT not a
 *            database, or damaged; -ERR_STATE a constraint or trigger refused the row; -ERR_IO with errno.
 * Checked    tests/unit/test_session.c
 */
#ifndef PROTO_STORE_H
#define PROTO_STORE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "proto/err.h"

#define STORE_BUSY_MS 2000

struct store;
struct query;

int store_open(struct store **store, const char *path, bool read_only, struct err *e);
void store_close(struct store *store);
int store_exec(struct store *store, const char *sql, struct err *e);
/* The first column of the first row of sql as a number; `otherwise` when there is no row. */
int store_number(struct store *store, const char *sql, int64_t otherwise, int64_t *value, struct err *e);
bool store_in_transaction(const struct store *store);
/* Copies all pages into a fresh file at `to`, also while another connection writes. */
int store_backup(struct store *store, const char *to, struct err *e);
/* Folds the write-ahead log into the file and drops it. False: another connection still reads; the file is
 * whole all the same and the log goes with the last connection that may write. */
bool store_settle(struct store *store);

int store_query(struct store *store, const char *sql, struct query **q, struct err *e);
int store_prepare(struct store *store, const char *sql, struct query **q, struct err *e);
void query_free(struct query *q);

void query_bind_int(struct query *q, int at, int64_t value);
void query_bind_double(struct query *q, int at, double value);
void query_bind_text(struct query *q, int at, const char *text);
void query_bind_bytes(struct query *q, int at, const void *bytes, size_t size);
void query_bind_null(struct query *q, int at);

int query_step(struct query *q, struct err *e); /* 1 a row, 0 no more, or an error */
void query_reset(struct query *q);
int query_run(struct query *q, int64_t *id, struct err *e); /* id of the row inserted; may be NULL */
int query_insert(struct query *q, int64_t *id, struct err *e);

int64_t query_int(struct query *q, int at);
double query_double(struct query *q, int at);
const char *query_text(struct query *q, int at);
const void *query_bytes(struct query *q, int at, size_t *size);

enum query_type { QUERY_NULL, QUERY_INT, QUERY_DOUBLE, QUERY_TEXT, QUERY_BYTES };
enum query_type query_type(struct query *q, int at);
uint32_t query_crc(struct query *q, int first, int last);
int query_columns(struct query *q);
const char *query_name(struct query *q, int at);

#endif
