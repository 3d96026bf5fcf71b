/*
 * session.h — one measured sample: data set, recording and checkpoint in one SQLite file (design 4.5).
 *
 * Raw rows (exposures, exchanges, events) are facts; points and estimates are derived from them and can be
 * derived again. Tables are insert-only; a final point supersedes its provisional one by its `supersedes`
 * column. WAL and synchronous=FULL while open; closing leaves one file. docs/session-format.md holds the schema.
 *
 * Making     a new session lies in .NAME.part beside its place and gets its name with its first commit: what a kill, or a
 *            full disk, leaves before that has no session's name, and session_sweep clears it away. Closed before its
 *            first commit, it has never been.
 * Writing    one writer at a time, by a lock on PATH-lock that dies with its process. An add outside
 *            session_begin .. session_commit is a transaction of its own. An add that fails spoils its transaction:
 *            commit then rolls back. After -ERR_FULL the session may be used again once there is room.
 * Reading    also beside a live writer. Network file systems are refused for writing only.
 * Threads    a struct session is used by one thread at a time (the writer thread while a campaign runs).
 * Errors     -ERR_FULL disk full (the transaction is rolled back whole); -ERR_BUSY another daemon has it open for
 *            writing; -ERR_INPUT truncated or not a goniod session; -ERR_STATE a row that would break a promise
 *            (settled < start < end, a point superseded twice, a text written twice); -ERR_IO with errno.
 * Checked    tests/unit/test_session*.c, tests/unit/test_session_format.py, tests/crash/test_session_kill.c
 */
#ifndef PROTO_SESSION_H
#define PROTO_SESSION_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "proto/calibration.h"
#include "proto/err.h"
#include "proto/exposure.h"
#include "proto/joint.h"
#include "proto/material.h"
#include "proto/point.h"

#define SESSION_APPLICATION_ID 0x474f4e49 /* "GONI" */
#define SESSION_USER_VERSION 3

struct exchange { /* one Modbus transaction; request and reply are the caller's memory */
    int64_t id;
    int64_t sent_us, done_us;
    const char *link;
    const void *request, *reply;
    size_t request_size, reply_size;
    int result;
};

struct session_summary {
    int64_t n_exposures, n_points, n_brackets, n_estimates, n_events, n_exchanges;
    int64_t n_final, n_provisional; /* points that stand; n_points counts the rows */
    int64_t first_us, last_us;      /* of the exposures; 0 when there is none */
    int64_t first_utc_us;           /* microseconds since 1970 */
    int user_version;
};

struct session;

/* Text facts, written once when the session is made: "job", "config", "sample", "certificate",
 * "profile/NAME", "goniod_version", "seed", "geometry_convention", ... */
int session_create(struct session **s, const char *path, struct err *e); /* -ERR_BUSY if path exists */
/* Removes what was being made in this folder by a process that is no more. */
void session_sweep(const char *folder);
int session_open(struct session **s, const char *path, bool read_only, struct err *e);
int session_close(struct session *s, struct err *e); /* checkpoints and leaves one file */

int session_begin(struct session *s, struct err *e);
int session_commit(struct session *s, struct err *e);
void session_rollback(struct session *s);

int session_set_text(struct session *s, const char *key, const char *text, struct err *e);
int session_get_text(struct session *s, const char *key, char **text,
                     struct err *e); /* malloc; NULL if absent */
int session_set_calibration(struct session *s, const struct calibration *c, struct err *e);
int session_get_calibration(struct session *s, struct calibration *c, struct err *e);

int session_add_exposure(struct session *s, struct exposure *x, struct err *e);
int session_add_point(struct session *s, struct point *p, struct err *e);
int session_add_bracket(struct session *s, const struct bracket *b, struct err *e);
int session_add_estimate(struct session *s, int64_t now_us, int64_t last_point_id, const struct estimate *m,
                         struct err *e);
/* Of the newest estimate: how its points answer to the axes (measurement.md 6). */
int session_add_slopes(struct session *s, const struct point_slope *slope, size_t n, struct err *e);
int session_add_joint(struct session *s, const struct joint *joint,
                      struct err *e); /* of the newest estimate */
int session_add_event(struct session *s, int64_t now_us, const char *kind, const char *json, struct err *e);
/* A Modbus exchange: request and reply as register images; result as returned by the link. */
int session_add_exchange(struct session *s, int64_t sent_us, int64_t done_us, const char *link,
                         const void *request, size_t request_size, const void *reply, size_t reply_size,
                         int result, struct err *e);

/* Readers call back in id order; a callback's non-zero return ends the walk and is returned. */
int session_each_exposure(struct session *s, int (*seen)(void *arg, const struct exposure *x), void *arg,
                          struct err *e);
int session_each_point(struct session *s, bool with_superseded, int (*seen)(void *arg, const struct point *p),
                       void *arg, struct err *e);
int session_each_bracket(struct session *s, int (*seen)(void *arg, const struct bracket *b), void *arg,
                         struct err *e);
int session_each_exchange(struct session *s, int (*seen)(void *arg, const struct exchange *x), void *arg,
                          struct err *e);
int session_each_text(struct session *s, int (*seen)(void *arg, const char *key, const char *value),
                      void *arg, struct err *e);
int session_get_summary(struct session *s, struct session_summary *summary, struct err *e);
int session_each_event(struct session *s,
                       int (*seen)(void *arg, int64_t us, const char *kind, const char *json), void *arg,
                       struct err *e);
int session_each_estimate(struct session *s,
                          int (*seen)(void *arg, int64_t us, int64_t last_point_id, const struct estimate *m),
                          void *arg, struct err *e);
int session_last_estimate(struct session *s, struct estimate *m,
                          struct err *e); /* -ERR_STATE when there is none */
/* Of the newest estimate, several models of the same points: "models" of fit/serve.h. NULL where there was one. */
int session_add_models(struct session *s, const char *json, struct err *e);
int session_last_models(struct session *s, char **json, struct err *e); /* malloc */
/* The newest joint fit, which joint_free frees; -ERR_STATE when there is none. */
int session_last_joint(struct session *s, struct joint *joint, struct err *e);

/* Every table in key order as text (`gonioctl show S --dump`); the "same bytes" of design 3. One line a row:
 * table name, then column=value separated by tabs; numbers at 17 digits, tabs and line ends in text escaped.
 */
int session_dump(struct session *s, void *file, struct err *e);                          /* file: FILE * */
int session_dump_table(struct session *s, const char *table, void *file, struct err *e); /* one of them */
/* The same lines for rows that are not stored; table: point, point_band or point_common. */
void session_print_point(void *file, const char *table, const struct point *p);
void session_print_bracket(void *file, int64_t id, const struct bracket *b);
/* What u_common of the views holds: the common parts in quadrature. */
double session_common_mean(const struct point *p);
double session_common_band(const struct point *p, int band);
/* Whether a goniod holds it open for writing; false for a session that was cut off. */
bool session_is_written(const struct session *s);
int session_copy(const char *from, const char *to, struct err *e); /* snapshot, also of a live one */
/* Reads everything: structure, the checksum of every row, foreign keys, settled < start < end, the exposure of every point, the chains
 * of superseded points. 0 with an empty list: sound. -ERR_INPUT: the list says what is wrong. */
int session_verify(const char *path, struct err_list *found, struct err *e);
/* The name of a file system on which a session must not be written (the log needs memory shared between
 * processes), by its statfs magic; NULL = local. */
const char *session_network_filesystem(unsigned long magic);

#endif
