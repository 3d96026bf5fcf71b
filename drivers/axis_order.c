#include <stdlib.h>

#include "drivers/axis_inside.h"

/* MOVE rises and falls 2 ms late, stage-modbus.md 1.7, and the query */
#define START_LAG_US (5 * US_PER_MS)
#define LIMIT_MARGIN_US (2 * US_PER_S) /* a move may take half as long again, and this */
#define STALL_US US_PER_S              /* stage-modbus.md 5.3 rule 10 */
#define STALL_POLLS 5
#define STOP_AGAIN_US (3 * US_PER_S)

static double deg(int32_t udeg) {
    return deg_from_udeg(udeg);
}

void axis_start(struct axis *a, enum axis_task task) {
    a->task = task;
    a->stage = STAGE_VERIFY;
    a->phase = task == TASK_HOME ? AXIS_HOMING : task == TASK_MOVE ? AXIS_MOVING : a->phase;
    a->result = 0;
    err_clear(&a->error);
    a->sends = a->retries = a->done_polls = a->missed_polls = 0;
    a->other_side = false;
    a->settled_us = CLOCK_NEVER;
    a->next_poll_us = axis_now_us(a);
}

void axis_finish(struct axis *a, int result) {
    a->task = TASK_NONE;
    a->run.seq = NULL;
    a->result = result;
    a->phase = result ? AXIS_FAULT : AXIS_IDLE;
    if (result)
        a->approached = 0;
}

/* --- stop ---------------------------------------------------------------------------------------------- */

void axis_send_stop(struct axis *a) {
    a->stop_pending = false;
    a->leg_limit_us = axis_now_us(a) + STOP_AGAIN_US;
    axis_sequence_start(a, PROFILE_STOP, true);
    axis_go_on(a);
}

static void begin_stop(struct axis *a, bool now) {
    a->task = TASK_STOP;
    a->phase = AXIS_STOPPING;
    a->stop_confirmed = false;
    a->settled_us = CLOCK_NEVER;
    a->stop_pending = true;
    if (now)
        axis_send_stop(a);
}

void axis_stop_now(struct axis *a) {
    if (a->task != TASK_NONE && a->task != TASK_STOP) {
        err_set(&a->error, ERR_CANCELLED, "axis %s was stopped by an order", a->config.name);
        axis_finish(a, -ERR_CANCELLED);
    }
    begin_stop(a, true);
}

/* An order that ends badly; leaves no axis turning behind it. */
static void fail(struct axis *a, const struct err *why, bool may_move) {
    a->error = *why;
    axis_finish(a, -why->code);
    if (may_move)
        begin_stop(a, true);
}

/* A stop is over when a reading taken after it shows that the axis stands. */
static void think_stop(struct axis *a) {
    if (a->stop_pending || a->run.seq || a->polls_since_write == 0)
        return;
    if (axis_moves(a)) {
        a->stop_pending = axis_now_us(a) >= a->leg_limit_us;
        return;
    }
    a->stop_confirmed = true;
    a->target_udeg = a->leg_udeg = a->position_udeg; /* nothing resumes by itself */
    a->task = TASK_NONE;
    a->phase = a->result == 0 || a->result == -ERR_CANCELLED ? AXIS_IDLE : AXIS_FAULT;
}

void axis_lost(struct axis *a) {
    struct err e = {0};
    if (a->task == TASK_STOP) {
        a->run.seq = NULL;
        a->stop_pending = true;
    }
    a->settled_us = CLOCK_NEVER; /* whatever it reads afterwards has to be verified anew */
    if (a->task == TASK_NONE || a->task == TASK_STOP)
        return;
    bool may_move = a->task != TASK_RESET && a->stage >= STAGE_SEND;
    err_set(
        &e, ERR_LINK,
        "axis %s (unit %d on %s) no longer answers, last seen%s at %.3f deg: check its power and its cable%s",
        a->config.name, a->config.unit, a->link->name, may_move ? " during a move" : "",
        deg(a->position_udeg), may_move ? "; it is ordered to stop as soon as it answers" : "");
    fail(a, &e, false);
    if (may_move)
        begin_stop(a, false); /* at the first reconnect */
}

/* --- alarms and checks --------------------------------------------------------------------------------- */

