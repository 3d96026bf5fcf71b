/*
 * stage.h — the goniometer as a whole: source, sample and holder axes, moved together and apart from each other.
 *
 * source axis = theta_i + theta_v, sample axis = theta_v, from the sensor's optical axis (design 5). A stage
 * move starts every axis that has to move and waits for all; limits and keep-out zones are checked for the
 * targets and for the path the axes sweep before anything starts.
 * Checked    tests/unit/test_stage.c, tests/scenario/test_motion.c
 */
#ifndef DRIVERS_STAGE_H
#define DRIVERS_STAGE_H

#include "drivers/axis.h"

enum stage_axis { STAGE_SOURCE, STAGE_SAMPLE, STAGE_HOLDER, STAGE_AXES };

#define STAGE_ZONES 8

struct keep_out { /* forbidden while every stated axis is inside its interval */
    bool used[STAGE_AXES];
    int32_t low_udeg[STAGE_AXES], high_udeg[STAGE_AXES];
};

struct stage {
    struct bench *bench;
    struct axis *axis[STAGE_AXES]; /* NULL = absent */
    struct keep_out zone[STAGE_ZONES];
    int n_zones;
};

struct stage_target { /* axes with used == false stay where they are */
    bool used[STAGE_AXES];
    int32_t udeg[STAGE_AXES];
};

struct stage_reading {
    int32_t udeg[STAGE_AXES]; /* readbacks */
    int64_t settled_us;       /* the latest of the axes */
    int64_t read_us;          /* the oldest of the readbacks */
};

/* -ERR_RANGE with the reason in words where target or swept path touches a limit or a zone. `from` may be the
 * present readbacks or a plan's previous step. */
int stage_check_path(const struct stage *s, const int32_t from_udeg[STAGE_AXES],
                     const struct stage_target *to, struct err *e);
/* Moves and waits until all have settled. On failure or cancel the axes that still move are stopped. */
int stage_move(struct stage *s, const struct stage_target *to, const struct cancel *cancel,
               struct stage_reading *reading, struct err *e);
int stage_home(struct stage *s, enum stage_axis which, const struct cancel *cancel, struct err *e);
/* One attempt for each axis that shows an alarm, by the word of a person (stage-modbus.md 5.3, rule 13). */
int stage_reset_alarms(struct stage *s, const struct cancel *cancel, struct err *e);
void stage_read(const struct stage *s, struct stage_reading *reading);
/* Stop orders to every axis first, without waiting in between. */
void stage_order_stop(struct stage *s);
bool stage_standstill(void *stage); /* for bench_wait: every axis is seen to stand */

#endif
