/*
 * axis.h — one axis of the goniometer: a motor behind a register-map profile, or a person, or a fixed mount.
 *
 * The terms are those of the EPICS motor record: setpoint, readback, done moving, soft limits, backlash
 * distance, retry deadband. User position = direction * raw position / steps_per_deg - zero. Integer
 * microdegrees.
 *
 * A move is a state machine that bench_wait drives through the axis' poll service: validity -> limits ->
 * order -> proof of acceptance (moving seen, or demand position equals the target) -> arrival (not moving, in
 * position, readback inside the deadband, for two polls) -> settle time. A move that arrives from the wrong
 * side takes the backlash approach first. Its time limit follows its length. The axis is polled at the
 * profile's times, and never slower than a quarter of the drive's watchdog, whatever else goniod does.
 *
 * Rules      no absolute move unless the position is valid (design 4.2, stage-modbus.md 5.3); a command that
 * timed out is never replayed blindly: status is read first. A manual axis completes when the person confirms
 *            (axis_confirm); a fixed axis accepts its own angle only.
 * Checked    tests/unit/test_axis.c, tests/unit/test_axis_readings.c, tests/scenario/test_motion.c, tests/wire/
 */
#ifndef DRIVERS_AXIS_H
#define DRIVERS_AXIS_H

#include <stdbool.h>
#include <stdint.h>

#include "drivers/bench.h"
#include "drivers/modbus_link.h"
#include "proto/err.h"
struct profile;

enum axis_kind { AXIS_ABSENT, AXIS_MOTOR, AXIS_MANUAL, AXIS_FIXED };

struct axis_config {
    char name[16]; /* source, sample, holder */
    enum axis_kind kind;
    const struct profile *profile; /* AXIS_MOTOR; outlives the axis */
    int unit;
    int32_t zero_udeg;           /* direction * raw position of user zero */
    int direction;               /* +1 or -1 */
    int32_t low_udeg, high_udeg; /* soft limits, user coordinates */
    int32_t fixed_udeg;          /* AXIS_FIXED */
    bool position_valid; /* what commissioning or home recorded for this unit (profiles without a validity
                            bit) */
};

enum axis_phase {
    AXIS_IDLE,
    AXIS_MOVING,
    AXIS_SETTLING,
    AXIS_HOMING,
    AXIS_STOPPING,
    AXIS_WAITING_PERSON,
    AXIS_FAULT
};

struct axis_status { /* a snapshot; read_us says how old */
    enum axis_phase phase;
    int32_t position_udeg; /* readback */
    int32_t target_udeg;   /* setpoint */
    int64_t read_us;       /* stamp of the readback; INT64_MIN = never */
    int64_t settled_us;    /* when the present position was declared settled; CLOCK_NEVER while not */
    int64_t move_start_us; /* when the last order was sent */
    bool valid;            /* position may be trusted for an absolute move */
    bool connected;        /* false: the readback is stale */
    bool answers;          /* its last exchange was answered */
    bool stop_confirmed;   /* false after a stop order that has not been seen to take effect */
    bool other_side;       /* reached from the other side: no room for the usual approach within the limits */
    int retries;           /* of the last move, because it stood outside the deadband */
    int alarm;             /* code, 0 = none */
    char alarm_text[80];
};

struct axis;

int axis_open(struct axis **axis, const struct axis_config *config, struct modbus_link *link,
              struct bench *bench, struct err *e);
void axis_close(struct axis *axis); /* leaves torque on */
const struct axis_config *axis_config(const struct axis *axis);
void axis_status(const struct axis *axis, struct axis_status *status);

/* Orders and returns. axis_busy tells when it is over (a stop: when standstill has been seen), axis_result
 * how it ended. A new order while busy: -ERR_BUSY; while the link is down: -ERR_LINK. The link lost during a
 * move ends it with -ERR_LINK and sends one stop at the reconnect; nothing resumes by itself. */
int axis_begin_move(struct axis *axis, int32_t target_udeg, struct err *e);
int axis_begin_home(struct axis *axis, struct err *e);
bool axis_busy(const struct axis *axis);
int axis_result(const struct axis *axis, struct err *e); /* 0 arrived and settled */
/* STOP with ramp, now, without waiting; also in quarantine or while disconnected (then at the first
 * reconnect). Ends the running order with -ERR_CANCELLED; status.stop_confirmed tells when standstill has
 * been seen. */
void axis_order_stop(struct axis *axis);
bool axis_stands(const struct axis *axis); /* no order runs and the last reading shows standstill */
void axis_confirm(struct axis *axis,
                  int32_t position_udeg); /* manual axis: the person says it stands there */
/* A person, or a record of one, says that the readback is right (profiles without a validity bit). */
void axis_declare_valid(struct axis *axis);
int axis_reset_alarm(struct axis *axis, struct err *e); /* at most one attempt per order of a person */

/* Time model for the plan: trapezoid (and the backlash leg of a move against the approach) + settle + one
 * poll. distance: target - start, signed. */
int64_t axis_move_time_us(const struct profile *profile, int32_t distance_udeg);

#endif
