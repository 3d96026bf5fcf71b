/*
 * writer.h — the one thread that touches session files while a campaign runs.
 *
 * The campaign hands records over (deep copies) and goes on; a commit makes all records of a file so far one
 * transaction and gives a ticket, and the campaign waits for `durable` in bench_wait, where the axes are
 * still polled: a disk that stalls for seconds delays nobody else. Several files may be open (the samples of
 * one job).
 *
 * Ids        exposures and points are numbered by the caller, counting from what the file holds; the writer
 *            checks that the file gives them the same number.
 * Exchanges  are buffered and commit with the next fact, at most 1 s old. (Virtual time runs a thousand times
 *            faster than the disk, so there the same second is 1,000 s.)
 * Failure    the first one (-ERR_FULL, -ERR_IO) ends all writing: the open transactions are rolled back whole,
 *            every ticket completes, writer_failure says why. What was durable stays durable.
 * Bench      a service: virtual time stands still while a commit is outstanding or no room is left.
 * Threads    all calls from the campaign thread. One writer per campaign.
 * Checked    tests/unit/test_writer.c, tests/scenario/test_campaign.c, tests/crash/
 */
#ifndef DAEMON_WRITER_H
#define DAEMON_WRITER_H

#include <stdbool.h>
#include <stdint.h>

#include "drivers/bench.h"
#include "proto/session.h"
#include "proto/session_linearity.h"

#define WRITER_FILES 16
#define WRITER_BYTES_MAX (8u << 20) /* waiting records; beyond it writer_has_room is false */

struct writer;

int writer_start(struct writer **writer, struct bench *bench, struct err *e);
/* Commits what waits, closes every file and joins the thread. */
void writer_stop(struct writer *writer);

/* file: the number by which the caller names an open session from here on. */
int writer_create(struct writer *writer, const char *path, int *file, struct err *e);
int writer_open(struct writer *writer, const char *path, int *file, struct err *e);
int64_t writer_close(struct writer *writer, int file); /* a ticket: checkpointed, one file */

void writer_text(struct writer *writer, int file, const char *key, const char *text);
void writer_calibration(struct writer *writer, int file, const struct calibration *c);
void writer_exposure(struct writer *writer, int file, const struct exposure *x);
void writer_point(struct writer *writer, int file, const struct point *p);
void writer_linearity(struct writer *writer, int file, const struct linearity *l);
void writer_bracket(struct writer *writer, int file, const struct bracket *b);
void writer_estimate(struct writer *writer, int file, int64_t now_us, int64_t last_point_id,
                     const struct estimate *m);
void writer_slopes(struct writer *writer, int file, const struct point_slope *slope, size_t n);
void writer_joint(struct writer *writer, int file, const struct joint *joint);
void writer_models(struct writer *writer, int file, const char *json);
void writer_event(struct writer *writer, int file, int64_t now_us, const char *kind, const char *json);
void writer_exchange(struct writer *writer, int file, int64_t sent_us, int64_t done_us, const char *link,
                     const void *request, size_t request_size, const void *reply, size_t reply_size,
                     int result);

int64_t writer_commit(struct writer *writer, int file);
int64_t writer_commit_all(struct writer *writer); /* the ticket of the last */
bool writer_durable(const struct writer *writer, int64_t ticket);
bool writer_has_room(void *writer); /* for bench_wait */
bool writer_idle(void *writer);     /* for bench_wait: every ticket has completed */
/* 0 while all is well, else the code and sentence of the first failure. */
int writer_failure(struct writer *writer, struct err *e);

#endif
