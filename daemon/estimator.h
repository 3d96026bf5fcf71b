/*
 * estimator.h — goniod's side of `goniofit --serve`: one question at a time to a child process.
 *
 * goniod does not link the solver, which ends its process on some bad input. The child is started at the
 * first question by posix_spawn over a socketpair (its stdin and stdout), found as GONIOFIT or beside
 * goniod's own program, and asked in length-prefixed JSON (fit/serve.h). It ends when its socket closes, so
 * it never outlives goniod. A child that dies, or does not answer within ESTIMATOR_DEADLINE_S of real time
 * (also under a virtual clock), is killed and the question fails; after
 * ESTIMATOR_RESTARTS failures in a row it is not started again until estimator_forgive.
 *
 * Threads    the campaign thread.
 * Bench      a service; an answer comes in bench_wait.
 * Errors     -ERR_FIT with the reason.
 * Checked    tests/unit/test_estimator.c
 */
#ifndef DAEMON_ESTIMATOR_H
#define DAEMON_ESTIMATOR_H

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>

#include "drivers/bench.h"
#include "proto/err.h"

#define ESTIMATOR_DEADLINE_S 60
#define ESTIMATOR_RESTARTS 3
#define ESTIMATOR_REPLY_MAX (16u << 20)

struct estimator;

/* reply is NULL where e says why there is none. Called inside bench_wait. */
typedef void estimator_answer(void *arg, const json_t *reply, const struct err *e);

/* Where goniofit is: `named` if not NULL, else GONIOFIT, else beside the running program. */
int estimator_program(const char *named, char *path, size_t size, struct err *e);

/* program NULL: GONIOFIT, else goniofit beside the running program. deadline_s 0: ESTIMATOR_DEADLINE_S. */
int estimator_new(struct estimator **estimator, struct bench *bench, const char *program, int deadline_s,
                  struct err *e);
void estimator_free(struct estimator *estimator); /* kills the child; no answer comes any more */
/* Takes the text over (malloc'd). A virtual clock goes on for virtual_us and stands still from then on until there is
 * an answer, which comes at that time whenever the child has found it; with a real clock it comes as soon as it is
 * there. -ERR_BUSY while a question is open; -ERR_FIT when the child cannot be started. */
int estimator_ask(struct estimator *estimator, char *request, int64_t virtual_us, estimator_answer *answer,
                  void *arg, struct err *e);
bool estimator_idle(void *estimator); /* for bench_wait: no question is open */
/* An open question gets no answer any more. */
void estimator_drop(struct estimator *estimator);
void estimator_forgive(struct estimator *estimator);

#endif
