/*
 * plan.h — an ordered array of steps: what `gonioctl check` prints is what runs.
 *
 * The plan holds psi_source and orders the rest to save travel, groups manual holds, puts a reference reading
 * at both ends of every bracket and a dark within its interval, refuses geometries with a reason each, and
 * says what it will cost: time with an interval, exposures, bytes on disk. Refused    outside soft limits;
 * blind zone; footprint larger than sample or diffuser; between the two filling cases; not covered by the
 * certificate; keep-out zone; no reachable pair of axes. Checked    tests/unit/test_plan.c, tests/scenario/
 */
#ifndef DAEMON_PLAN_H
#define DAEMON_PLAN_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "daemon/config.h"
#include "daemon/job.h"
#include "drivers/stage.h"
#include "drivers/spectrometer.h"

struct profile;
struct json_t;

enum step_kind {
    STEP_WARM_UP,   /* lamp on, wait */
    STEP_HOLD,      /* a person turns or changes something; text says what */
    STEP_REFERENCE, /* reading of the diffuser */
    STEP_SAMPLE,    /* reading of a sample */
    STEP_TRAP,      /* stray light */
    STEP_PARK
};

struct step {
    enum step_kind kind;
    int sample; /* index into job.sample; -1 = none */
    int bracket;
    bool control;  /* opens or closes the bracket */
    bool repeat;   /* a geometry measured again at the end, for reproducibility */
    int reference; /* step index of the reference reading a sample is divided by; -1 */
    int32_t theta_i_udeg, theta_v_udeg;
    bool mirrored;
    struct stage_target target;
    int64_t estimate_us; /* time of this step by the devices' own time models */
    char text[96];
};

struct refusal {
    double theta_i_deg, theta_v_deg;
    char why[120];
};

struct plan {
    int n_steps, n_refusals;
    struct step *step;
    struct refusal *refusal;
    int n_points;    /* sample readings */
    int n_exposures; /* frames kept */
    double bytes;
    int64_t estimate_us, estimate_low_us, estimate_high_us;
    bool uses[STAGE_AXES]; /* devices the plan does not use are neither opened nor homed */
    int n_left_out;
    char left_out[8][96];
};

struct plan_devices {                          /* time and travel models */
    const struct profile *profile[STAGE_AXES]; /* NULL = not a motor */
    const struct spectrometer_model *spectrometer;
};

/* All problems at once, each with its place in the job or config where there is one. A plan with no step left
 * for a sample is an error. */
int plan_make(const struct job *job, const struct config *config, const struct plan_devices *devices,
              struct plan *plan, struct err_list *errors);
void plan_free(struct plan *plan);
void plan_print(const struct plan *plan, const struct job *job, FILE *out); /* for people */
struct json_t *plan_to_json(const struct plan *plan, const struct job *job);

#endif
