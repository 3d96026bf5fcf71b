/*
 * axis_inside.h — the state of one axis, shared by the files of the axis driver and by commission.c.
 *
 * axis.c         the public face: open, orders, status, manual and fixed axes, the service of the bench
 * axis_poll.c    reads status and position, decides connected or lost, evaluates the profile's conditions
 * axis_sequence.c  interprets a profile's sequence without ever blocking: a wait is a state
 * axis_order.c   what an order goes through: verify, enable, send, accepted?, travel, settle; stop; faults
 * axis_time.c    how long a move takes
 *
 * Each run of the service does one thing: a stop order still to be sent, else a step of the running sequence,
 * else a poll; after it axis_think decides what follows.
 * Checked    tests/unit/test_axis.c, tests/scenario/test_motion.c
 */
#ifndef DRIVERS_AXIS_INSIDE_H
#define DRIVERS_AXIS_INSIDE_H

#include "drivers/axis.h"
#include "proto/profile.h"
#include "proto/units.h"

#define AXIS_FAST 5 /* polls per moving_ms while something is about to happen */

enum axis_task { TASK_NONE, TASK_MOVE, TASK_HOME, TASK_RESET, TASK_STOP };

enum axis_stage {
    STAGE_VERIFY, /* a fresh reading before anything is ordered */
    STAGE_ENABLE, /* the profile's enable sequence, once after every connect */
    STAGE_SEND,   /* the order's own sequence */
    STAGE_ACCEPT, /* the drive has not shown yet that it took the order */
    STAGE_TRAVEL, /* until it stands where it should */
    STAGE_SETTLE  /* it does, and mechanics calm down */
};

struct axis_block { /* registers read in one frame */
    int addr, count;
};

struct axis_sequence {
    const struct profile_seq *seq; /* NULL = none is running */
    enum profile_seq_id id;
    int at;
    bool started;     /* the present step has done its first part */
    int64_t since_us; /* the present step began */
    int64_t due_us;   /* when it goes on */
    int64_t target;   /* $target, raw */
    bool urgent;
};

struct axis {
    struct axis_config config;
    const struct profile *profile;
    struct modbus_link *link;
    struct bench *bench;

    /* what was read */
    int n_blocks;
    struct axis_block block[PROFILE_REGS];
    int64_t value[PROFILE_REGS];
    uint32_t shadow[PROFILE_REGS]; /* command words as goniod wants them */
    int64_t read_us;               /* stamp; INT64_MIN = never */
    int polls_since_write;
    int32_t position_udeg;
    int alarm;
    bool valid;

    /* the link */
    int failures;
    bool lost;        /* no reading for too long, or the link is down: the position is stale */
    int64_t retry_us; /* nothing is sent before, except a stop */
    int64_t next_poll_us;
    bool enabled;

    /* the order */
    enum axis_phase phase;
    enum axis_task task;
    enum axis_stage stage;
    struct axis_sequence run;
    int result;
    struct err error;
    int32_t target_udeg, leg_udeg; /* where it shall end; where the present leg ends */
    bool final_leg;
    int approached; /* sign of the last approach, 0 = unknown */
    bool other_side;
    int sends, retries, done_polls, missed_polls;
    int64_t accept_until_us; /* CLOCK_NEVER until a reading after the order */
    int64_t order_us, leg_end_us, leg_limit_us, first_done_us, settled_us;
    int32_t still_udeg;     /* stall: the position that has not changed .. */
    int64_t still_since_us; /* .. since */
    int still_polls;
    bool stop_pending, stop_confirmed;
};

/* axis_poll.c */
void axis_plan_blocks(struct axis *a);
int axis_poll(struct axis *a, struct err *e);
int axis_read_register(struct axis *a, int reg, struct err *e);
bool axis_holds(const struct axis *a, const struct profile_condition *c);
bool axis_all(const struct axis *a, const struct profile_condition *c, int n);
bool axis_moves(const struct axis *a); /* by the last reading */
/* Counts a failed exchange, decides whether the axis is lost, and when to try again. */
void axis_exchange_failed(struct axis *a, int result);
int64_t axis_raw_from_user(const struct axis *a, int32_t udeg);
int32_t axis_user_from_raw(const struct axis *a, int64_t raw);

/* axis_sequence.c: > 0 waits, 0 done, negative failed (-ERR_BUSY, -ERR_LINK: nothing was sent) */
void axis_sequence_start(struct axis *a, enum profile_seq_id id, bool urgent);
int axis_sequence_run(struct axis *a, struct err *e);

/* axis_order.c */
void axis_start(struct axis *a, enum axis_task task);
void axis_think(struct axis *a); /* after a reading */
void axis_go_on(struct axis *a); /* with the running sequence */
void axis_lost(struct axis *a);  /* it has just become lost */
void axis_finish(struct axis *a, int result);
void axis_stop_now(struct axis *a);
void axis_send_stop(struct axis *a);
int64_t axis_next_poll_us(const struct axis *a);

/* axis_time.c */
int64_t axis_travel_us(const struct profile *p, int64_t distance_udeg); /* of the trapezoid alone */

static inline int64_t axis_now_us(const struct axis *a) {
    return clock_now_us(a->bench->clock);
}

static inline int32_t axis_deadband_udeg(const struct axis *a) {
    return udeg_from_deg(a->profile->inpos_deg);
}

#endif
