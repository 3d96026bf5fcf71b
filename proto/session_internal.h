/*
 * session_internal.h — what the files of proto/session*.c share, and nobody else includes.
 * Checked    tests/unit/test_session*.c
 */
#ifndef PROTO_SESSION_INTERNAL_H
#define PROTO_SESSION_INTERNAL_H

#include "proto/session.h"
#include "proto/store.h"

#define SESSION_REQUESTS_KEPT 64

struct kept_request { /* a Modbus request already stored: polls repeat the same few for hours */
    int64_t id;
    uint32_t hash;
    char link[96];
    size_t size;
    uint8_t bytes[260]; /* the longest Modbus frame: 256 bytes RTU, 260 TCP */
};

struct session {
    struct store *store;
    char *path;
    char *name; /* what `path` is to be called from the first commit on; NULL: it has its name */
    bool read_only;
    bool spoilt; /* an add of the open transaction failed */
    int lock_fd;
    int user_version;
    int n_requests, next_request;
    struct kept_request request[SESSION_REQUESTS_KEPT];
};

extern const char *const SESSION_KINDS[EXPOSURE_KINDS];
extern const char *const SESSION_TABLES[]; /* in the order of the dump; ends with NULL */
int session_make_schema(struct store *store, struct err *e);
bool session_has_table(struct session *s, const char *table); /* a file of an older goniod may lack it */
/* Of one estimate, in tables of their own; where a file lacks them, what *m held stays and its losses are NaN. */
int session_write_figures(struct session *s, int64_t id, const struct estimate *m, struct err *e);
int session_read_figures(struct session *s, int64_t id, struct estimate *m, struct err *e);
/* n numbers of a column of bytes; all NaN where it does not hold so many: a damaged file knows nothing of them. */
void session_take_doubles(struct query *q, int at, double *value, size_t n);
/* Every add is all or nothing: inside the caller's transaction, or in one of its own. */
int session_enter(struct session *s, bool *own, struct err *e);
int session_leave(struct session *s, bool own, int rc, struct err *e);
/* Without replacing a file of that name. */
int session_rename(const char *from, const char *to, struct err *e);
/* Whether the file may be a session at all, from its first bytes and its size. */
int session_check_header(const char *path, struct err *e);

#endif
