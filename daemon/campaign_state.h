/*
 * campaign_state.h — all that a campaign knows while it runs: one struct, and the parts it is made of.
 *
 * It belongs to the campaign thread. Orders arrive inside bench_wait (campaign_queue.c) and only raise requests; the run
 * looks at them between sets, or is woken by `cancel`. Times of the session are the bench's clock plus offset_us, so that
 * they go on rising when a session is resumed by another goniod.
 * Checked    tests/scenario/
 */
#ifndef DAEMON_CAMPAIGN_STATE_H
#define DAEMON_CAMPAIGN_STATE_H

#include <jansson.h>
#include <stdatomic.h>

#include "daemon/campaign.h"
#include "daemon/estimator.h"
#include "daemon/reduce.h"
#include "daemon/writer.h"
#include "drivers/commission.h"

#define CAMPAIGN_QUEUE 32
#define CAMPAIGN_ENDED 16  /* jobs whose end is remembered */
#define CAMPAIGN_DARKS 256 /* twice the rungs of the ladder from 10 us to 65 s, and more */
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
    bool active, planned, person;             /* person: nothing but a person's word ends it */
    char text[sizeof((struct err *)0)->text]; /* whole: what to do is its end */
    const char *next;                         /* what follows: a sentence */
    int64_t since_us;                         /* of the bench's clock */
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
    int64_t estimate_done_us, step_since_us;
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

#endif
