#include "drivers/axis.h"

#include <math.h>
#include <stdlib.h>

#include "drivers/axis_inside.h"

static bool is_motor(const struct axis *a) {
    return a->config.kind == AXIS_MOTOR;
}

static int64_t due_us(void *self) {
    const struct axis *a = self;
    int64_t due = a->next_poll_us;
    if (a->run.seq && a->run.due_us < due)
        due = a->run.due_us;
    if (a->stop_pending)
        due = a->retry_us;
    return due > a->retry_us ? due : a->retry_us;
}

static void poll_and_think(struct axis *a) {
    struct err e = {0};
    if (axis_poll(a, &e)) {
        a->next_poll_us = a->retry_us;
        return;
    }
    a->next_poll_us = CLOCK_NEVER;
    axis_think(a);
    int64_t next = axis_next_poll_us(a);
    if (next < a->next_poll_us)
        a->next_poll_us = next;
}

static void run(void *self) {
    struct axis *a = self;
    int64_t now = axis_now_us(a);
    bool was_lost = a->lost;
    if (now < a->retry_us)
        return;
    if (a->stop_pending)
        axis_send_stop(a);
    else if (a->run.seq && a->run.due_us <= now)
        axis_go_on(a);
    else if (a->next_poll_us <= now)
        poll_and_think(a);
    if (a->lost && !was_lost)
        axis_lost(a);
}

static int check_config(const struct axis_config *c, struct err *e) {
    if (c->kind != AXIS_MOTOR)
        return 0;
    if (c->low_udeg > c->high_udeg)
        return err_set(e, ERR_INPUT, "axis %s: its lower limit is above its upper one", c->name);
    const struct profile *p = c->profile;
    double far = fmax(fabs((double)c->low_udeg + c->zero_udeg), fabs((double)c->high_udeg + c->zero_udeg));
    if (far / UDEG_PER_DEG * p->scale.steps_per_deg > INT32_MAX)
        return err_set(e, ERR_INPUT, "axis %s: its limits do not fit into the drive's 32-bit positions",
                       c->name);
    return 0;
}

/* The first reading tells whether a unit is there and speaks this profile. */
static int first_reading(struct axis *a, struct err *e) {
    struct err first = {0};
    int result = axis_poll(a, &first);
    if (result == -ERR_BUSY) { /* another unit of the bus was mute just now */
        bench_wait(a->bench, a->retry_us, NULL, NULL, NULL);
        err_clear(&first);
        result = axis_poll(a, &first);
    }
    if (result == 0)
        return 0;
    const char *hint = result == -ERR_DEVICE ? "is this the right profile for it?"
                                             : "check its power, wiring, unit number, baud and parity";
    return err_set(e, -result, "axis %s: %s; %s", a->config.name, first.text, hint);
}

static int open_motor(struct axis *a, struct err *e) {
    axis_plan_blocks(a);
    a->valid = a->config.position_valid;
    int result = first_reading(a, e);
    if (result)
        return result;
    a->target_udeg = a->leg_udeg = a->still_udeg = a->position_udeg;
    a->still_since_us = a->read_us;
    a->phase = a->alarm ? AXIS_FAULT : AXIS_IDLE;
    a->next_poll_us = axis_next_poll_us(a);
    struct bench_service service = {.name = a->config.name, .self = a, .due_us = due_us, .run = run};
    if (bench_add(a->bench, &service))
        return err_set(e, ERR_RANGE, "axis %s: the bench serves no more than %d devices", a->config.name,
                       BENCH_SERVICES);
    return 0;
}

int axis_open(struct axis **axis, const struct axis_config *config, struct modbus_link *link,
              struct bench *bench, struct err *e) {
    *axis = NULL;
    int result = check_config(config, e);
    if (result)
        return result;
    struct axis *a = calloc(1, sizeof *a);
    if (!a)
        return err_set(e, ERR_NOMEM, "no memory for the axis %s", config->name);
    a->config = *config;
    a->profile = config->profile;
    a->link = link;
    a->bench = bench;
    a->read_us = a->retry_us = INT64_MIN;
    a->settled_us = a->next_poll_us = CLOCK_NEVER;
    a->stop_confirmed = true;
    if (config->kind == AXIS_FIXED) {
        a->position_udeg = a->target_udeg = config->fixed_udeg;
        a->valid = true;
        a->read_us = a->settled_us = clock_now_us(bench->clock);
    }
    if (is_motor(a))
        result = open_motor(a, e);
    if (result) {
        free(a);
        return result;
    }
    *axis = a;
    return 0;
}

void axis_close(struct axis *a) {
    if (!a)
        return;
    if (is_motor(a)) {
        bool stands = a->task == TASK_NONE && !a->lost && !axis_moves(a);
        if (!stands) { /* nobody will watch it any more */
            struct err e = {0};
            axis_sequence_start(a, PROFILE_ABORT, true);
            axis_sequence_run(a, &e);
        }
        bench_remove(a->bench, a);
    }
    free(a);
}

const struct axis_config *axis_config(const struct axis *a) {
    return &a->config;
}