static bool alarmed(struct axis *a) {
    struct err e = {0};
    if (a->alarm == 0)
        return false;
    bool person = profile_alarm_needs_person(a->profile, a->alarm);
    err_set(&e, ERR_DEVICE, "axis %s: alarm %02Xh at %.3f deg: %s; %s", a->config.name, (unsigned)a->alarm,
            deg(a->position_udeg), profile_alarm_text(a->profile, a->alarm),
            person ? "look at the bench first; the next order to it, or `gonioctl continue`, resets it"
                   : "when its cause is gone, the next order to it, or `gonioctl continue`, resets it");
    fail(a, &e, axis_moves(a));
    return true;
}

/* stage-modbus.md 5.3 rule 5 */
static int check_start(struct axis *a, struct err *e) {
    const struct axis_config *c = &a->config;
    int32_t slack = axis_deadband_udeg(a) + abs(udeg_from_deg(a->profile->backlash_deg));
    if (axis_moves(a))
        return err_set(e, ERR_BUSY, "axis %s turns although goniod has not ordered it; who else commands it?",
                       c->name);
    if (a->task != TASK_MOVE)
        return 0;
    if (!a->valid)
        return err_set(e, ERR_STATE, "axis %s: its position is not known; home it first (gonioctl home %s)",
                       c->name, c->name);
    if (a->position_udeg < c->low_udeg - slack || a->position_udeg > c->high_udeg + slack)
        return err_set(
            e, ERR_STATE,
            "axis %s stands at %.3f deg, outside its limits %.3f .. %.3f; check its zero, then home it",
            c->name, deg(a->position_udeg), deg(c->low_udeg), deg(c->high_udeg));
    return 0;
}

/* --- legs: every position is reached from the same side ------------------------------------------------- */

static bool within(const struct axis *a, int32_t udeg) {
    return udeg >= a->config.low_udeg && udeg <= a->config.high_udeg;
}

static void choose_leg(struct axis *a) {
    int32_t b = udeg_from_deg(a->profile->backlash_deg), way = a->target_udeg - a->position_udeg;
    a->final_leg = true;
    a->leg_udeg = a->target_udeg;
    if (b == 0)
        return;
    if (!within(a, a->target_udeg - b)) { /* no room on the usual side */
        b = -b;
        a->other_side = true;
    }
    int side = b > 0 ? 1 : -1;
    bool taken_up = way * (int64_t)side >= abs(b) || (way * (int64_t)side >= 0 && a->approached == side);
    if ((taken_up && a->retries == 0) || !within(a, a->target_udeg - b))
        return;
    a->final_leg = false;
    a->leg_udeg = a->target_udeg - b;
}

static int approach_side(const struct axis *a) {
    double b = a->profile->backlash_deg;
    int usual = b > 0 ? 1 : b < 0 ? -1 : 0;
    return a->other_side ? -usual : usual;
}

/* --- sending ------------------------------------------------------------------------------------------- */

static enum profile_seq_id order_sequence(const struct axis *a) {
    return a->task == TASK_MOVE   ? PROFILE_MOVE_ABS
           : a->task == TASK_HOME ? PROFILE_HOME
                                  : PROFILE_ALARM_RESET;
}

static void send_order(struct axis *a) {
    bool enable = !a->enabled && a->profile->seq[PROFILE_ENABLE].present;
    a->stage = enable ? STAGE_ENABLE : STAGE_SEND;
    a->sends += !enable;
    axis_sequence_start(a, enable ? PROFILE_ENABLE : order_sequence(a), false);
    axis_go_on(a);
}

static void sooner_poll(struct axis *a, int64_t us) {
    if (us < a->next_poll_us)
        a->next_poll_us = us;
}

/* The move is on the wire, or may be: a lost reply is settled by what the next readings show. */
static void ordered(struct axis *a) {
    int64_t now = axis_now_us(a);
    int64_t travel = axis_travel_us(a->profile, (int64_t)a->leg_udeg - a->position_udeg);
    a->stage = STAGE_ACCEPT;
    a->order_us = now;
    a->leg_end_us = now + travel + START_LAG_US;
    a->leg_limit_us = a->leg_end_us + travel / 2 + LIMIT_MARGIN_US;
    a->accept_until_us = CLOCK_NEVER;
    a->done_polls = a->missed_polls = a->still_polls = 0;
    a->still_udeg = a->position_udeg;
    a->still_since_us = now;
    sooner_poll(a, axis_next_poll_us(a));
}

