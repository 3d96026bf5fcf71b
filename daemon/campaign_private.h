/*
 * campaign_private.h — what the files of the campaign share: one struct, and who changes which part of it.
 *
 * All of it belongs to the campaign thread. Orders arrive inside bench_wait (campaign_queue.c) and only raise
 * requests; the run looks at them between sets, or is woken by `cancel`. Times of the session are the bench's clock
 * plus offset_us, so that they go on rising when a session is resumed by another goniod.
 */
#ifndef DAEMON_CAMPAIGN_PRIVATE_H
#define DAEMON_CAMPAIGN_PRIVATE_H

#include <jansson.h>
#include <limits.h>
#include <math.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdlib.h>

#include "daemon/campaign.h"
#include "daemon/estimator.h"
#include "daemon/reduce.h"
#include "daemon/writer.h"
#include "drivers/commission.h"
#include "proto/units.h"

#define CAMPAIGN_QUEUE 32
#define CAMPAIGN_ENDED 16 /* jobs whose end is remembered */
#define CAMPAIGN_DARKS 64 /* more than the ladder of exposures has rungs */
#define CAMPAIGN_OVERLAP_SCANS                                                                               \
    16 /* at least: the noise of the electric dark alone would hide a bend of 0.1 % in four */
#define CAMPAIGN_REPEATS 3  /* of a step that failed for a passing reason, before the campaign holds */
#define CAMPAIGN_RETRY_S 10 /* a hold on a condition tries again this often */
#define MOUNTED_REFERENCE (-1)
#define MOUNTED_UNKNOWN (-2)
#define SURFACE_REFERENCE JOB_SAMPLES /* index of the diffuser in light[]; samples come first */
#define SURFACES (JOB_SAMPLES + 2)

struct campaign_job {
    int number;
    char name[48];
    char session[192]; /* resume this one; "" = a new run */
    struct job job;
    struct plan plan;
    bool planned; /* job and plan hold something */
    bool waited;  /* behind another campaign: nobody has just mounted its samples */
};

struct fit_points; /* campaign_fit.c: the present state of a sample's points */

struct campaign;

struct measured { /* one sample of the job and its session */
    struct campaign *campaign;
    bool used;
    int file; /* of the writer */
    char name[192];
    struct reducer *reducer;
    int64_t last_exposure, last_point; /* ids given so far */
    int n_points, n_provisional;
    struct fit_points *points;
    bool fit_wanted, fit_failed;
    struct estimate estimate;
    bool has_estimate;
};

struct light { /* what auto-exposure knows of a surface: peak as a share of saturation, per microsecond */
    bool known;
    double rate, growth;
};

struct
    dark { /* when each sample's session last got a dark of this exposure time and scan count; INT64_MIN = never */
    int exposure_us, n_scans;
    int64_t taken_us[JOB_SAMPLES];
    uint32_t owed; /* samples whose readings wait for it: the shutter is worked by hand */
    int64_t owed_us;
};

struct set { /* one set of scans between the spectrometer and the sessions */
    bool full, dark;
    int n_scans; /* 0: as many as the job says */
    struct exposure x;
    uint32_t samples;               /* whose sessions get it, one bit each */
    uint32_t closes_for, opens_for; /* control readings: for whose sessions it closes and opens a bracket */
    uint16_t *counts;
    size_t capacity;
};

struct campaign_requests { /* raised by orders, cleared by whoever obeys */
    bool pause, pause_now, go_on, abort, interrupt;
};

struct campaign_hold {
    bool active, planned, person; /* person: nothing but a person's word ends it */
    char text[256];
    int64_t since_us; /* of the bench's clock */
};

struct campaign {
    struct campaign_setup setup;
    struct bench *bench;
    struct clock *clock;
    struct instruments instruments;
    struct writer *writer;
    struct estimator *estimator;

    enum campaign_state state, state_before_pause;
    struct cancel cancel;
    struct campaign_requests want;
    struct campaign_hold hold;
    struct err failure; /* why the last campaign failed */
    char warning[256];  /* the newest */

    struct campaign_job *queue[CAMPAIGN_QUEUE];
    int n_queue, last_number;
    json_t *ended[CAMPAIGN_ENDED];
    int n_ended, all_ended;
    bool queue_waits; /* after an abort or a failure, until a person says continue */
    struct desk_order manual;
    bool manual_pending;
    struct commission commission;
    int commission_axis; /* whose commissioning is under way, -1 = none */

    struct campaign_job *current;
    struct job *job;
    struct plan *plan;
    bool *done;   /* [n_steps] */
    int *attempt; /* [n_steps] sets of the step so far */
    int *dark_attempt;
    int64_t last_done_us; /* when the last step succeeded: a hold that retries is as old as that */
    int n_done, step;     /* step: the one at hand, -1 = none */
    int64_t offset_us, started_us;
    int64_t estimate_done_us;
    struct measured measured[JOB_SAMPLES];

    int bracket, plan_bracket,
        last_bracket; /* running number (0 = none open); the plan's; the highest given */
    int64_t bracket_open_us;
    int mounted[CONFIG_POSITIONS]; /* by place of the holder: a sample, or one of MOUNTED_ */

    struct light light[SURFACES];
    struct dark dark[CAMPAIGN_DARKS];
    int n_darks;
    double last_peak, last_temperature_c;
    int last_exposure_us;
    int64_t last_set_us;
    bool spectrometer_suspect; /* its last call failed: it is opened again */
    int lamp;                  /* the shutter: 1 open, 0 shut, -1 not known */
    int64_t shutter_us;        /* when a person last worked it */
    int64_t lamp_since_us;     /* when the lamp was first lit in this goniod; INT64_MIN = never */
    struct frame *frames;
    int n_frames;

    struct set set;
    struct err store_failure; /* what reducing a set met inside bench_wait */
    int64_t ticket;           /* of the newest commit */
    int fit_sample;           /* whose question is open */
    bool fit_final, fit_warned;
    int fit_number;
    int64_t fit_last_point;

    int64_t published_us;
    atomic_int_least64_t utc_s; /* for campaign_check, which runs in another thread */
};

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
/* Waits, for a bounded time, until every axis is seen to stand; says so where one is not. */
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