void axis_status(const struct axis *a, struct axis_status *s) {
    *s = (struct axis_status){
        .phase = a->phase,
        .position_udeg = a->position_udeg,
        .target_udeg = a->target_udeg,
        .read_us = is_motor(a) ? a->read_us : clock_now_us(a->bench->clock),
        .settled_us = a->settled_us,
        .move_start_us = a->order_us,
        .valid = a->valid && !a->lost,
        .connected = !a->lost,
        .answers = !a->lost && a->failures == 0,
        .stop_confirmed = a->stop_confirmed,
        .other_side = a->other_side,
        .retries = a->retries,
        .alarm = a->alarm,
    };
    if (a->config.kind == AXIS_MANUAL && !a->valid)
        s->read_us = INT64_MIN;
    if (a->alarm)
        snprintf(s->alarm_text, sizeof s->alarm_text, "%s", profile_alarm_text(a->profile, a->alarm));
}

static void done_at_once(struct axis *a) {
    a->result = 0;
    err_clear(&a->error);
}

/* It stands there already, reached from the right side, by a reading no older than the idle interval. */
static bool stands_there(const struct axis *a, int32_t target_udeg) {
    bool fresh = axis_now_us(a) - a->read_us <= a->profile->poll.idle_ms * US_PER_MS;
    bool reached = a->approached != 0 || a->profile->backlash_deg == 0;
    return fresh && reached && a->task == TASK_NONE && a->settled_us != CLOCK_NEVER && !a->alarm &&
           target_udeg == a->target_udeg && abs(a->position_udeg - target_udeg) <= axis_deadband_udeg(a);
}

static int begin_motor(struct axis *a, enum axis_task task, struct err *e) {
    if (a->task != TASK_NONE)
        return err_set(e, ERR_BUSY, "axis %s has not finished its last order", a->config.name);
    if (a->lost)
        return err_set(e, ERR_LINK, "axis %s (unit %d on %s) does not answer: check its power and its cable",
                       a->config.name, a->config.unit, a->link->name);
    axis_start(a, task);
    return 0;
}

static int begin_manual(struct axis *a, int32_t target_udeg) {
    done_at_once(a);
    a->target_udeg = target_udeg;
    if (a->valid && abs(a->position_udeg - target_udeg) == 0)
        return 0;
    a->phase = AXIS_WAITING_PERSON;
    a->settled_us = CLOCK_NEVER;
    a->order_us = axis_now_us(a);
    return 0;
}

int axis_begin_move(struct axis *a, int32_t target_udeg, struct err *e) {
    const struct axis_config *c = &a->config;
    if (c->kind == AXIS_FIXED) {
        if (target_udeg != c->fixed_udeg)
            return err_set(e, ERR_RANGE, "axis %s is fixed at %.3f deg; it cannot go to %.3f deg", c->name,
                           deg_from_udeg(c->fixed_udeg), deg_from_udeg(target_udeg));
        done_at_once(a);
        return 0;
    }
    if (target_udeg < c->low_udeg || target_udeg > c->high_udeg)
        return err_set(e, ERR_RANGE, "axis %s: %.3f deg is outside its soft limits %.3f .. %.3f", c->name,
                       deg_from_udeg(target_udeg), deg_from_udeg(c->low_udeg), deg_from_udeg(c->high_udeg));
    if (c->kind == AXIS_MANUAL)
        return begin_manual(a, target_udeg);
    if (stands_there(a, target_udeg)) {
        done_at_once(a);
        return 0;
    }
    int result = begin_motor(a, TASK_MOVE, e);
    if (result == 0)
        a->target_udeg = target_udeg;
    return result;
}

int axis_begin_home(struct axis *a, struct err *e) {
    if (!is_motor(a))
        return err_set(e, ERR_STATE, "axis %s has no motor to home", a->config.name);
    if (!a->profile->seq[PROFILE_HOME].present)
        return err_set(e, ERR_STATE, "axis %s: the profile %s knows no home sequence", a->config.name,
                       a->profile->id);
    return begin_motor(a, TASK_HOME, e);
}

bool axis_busy(const struct axis *a) {
    return a->task != TASK_NONE || a->phase == AXIS_WAITING_PERSON;
}

int axis_result(const struct axis *a, struct err *e) {
    if (a->result)
        err_set(e, -a->result, "%s", a->error.text);
    return a->result;
}

void axis_order_stop(struct axis *a) {
    if (!is_motor(a)) {
        if (a->phase == AXIS_WAITING_PERSON) {
            a->phase = AXIS_IDLE;
            a->result = err_set(&a->error, ERR_CANCELLED, "axis %s was stopped by an order", a->config.name);
        }
        return;
    }
    bool was_lost = a->lost;
    axis_stop_now(a);
    if (a->lost && !was_lost)
        axis_lost(a);
}

bool axis_stands(const struct axis *a) {
    return !is_motor(a) || (a->task == TASK_NONE && a->stop_confirmed && !a->lost && !axis_moves(a));
}

void axis_confirm(struct axis *a, int32_t position_udeg) {
    if (a->config.kind != AXIS_MANUAL)
        return;
    a->position_udeg = a->target_udeg = position_udeg;
    a->valid = true;
    a->phase = AXIS_IDLE;
    a->settled_us = a->read_us = axis_now_us(a);
}

void axis_declare_valid(struct axis *a) {
    if (is_motor(a) && a->profile->bit_valid < 0)
        a->valid = true;
}

int axis_reset_alarm(struct axis *a, struct err *e) {
    if (!is_motor(a) || !a->profile->seq[PROFILE_ALARM_RESET].present)
        return err_set(e, ERR_STATE, "axis %s has no alarm that goniod could reset", a->config.name);
    return begin_motor(a, TASK_RESET, e);
}
