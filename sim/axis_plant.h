/*
 * axis_plant.h — a motor, its gear and the table on it, analytic in time: where everything stood at any moment.
 *
 * A motion is a chain of monotone segments, each a trapezoid of speed; a new order replaces what has not yet
 * happened. The last 64 segments are kept, so that a frame can ask where the axis was while it integrated.
 * Motor position in steps (0.01 deg, stage-modbus.md 1.8). The encoder sits on the motor: readback knows
 * nothing of what the gear does. The table follows inside the lost motion: [motor, motor + lost]; approached
 * upwards it stands at the motor's angle. Each order adds a repeatability drawn by (key, target, visit to that
 * target).
 *
 * Times      microseconds of the clock; an order moves nothing for PLANT_START_US (MOVE rises >= 2 ms after the
 *            query, stage-modbus.md 1.7).
 * Units      steps, deg of the table, steps/s, steps/s^2.
 * Checked    tests/unit/test_sim_axis.c
 */
#ifndef SIM_AXIS_PLANT_H
#define SIM_AXIS_PLANT_H

#include <stdbool.h>
#include <stdint.h>

#define PLANT_SEGMENTS 64
#define PLANT_STEPS_PER_DEG 100
#define PLANT_START_US 2000
#define PLANT_VISITS 4096

struct plant_segment {
    int64_t start_us;
    double x0, x1;                    /* steps */
    double v0, vp;                    /* speed at the start and of the plateau, along direction */
    double accel, decel;              /* of the ramps; accel is signed: negative slows from v0 to vp */
    double t_ramp, t_plateau, t_fall; /* s */
    int direction;                    /* +1, -1; 0 = standing */
    double table0_deg;                /* table at the start, without repeatability */
    double repeat_deg;
};

struct plant_visit {
    int32_t target_steps;
    int count;
};

struct plant {
    uint64_t key; /* of the repeatability */
    double u_repeat_deg, lost_motion_deg;
    struct plant_segment segment[PLANT_SEGMENTS];
    int n;                /* segments ever appended; the newest is segment[(n - 1) % PLANT_SEGMENTS] */
    int32_t target_steps; /* the commanded position */
    struct plant_visit visit[PLANT_VISITS];
    int n_visits;
};

struct plant_order {
    int32_t target_steps;
    double speed, accel, decel; /* > 0 */
};

void plant_init(struct plant *p, uint64_t key, double u_repeat_deg, double lost_motion_deg, int32_t at_steps);
void plant_move(struct plant *p, int64_t start_us, const struct plant_order *order);
void plant_stop(struct plant *p, int64_t now_us, double decel);
/* Stops dead at a position it passes (a limit); returns when, or INT64_MAX if the motion does not reach it.
 */
int64_t plant_halt_at(struct plant *p, int64_t from_us, double limit_steps);
void plant_add_visits(struct plant *p, int32_t target_steps, int visits);

double plant_motor_steps(const struct plant *p, int64_t at_us);
double plant_speed(const struct plant *p, int64_t at_us); /* steps/s, signed */
double plant_table_deg(const struct plant *p, int64_t at_us);
int64_t plant_end_us(const struct plant *p); /* when the newest motion ends, or ended */
bool plant_moving(const struct plant *p, int64_t at_us);
bool plant_steady(const struct plant *p, int64_t from_us, int64_t to_us); /* stood still all that time */

#endif
