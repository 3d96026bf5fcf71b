/*
 * campaign_private.h — what the files of the campaign do for each other, by file.
 *
 * The struct they share is in campaign_state.h.
 * Checked    tests/scenario/
 */
#ifndef DAEMON_CAMPAIGN_PRIVATE_H
#define DAEMON_CAMPAIGN_PRIVATE_H

#include <limits.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>

#include "daemon/campaign_state.h"
#include "proto/units.h"

/* Session time. */
static inline int64_t campaign_now_us(const struct campaign *c) {
    return clock_now_us(c->clock) + c->offset_us;
}

/* campaign.c */
void campaign_run(struct campaign *c, struct campaign_job *job);
int campaign_move(struct campaign *c, const struct step *step, struct err *e);

/* campaign_queue.c */
int campaign_queue_start(struct campaign *c, struct err *e);
struct campaign_job *campaign_queue_next(struct campaign *c);
void campaign_job_free(struct campaign_job *job);
int campaign_job_plan(const struct campaign *c, const char *file, const char *text, size_t size,
                      const struct job_file *files, int n_files, struct campaign_job *out,
                      struct err_list *errors);
json_t *campaign_errors_json(const struct err_list *errors);
void campaign_set_state(struct campaign *c, enum campaign_state state);
bool campaign_must_end(const struct campaign *c); /* abort or interrupt is wanted */

/* campaign_prepare.c */
void campaign_session_path(const struct campaign *c, const char *name, char path[PATH_MAX]);
int campaign_prepare(struct campaign *c, struct err *e);
int campaign_home_where_needed(struct campaign *c, struct err *e);
int campaign_ready_spectrometer(struct campaign *c, struct err *e);
int campaign_warm_up(struct campaign *c, struct err *e);
void campaign_reduce_setup(const struct campaign *c, struct reduce_setup *setup);

/* campaign_bracket.c */
int campaign_next_step(struct campaign *c); /* the first that is not done, -1 = none */
int campaign_read_step(struct campaign *c, int k, struct err *e);
void campaign_mark_done(struct campaign *c, int k);
int campaign_end_bracket(struct campaign *c, const char *why, struct err *e);

/* campaign_expose.c */
/* A set of scans of step k where the stage stands; shorter again while it saturates. */
int campaign_expose(struct campaign *c, int k, const struct set *head, struct err *e);
/* A set as above, and one that is several times shorter. */
int campaign_expose_overlap(struct campaign *c, int k, const struct set *head, struct err *e);
struct light *campaign_light_of(struct campaign *c, const struct step *s);
/* Takes the darks that readings wait for, where the shutter is worked by hand. */
int campaign_owed_darks(struct campaign *c, int k, struct err *e);
int campaign_set_lamp(struct campaign *c, bool on, struct err *e);

/* campaign_store.c */
int campaign_store_start(struct campaign *c);
/* Waits until c->set is free and the disk keeps up. */
int campaign_store_room(struct campaign *c, struct err *e);
void campaign_store_set(
    struct campaign *c); /* c->set is complete: reduced and written during the next wait */
int campaign_store_drain(struct campaign *c, const struct cancel *cancel, struct err *e); /* all durable */
void campaign_store_event(struct campaign *c, const char *kind,
                          json_t *json); /* every session; takes json over */
struct reduce_sink campaign_store_sink(struct measured *m, struct campaign *c);
void campaign_seen_exchange(void *campaign, const char *link, int64_t sent_us, int64_t done_us,
                            const struct modbus_request *sent, const struct modbus_request *reply,
                            int result);

/* campaign_fit.c */
struct fit_points *fit_points_new(void);
void fit_points_free(struct fit_points *f);
int fit_points_exposure(struct fit_points *f, int64_t id, bool mirrored);
int fit_points_add(struct fit_points *f, const struct point *p);
void fit_points_bracket(struct fit_points *f, const struct bracket *b);
void campaign_fit_point(struct campaign *c, struct measured *m); /* a point is new */
void campaign_fit_next(struct campaign *c);                      /* asks, if one is wanted and none is open */
json_t *campaign_fit_setup(const struct campaign *c);
int campaign_fit_final(struct campaign *c, struct err *e);

/* campaign_hold.c */
int campaign_pause(struct campaign *c, struct err *e);
int campaign_hold(struct campaign *c, const char *text, bool planned, int64_t retry_us, struct err *e);
void campaign_mounted_at_start(struct campaign *c);
int campaign_hold_for_samples(struct campaign *c, struct err *e);     /* of a job that waited in the queue */
int campaign_hold_for_step(struct campaign *c, int k, struct err *e); /* mounting and turning by hand */

/* campaign_end.c */
/* A drive that does not come to rest in this time is reported, not waited for. */
#define CAMPAIGN_STANDSTILL_US (10 * US_PER_S)
/* Waits, for that time, until every axis is seen to stand; says so where one is not. */
void campaign_await_standstill(struct campaign *c);
void campaign_end(struct campaign *c, int result, const struct err *why);
int campaign_park(struct campaign *c, struct err *e);

/* campaign_resume.c */
int campaign_resume_plan(struct campaign *c, const char *session, struct campaign_job *job, struct err *e);
int campaign_resume_sessions(struct campaign *c, struct err *e);

/* campaign_status.c */
int campaign_status_start(struct campaign *c);
void campaign_publish(struct campaign *c);
void campaign_event(struct campaign *c, const char *kind, bool coalesce, json_t *json); /* takes json over */
void campaign_warn(struct campaign *c, const char *format, ...) __attribute__((format(printf, 2, 3)));
json_t *campaign_stage_json(const struct campaign *c);
json_t *campaign_session_names(const struct campaign *c);
void campaign_job_ended(struct campaign *c, enum campaign_state state, json_t *sessions);

/* campaign_notify.c */
void campaign_notify(struct campaign *c, const char *kind, const json_t *json);
void campaign_notify_reap(void);

/* campaign_manual.c */
void campaign_manual(struct campaign *c);

#endif