static void homed(struct axis *a) {
    a->valid = a->profile->bit_valid >= 0 ? a->valid : true;
    a->target_udeg = a->leg_udeg = a->position_udeg;
    a->approached = 0;
    a->settled_us = a->read_us;
    a->still_udeg = a->position_udeg;
    axis_finish(a, 0);
}

static void sequence_over(struct axis *a, int result, struct err *e) {
    a->run.seq = NULL;
    bool unknown = result == -ERR_TIMEOUT || result == -ERR_IO || result == -ERR_LINK;
    if (a->task == TASK_STOP) {
        a->stop_pending = result != 0;
        if (result == -ERR_DEVICE && a->retry_us < axis_now_us(a) + US_PER_S)
            a->retry_us = axis_now_us(a) + US_PER_S; /* it answers, and still turns: once more, not at once */
        sooner_poll(a, axis_now_us(a));
    } else if (a->stage == STAGE_ENABLE && result == 0) {
        a->enabled = true;
        send_order(a);
    } else if (a->task == TASK_MOVE && a->stage == STAGE_SEND && (result == 0 || unknown)) {
        ordered(a);
    } else if (result) {
        fail(a, e, a->stage == STAGE_SEND && a->task == TASK_HOME);
    } else if (a->task == TASK_HOME) {
        homed(a);
    } else {
        a->phase = a->phase == AXIS_FAULT ? AXIS_IDLE : a->phase;
        axis_finish(a, 0);
        sooner_poll(a, axis_now_us(a));
    }
}

void axis_go_on(struct axis *a) {
    struct err e = {0};
    int result = axis_sequence_run(a, &e);
    if (result == -ERR_BUSY && a->task != TASK_STOP)
        a->run.due_us = a->retry_us; /* nothing was sent */
    else if (result <= 0)
        sequence_over(a, result, &e);
}

/* --- on the way ---------------------------------------------------------------------------------------- */

static void give_up(struct axis *a, const char *what) {
    struct err e = {0};
    err_set(&e, ERR_DEVICE, "axis %s %s: target %.3f deg, it reads %.3f deg; stopped", a->config.name, what,
            deg(a->leg_udeg), deg(a->position_udeg));
    fail(a, &e, true);
}

static void retry(struct axis *a, const char *what) {
    if (a->retries >= a->profile->retry_max || !a->profile->seq[PROFILE_MOVE_ABS].replay_safe) {
        give_up(a, what);
        return;
    }
    a->retries++;
    choose_leg(a);
    send_order(a);
}

static bool accepted(const struct axis *a) {
    for (int i = 0; i < a->profile->n_accept; i++)
        if (axis_holds(a, &a->profile->accept[i]))
            return true;
    return false;
}

static bool near_leg(const struct axis *a) {
    int32_t off = abs(a->position_udeg - a->leg_udeg);
    return off <= axis_deadband_udeg(a) ||
           (!a->final_leg && off <= abs(udeg_from_deg(a->profile->backlash_deg)) / 2);
}

/* A readback that does not change although the move is not over. */
static bool stalled(struct axis *a) {
    if (a->position_udeg != a->still_udeg) {
        a->still_udeg = a->position_udeg;
        a->still_since_us = a->read_us;
        a->still_polls = 0;
        return false;
    }
    return ++a->still_polls >= STALL_POLLS && a->read_us - a->still_since_us >= STALL_US;
}

static void arrived(struct axis *a) {
    a->phase = AXIS_SETTLING;
    a->stage = STAGE_SETTLE;
    if (a->done_polls++ == 0)
        a->first_done_us = a->read_us;
    if (a->done_polls < a->profile->debounce_polls ||
        a->read_us < a->first_done_us + a->profile->settle_ms * US_PER_MS)
        return;
    int side = approach_side(a);
    a->settled_us = a->read_us;
    a->still_udeg = a->position_udeg;
    axis_finish(a, 0);
    a->approached = side;
}

