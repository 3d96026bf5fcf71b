/*
 * plan.h — an ordered array of steps: what `gonioctl check` prints is what runs.
 *
 * The plan orders geometries to save travel, groups what a person has to do by hand, puts a reading of the
 * reference diffuser at both ends of every bracket, repeats about 5 % of the points at the end, and says what
 * all that costs: time with an interval, exposures, bytes on disk. The same job, config and devices give the
 * same plan.
 *
 * Refused    each with its reason: outside soft limits; blind zone; keep-out zone, or no way round one;
 *            footprint larger than sample or diffuser; between the two filling cases; not covered by the
 *            certificate; an angle at which a fixed axis does not stand.
 * Brackets   a control reading (STEP_REFERENCE, control) opens and closes them. `bracket` of a control reading
 *            is the bracket it closes or, where it closes none, the one it opens; `opens` is the bracket it
 *            opens, 0 = none: the reading shared by brackets n and n + 1 has bracket n, opens n + 1.
 * Time       a step takes the slowest of its moves, a dark where one is due, and its set of scans at a middle
 *            exposure, the geometric mean of the job's limits; the interval takes shorter and longer ones and
 *            slower people. Brackets keep bracket_min by this clock.
 * Checked    tests/unit/test_plan.c, tests/unit/test_plan_random.c, tests/scenario/
 */
#ifndef DAEMON_PLAN_H
#define DAEMON_PLAN_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "daemon/config.h"
#include "daemon/job.h"
#include "drivers/spectrometer.h"
#include "drivers/stage.h"

struct profile;
struct json_t;

#define PLAN_VIA 4
/* Exposures that never differ by more need no test of linearity: levels and times then cancel to second order. */
#define PLAN_OVERLAP_SPAN 4

enum step_kind {
    STEP_WARM_UP,   /* lamp on, wait */
    STEP_HOLD,      /* a person turns or changes something; text says what */
    STEP_REFERENCE, /* reading of the diffuser */
    STEP_SAMPLE,    /* reading of a sample */
    STEP_TRAP,      /* stray light */
    STEP_OVERLAP,   /* the diffuser at two exposure times: is the light path linear? (session_linearity.h) */
    STEP_PARK       /* lamp off; the axes stay where they are */
};

struct step {
    enum step_kind kind;
    int sample; /* index into job.sample; -1 = none */
    int bracket, opens;
    bool mounts;   /* a STEP_HOLD that brings another surface into its place, not only turns an axis */
    bool control;  /* opens or closes a bracket */
    bool repeat;   /* a geometry measured again at the end, for reproducibility */
    int reference; /* step index of the reference reading a sample is divided by; -1 */
    int32_t theta_i_udeg, theta_v_udeg;
    bool mirrored;   /* both axes negated */
    bool reciprocal; /* the job asked for this geometry with source and sensor exchanged */
    /* Moves in this order: via[0..n_via) around a keep-out zone, then target. A manual sample axis stands in
     * target at the angle that an earlier STEP_HOLD, with the same target, had it turned to. */
    int n_via;
    struct stage_target via[PLAN_VIA], target;
    int64_t estimate_us; /* time of this step by the devices' own time models */
    char text[176];
};

struct refusal {
    int sample; /* index into job.sample; -1 = of every sample */
    double theta_i_deg, theta_v_deg;
    char why[256];
};

struct plan {
    int n_steps, n_refusals;
    struct step *step;
    struct refusal *refusal;
    int n_geometries; /* different geometries measured */
    int n_points;     /* sample readings */
    int n_brackets, n_holds;
    int n_exposures; /* frames kept */
    double bytes, free_bytes;
    int64_t estimate_us, estimate_low_us, estimate_high_us;
    int64_t start_utc_s;   /* 0 = not known */
    bool uses[STAGE_AXES]; /* devices the plan does not use are neither opened nor homed */
    int n_left_out;
    char left_out[8][160]; /* what is not used or not checked, in words */
    int n_mounted;
    char mounted[1 + JOB_SAMPLES][112]; /* what must stand where before the start, in words */
};

struct plan_devices {                          /* time and travel models, and the day */
    const struct profile *profile[STAGE_AXES]; /* NULL = not a motor */
    const struct spectrometer_model *spectrometer;
    int64_t utc_s;     /* now: the certificate may have expired; 0 = not checked */
    double free_bytes; /* on the disk of the sessions; 0 = not known */
};

/* All problems at once, each with its place in the job or config where there is one. A plan with no step left
 * for a sample is an error; its refusals are then among the errors. plan_free also after an error. */
int plan_make(const struct job *job, const struct config *config, const struct plan_devices *devices,
              struct plan *plan, struct err_list *errors);
void plan_free(struct plan *plan);
/* Stops on the way from where the stage stands, where the straight one touches a keep-out zone; -1 = no way. */
int plan_way(const struct config *config, const struct plan_devices *devices,
             const int32_t from_udeg[STAGE_AXES], const struct stage_target *to,
             struct stage_target via[PLAN_VIA]);
/* The shortest and the longest exposure of a job that the spectrometer can. */
void plan_exposure_limits_us(const struct job *job, const struct spectrometer_model *model, double us[2]);
const char *step_kind_name(enum step_kind kind);                            /* "reference" */
void plan_print(const struct plan *plan, const struct job *job, FILE *out); /* for people */
struct json_t *plan_to_json(const struct plan *plan, const struct job *job);

#endif
