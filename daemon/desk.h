/*
 * desk.h — all that the control thread and the campaign thread exchange: orders in, outcomes, snapshot, events out.
 *
 * Control side   desk_post puts an order and gets a ticket; desk_control_fd becomes readable whenever an outcome,
 *                a snapshot or an event is new (read it with desk_control_clear, then ask for all three).
 * Campaign side  a bench service with desk_campaign_fd as its descriptor; desk_take_order inside bench_wait.
 *
 * Bounds         DESK_ORDERS orders from posting until their outcome is taken: the next post is -ERR_BUSY.
 *                Every ticket gets exactly one outcome. Events: the newest DESK_EVENTS are kept; an event posted
 *                with `coalesce` replaces an older one of its kind; who reads too slowly is told how many it missed.
 * Promises       no call waits for the other thread beyond a lock held for a few copies of pointers.
 * Ages           the snapshot carries clock stamps of each reading and the stamp at which it was made ("now_us");
 *                age of a reading = now_us - its stamp + time since the snapshot was published.
 * Checked        tests/unit/test_desk.c
 */
#ifndef DAEMON_DESK_H
#define DAEMON_DESK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "daemon/campaign_table.h"
#include "daemon/job.h"
#include "proto/err.h"

#define DESK_ORDERS 64
#define DESK_EVENTS 256

/* ---- orders: the payloads, by method of the socket ---- */

/* run {"job": {"name", "text"}, "files": [{"name", "text"}]}: outcome {"job": N, "position": P, "sessions":
 * [...]}. resume {"session": NAME}. A job's text and files are malloc'd; the desk takes them over with the
 * order. */
struct desk_run {
    char name[128]; /* file name, for messages */
    char *text;
    size_t size;
    int n_files;
    struct job_file file[JOB_FILES]; /* file[i].text is malloc'd too */
};

struct desk_session {
    char name[192]; /* a session's name, never a path */
};

enum desk_manual_kind {
    MANUAL_DEVICES,    /* what answers on USB and on each bus; outcome {"usb": [...], "axes": [...]} */
    MANUAL_WHERE,      /* outcome {"axes": {"source": {...}}} */
    MANUAL_HOME,       /* axis */
    MANUAL_MOVE,       /* axis, deg */
    MANUAL_SPECTRUM,   /* average, exposure_ms, lamp; outcome {"lambda_nm": [...], "counts": [...], ...} */
    MANUAL_COMMISSION, /* axis, answer; outcome {"text", "question", "done", "passed"} */
    MANUAL_KINDS
};

struct desk_manual {
    enum desk_manual_kind kind;
    char axis[16];
    double deg;
    int average;        /* scans, 0 = 1 */
    double exposure_ms; /* 0 = found by auto-exposure */
    bool lamp;
    char answer[64]; /* commission: "" starts over */
};

struct desk_order {
    enum campaign_command command;
    int64_t ticket; /* given by desk_post */
    union {
        struct desk_run run;         /* COMMAND_RUN */
        struct desk_session session; /* COMMAND_RESUME_SESSION */
        struct desk_manual manual;   /* COMMAND_MANUAL */
    };
};

void desk_order_free(struct desk_order *order); /* what it points to, not the order itself */

/* What became of an order: code 0 or positive enum err_code with its sentence. */
struct desk_outcome {
    int64_t ticket;
    int code;
    char text[512];
    char *json; /* malloc'd result object, or for -ERR_INPUT an array of {"file","line","column","text"}; may
                   be NULL; the taker frees it */
};

struct desk_event {
    int64_t serial; /* counts from 1 without gaps as posted; a reader sees a gap where it missed some */
    char kind[24];  /* "state" "step" "point" "estimate" "hold" "warning" "queue" "end" */
    char *json;     /* one object; belongs to the reader's copy */
    bool coalesce;
};

struct desk_snapshot { /* shared; never changes once published */
    const char *json;  /* one object, no newline */
    size_t size;
    int64_t serial;
};

struct desk;

int desk_new(struct desk **desk, struct err *e);
void desk_free(struct desk *desk);

/* ---- control thread ---- */

/* Takes the order's texts over on success (the caller must not free them then). */
int desk_post(struct desk *desk, const struct desk_order *order, int64_t *ticket, struct err *e);
int desk_control_fd(const struct desk *desk);
void desk_control_clear(struct desk *desk);
bool desk_take_outcome(struct desk *desk, struct desk_outcome *outcome); /* in the order in which they came */
const struct desk_snapshot *desk_snapshot_get(struct desk *desk);        /* never NULL; give back with _put */
void desk_snapshot_put(const struct desk_snapshot *snapshot);
/* Copies up to max events with serial > after into events (free with desk_event_free); returns how many. */
int desk_events_after(struct desk *desk, int64_t after, struct desk_event *events, int max);
void desk_event_free(struct desk_event *event);
int64_t desk_last_event(struct desk *desk); /* serial of the newest, 0 = none */

/* ---- campaign thread ---- */

int desk_campaign_fd(const struct desk *desk);
void desk_campaign_clear(struct desk *desk);
bool desk_take_order(struct desk *desk,
                     struct desk_order *order); /* the taker frees it with desk_order_free */
/* json is taken over (malloc'd) and may be NULL. code: 0 or either sign of an enum err_code. */
void desk_finish(struct desk *desk, int64_t ticket, int code, const char *text, char *json);
void desk_publish(struct desk *desk, char *json); /* takes json over; NULL is ignored */
void desk_event_post(struct desk *desk, const char *kind, bool coalesce, char *json); /* takes json over */

#endif
