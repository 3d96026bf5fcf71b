/*
 * writer_private.h — what waits to be written, shared by writer.c (threads and tickets) and writer_row.c (rows of a session).
 * Checked    tests/unit/test_writer.c
 */
#ifndef DAEMON_WRITER_PRIVATE_H
#define DAEMON_WRITER_PRIVATE_H

#include "daemon/writer.h"

enum record_kind {
    RECORD_CREATE,
    RECORD_OPEN,
    RECORD_CLOSE,
    RECORD_TEXT,
    RECORD_CALIBRATION,
    RECORD_EXPOSURE,
    RECORD_POINT,
    RECORD_BRACKET,
    RECORD_LINEARITY,
    RECORD_ESTIMATE,
    RECORD_SLOPES,
    RECORD_JOINT,
    RECORD_MODELS,
    RECORD_EVENT,
    RECORD_EXCHANGE,
    RECORD_COMMIT,
    RECORD_STOP
};

struct queued_exchange {
    int64_t sent_us, done_us;
    int result;
    size_t request_size, reply_size;
};

/* One allocation: the record, then its object, then up to two byte strings. */
struct record {
    struct record *next;
    enum record_kind kind;
    int file;
    int64_t ticket; /* 0 = none */
    int64_t us, id;
    size_t size;
    char key[96];
    void *object;
    void *bytes;
};

/* Writer thread: one record as its row. */
int writer_row(struct session *s, struct record *r, struct err *e);

#endif