static void think_travel(struct axis *a) {
    bool stands = a->final_leg ? axis_all(a, a->profile->done, a->profile->n_done) : !axis_moves(a);
    if (stands && near_leg(a)) {
        if (a->final_leg) {
            arrived(a);
        } else {
            a->final_leg = true;
            a->leg_udeg = a->target_udeg;
            send_order(a);
        }
        return;
    }
    a->phase = AXIS_MOVING;
    a->stage = STAGE_TRAVEL;
    a->done_polls = 0;
    bool missed = stands && a->read_us >= a->leg_end_us;
    a->missed_polls = missed ? a->missed_polls + 1 : 0;
    if (a->missed_polls >= a->profile->debounce_polls)
        retry(a, "stands, but not where it should");
    else if (stalled(a))
        give_up(a, "does not move any further");
    else if (a->read_us > a->leg_limit_us)
        give_up(a, "takes too long");
}

static void think_accept(struct axis *a) {
    if (accepted(a)) {
        a->stage = STAGE_TRAVEL;
        think_travel(a);
        return;
    }
    if (a->accept_until_us == CLOCK_NEVER) {
        int64_t from = a->order_us > a->read_us ? a->order_us : a->read_us;
        a->accept_until_us = from + a->profile->accept_ms * US_PER_MS;
    }
    if (a->read_us < a->accept_until_us)
        return;
    if (a->sends <= a->profile->retry_max && a->profile->seq[PROFILE_MOVE_ABS].replay_safe)
        send_order(a);
    else
        give_up(a, "does not take its order");
}

static void think_verify(struct axis *a) {
    struct err e = {0};
    if (a->task != TASK_RESET && (alarmed(a) || check_start(a, &e))) {
        if (e.code)
            fail(a, &e, false);
        return;
    }
    if (a->task == TASK_MOVE)
        choose_leg(a);
    send_order(a);
}

/* An axis nobody moves is settled wherever it stands, once it has been seen to stand there long enough. */
static void rest(struct axis *a) {
    bool stands = !a->alarm && axis_all(a, a->profile->done, a->profile->n_done);
    if (!stands || abs(a->position_udeg - a->still_udeg) > axis_deadband_udeg(a)) {
        a->still_udeg = a->position_udeg;
        a->still_since_us = a->read_us;
        a->still_polls = 0;
        a->settled_us = CLOCK_NEVER;
        a->approached = 0; /* pushed by hand, or commanded by another */
    }
    a->still_polls += stands;
    if (a->settled_us == CLOCK_NEVER && a->still_polls >= a->profile->debounce_polls &&
        a->read_us >= a->still_since_us + a->profile->settle_ms * US_PER_MS)
        a->settled_us = a->read_us;
}

static void think_idle(struct axis *a) {
    if (a->alarm)
        a->phase = AXIS_FAULT;
    rest(a);
}

void axis_think(struct axis *a) {
    if (a->run.seq) {
        if (a->task != TASK_STOP && a->task != TASK_RESET && a->alarm)
            alarmed(a);
        else
            axis_go_on(a);
    } else if (a->task == TASK_NONE) {
        think_idle(a);
    } else if (a->task == TASK_STOP) {
        think_stop(a);
    } else if (a->stage == STAGE_VERIFY) {
        think_verify(a);
    } else if (!alarmed(a)) {
        if (a->stage == STAGE_ACCEPT)
            think_accept(a);
        else
            think_travel(a);
    }
}

int64_t axis_next_poll_us(const struct axis *a) {
    const struct profile *p = a->profile;
    int64_t now = axis_now_us(a), moving = p->poll.moving_ms * US_PER_MS, fast = moving / AXIS_FAST;
    int64_t interval = a->task == TASK_NONE ? p->poll.idle_ms * US_PER_MS : moving;
    int64_t watchdog = p->watchdog.drive_ms * US_PER_MS / 4;
    if (watchdog && interval > watchdog)
        interval = watchdog;
    int64_t next = now + interval;
    if (a->task == TASK_MOVE && a->stage == STAGE_ACCEPT && a->polls_since_write < p->poll.fast_polls)
        next = now + fast;
    bool under_way = a->task == TASK_MOVE && (a->stage == STAGE_ACCEPT || a->stage == STAGE_TRAVEL);
    if (under_way && now < a->leg_end_us && a->leg_end_us < next)
        next = a->leg_end_us; /* the earliest moment at which it can have arrived */
    else if (under_way && now >= a->leg_end_us && now < a->leg_end_us + 2 * moving)
        next = now + fast;
    int64_t settled = a->first_done_us + p->settle_ms * US_PER_MS;
    if (a->task == TASK_MOVE && a->stage == STAGE_SETTLE && now < settled && settled < next)
        next = settled;
    return next;
}
