#include "drivers/commission.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/axis_inside.h"

#define PLAUSIBLE_DEG 30.0 /* beyond its limits no axis stands so far off */
#define STOP_WAY 2         /* the move that is stopped is so many times longer */
#define TRIES 3            /* of a move where this machine was too busy to watch it, or to stop it in time */
/* Share of the travel time after which the stop is ordered: the way of accelerating for so long and slowing down at the
 * same rate is half of a move that only speeds up and slows down: 1 / (2 sqrt 2). At 1/2 it would be all of it. */
#define STOP_SHARE 0.35

__attribute__((format(printf, 2, 3))) static void say(struct commission *c, const char *format, ...) {
    size_t used = strlen(c->text);
    va_list ap;
    va_start(ap, format);
    vsnprintf(c->text + used, sizeof c->text - used, format, ap);
    va_end(ap);
}

__attribute__((format(printf, 3, 4))) static int ask(struct commission *c, enum commission_step step,
                                                     const char *format, ...) {
    va_list ap;
    va_start(ap, format);
    vsnprintf(c->question, sizeof c->question, format, ap);
    va_end(ap);
    c->step = step;
    c->asked = true;
    return 0;
}

static int end(struct commission *c, bool passed) {
    c->over = true;
    c->passed = passed;
    c->question[0] = 0;
    return 0;
}

static double deg(int32_t udeg) {
    return deg_from_udeg(udeg);
}

static bool idle(void *axis) {
    return !axis_busy(axis);
}

static int wait_order(struct commission *c, const struct cancel *cancel, struct err *e) {
    int result = bench_wait(c->bench, CLOCK_NEVER, idle, c->axis, cancel);
    if (result < 0) {
        axis_order_stop(c->axis);
        return err_set(e, -result, "commissioning was cancelled; the axis was stopped");
    }
    return axis_result(c->axis, e);
}

static int move_to(struct commission *c, int32_t udeg, const struct cancel *cancel, struct err *e) {
    int result = axis_begin_move(c->axis, udeg, e);
    return result ? result : wait_order(c, cancel, e);
}

/* --- status at rest ---------------------------------------------------------------------------------------- */

static int look_at_rest(struct commission *c, struct err *e) {
    struct axis *a = c->axis;
    const struct profile *p = a->profile;
    int result = axis_poll(a, e);
    if (result)
        return result;
    say(c, "Unit %d answers as %s (profile %s).", a->config.unit, p->n_models ? p->model[0] : p->vendor,
        p->id);
    for (int i = 0; i < p->n_bits; i++)
        say(c, " %s=%d", p->bit[i].name,
            ((uint32_t)a->value[p->bit[i].reg] & p->bit[i].mask) == p->bit[i].is);
    say(c, ".");
    if (a->alarm) {
        say(c, " Alarm %02Xh: %s. Clear it first.", (unsigned)a->alarm, profile_alarm_text(p, a->alarm));
        return end(c, false);
    }
    if (axis_moves(a)) {
        say(c, " By the profile's bits it moves. If it stands, status.moving or inpos is wrong.");
        return end(c, false);
    }
    return ask(c, COMMISSION_STATUS, "Does the axis stand still, and does its driver show no alarm?");
}

/* --- word order -------------------------------------------------------------------------------------------- */

static bool plausible(const struct axis *a, int64_t raw) {
    double at =
        (double)(raw * a->profile->scale.sign) / a->profile->scale.steps_per_deg * a->config.direction -
        deg(a->config.zero_udeg);
    return at > deg(a->config.low_udeg) - PLAUSIBLE_DEG && at < deg(a->config.high_udeg) + PLAUSIBLE_DEG;
}

static int64_t swapped(int64_t raw) {
    uint32_t u = (uint32_t)raw;
    return (int32_t)(u << 16 | u >> 16);
}

/* As a position near zero is: the same place in either order. */
static bool ambiguous(const struct axis *a, int64_t raw) {
    return plausible(a, raw) && plausible(a, swapped(raw));
}

/* 1 known, 0 the profile or the unit has no such registers */
static int drive_limits(struct commission *c, int64_t *low, int64_t *high, struct err *e) {
    struct axis *a = c->axis;
    const struct profile *p = a->profile;
    if (p->reg_limit_low < 0 || p->reg_limit_high < 0)
        return 0;
    int result = axis_read_register(a, p->reg_limit_low, e);
    if (result == 0)
        result = axis_read_register(a, p->reg_limit_high, e);
    if (result == -ERR_DEVICE) {
        err_clear(e);
        return 0;
    }
    *low = a->value[p->reg_limit_low];
    *high = a->value[p->reg_limit_high];
    return result ? result : 1;
}

static bool within_reach(const struct axis *a, int64_t low, int64_t high) {
    return plausible(a, low) && plausible(a, high) && low < high;
}

/* A limit of the drive that lies within reach in one order of its words only; 0 = none does. Both together, for a drive
 * that was told of no limits has them far away, where one alone can look like a near one with its words swapped. */
static int64_t telling_limit(struct commission *c) {
    const struct axis *a = c->axis;
    int64_t limit[2] = {0, 0};
    struct err ignored = {0};
    if (drive_limits(c, &limit[0], &limit[1], &ignored) != 1 ||
        within_reach(a, limit[0], limit[1]) == within_reach(a, swapped(limit[0]), swapped(limit[1])))
        return 0;
    int tells = plausible(a, limit[0]) != plausible(a, swapped(limit[0])) ? 0 : 1;
    say(c, " A soft limit of the drive: %lld steps.", (long long)limit[tells]);
    return limit[tells];
}

static int ask_to_turn(struct commission *c) {
    if (c->step == COMMISSION_WORDS)
        say(c, " It has not turned.");
    return ask(c, COMMISSION_WORDS,
               "At zero the order of the words cannot be told. Turn the axis by a degree or more with the "
               "drive's own means (its support software, or by hand without torque); done?");
}

static int ask_position(struct commission *c) {
    return ask(c, COMMISSION_POSITION,
               "It reads %.3f deg. Is that where it stands, by the scale of the stage?",
               deg(c->axis->position_udeg));
}

static int check_words(struct commission *c, struct err *e) {
    struct axis *a = c->axis;
    const struct profile *p = a->profile;
    int result = axis_poll(a, e);
    if (result)
        return result;
    int64_t raw = a->value[p->reg_position];
    bool wide = profile_reg_words(&p->reg[p->reg_position]) == 2;
    say(c, "Position register: %lld steps = %.3f deg.", (long long)raw, deg(a->position_udeg));
    if (wide && ambiguous(a, raw))
        raw = telling_limit(c);
    if (wide && ambiguous(a, raw))
        return ask_to_turn(c);
    if (plausible(a, raw))
        return ask_position(c);
    if (wide && plausible(a, swapped(raw)))
        say(c, " With the words swapped it would be %lld steps: set order.word the other way.",
            (long long)swapped(raw));
    else
        say(c, " That is far outside the limits %.1f .. %.1f: check steps_per_deg, zero_deg and limits_deg.",
            deg(a->config.low_udeg), deg(a->config.high_udeg));
    return end(c, false);
}

/* --- small moves ------------------------------------------------------------------------------------------- */

/* Towards the middle of the travel, and so short that the move to be stopped, which goes on from its end, stays
 * within the travel too. */
static int32_t small_way(const struct axis *a) {
    int64_t middle = ((int64_t)a->config.low_udeg + a->config.high_udeg) / 2;
    int32_t way = udeg_from_deg(COMMISSION_MOVE_DEG), most = (a->config.high_udeg - a->config.low_udeg) / 8;
    way = way < most ? way : most;
    return a->position_udeg <= middle ? way : -way;
}

static int ask_move(struct commission *c) {
    struct axis *a = c->axis;
    axis_declare_valid(a);
    c->position_confirmed = true;
    c->start_udeg = a->position_udeg;
    c->way_udeg = small_way(a);
    return ask(c, COMMISSION_MOVE, "It will turn by %+.3f deg to %.3f deg at %.3g deg/s. Is the way clear?",
               deg(c->way_udeg), deg(c->start_udeg + c->way_udeg), a->profile->speed_deg_s);
}

struct watched {
    struct axis *axis;
    int64_t from_us, until_us; /* it is on its way for certain */
    bool moved, looked;        /* looked: a reading fell into that time */
};

static bool over_and_watched(void *arg) {
    struct watched *w = arg;
    struct axis_status s;
    axis_status(w->axis, &s);
    w->moved |= axis_moves(w->axis);
    w->looked |= s.read_us > w->from_us && s.read_us < w->until_us;
    return !axis_busy(w->axis);
}

static int move_and_watch(struct commission *c, struct watched *w, const struct cancel *cancel,
                          struct err *e) {
    struct axis *a = c->axis;
    int64_t before = axis_now_us(a);
    int result = axis_begin_move(a, c->start_udeg + c->way_udeg, e);
    if (result)
        return result;
    *w = (struct watched){
        .axis = a, .from_us = axis_now_us(a), .until_us = before + axis_travel_us(a->profile, c->way_udeg)};
    result = bench_wait(c->bench, CLOCK_NEVER, over_and_watched, w, cancel);
    if (result < 0)
        return wait_order(c, cancel, e);
    result = axis_result(a, e);
    if (result == 0)
        say(c, "It reads %.3f deg after %.2f s.", deg(a->position_udeg),
            (double)(axis_now_us(a) - before) / US_PER_S);
    return result;
}

static int try_move(struct commission *c, const struct cancel *cancel, struct err *e) {
    struct watched w = {0};
    for (int k = 0; !w.moved && !w.looked; k++) {
        if (k == TRIES)
            return err_set(
                e, ERR_BUSY,
                "axis %s: no reading fell into one of %d moves, because this machine does other work; "
                "end that and answer again",
                c->axis->config.name, TRIES);
        bool away = llabs((int64_t)c->axis->position_udeg - c->start_udeg) > axis_deadband_udeg(c->axis);
        int result = away ? move_to(c, c->start_udeg, cancel, e) : 0;
        if (result == 0)
            result = move_and_watch(c, &w, cancel, e);
        if (result)
            return result;
    }
    if (!w.moved) {
        say(c, " Its moving bit was never seen: status.moving is wrong, or it did not turn.");
        return end(c, false);
    }
    return ask(c, COMMISSION_SCALE, "Did the table turn by %.3f deg (not by a multiple or a part of it)?",
               deg(abs(c->way_udeg)));
}

static int ask_stop(struct commission *c) {
    return ask(c, COMMISSION_STOP,
               "It will turn by %+.3f deg more and be stopped half way. Is the way clear?",
               deg(STOP_WAY * c->way_udeg));
}

/* Moves and stops. *late: the order was out so late that even an axis that obeys may have come to the end. */
static int move_and_stop(struct commission *c, int32_t to, bool *late, const struct cancel *cancel,
                         struct err *e) {
    struct axis *a = c->axis;
    int64_t travel_us = axis_travel_us(a->profile, (int64_t)to - a->position_udeg), begun_us = axis_now_us(a);
    int result = axis_begin_move(a, to, e);
    if (result)
        return result;
    int64_t stop_us = axis_now_us(a) + (int64_t)(STOP_SHARE * (double)travel_us);
    bench_wait(c->bench, stop_us, NULL, NULL, cancel);
    axis_order_stop(a);
    *late = axis_now_us(a) - begun_us > travel_us / 2;
    result = bench_wait(c->bench, axis_now_us(a) + 5 * US_PER_S, idle, a, NULL);
    if (result != BENCH_DONE || !axis_stands(a))
        return err_set(e, ERR_DEVICE, "axis %s: the stop order was not seen to work; cut the motor's supply",
                       a->config.name);
    if (cancel && cancel->raised)
        return err_set(e, ERR_CANCELLED, "commissioning was cancelled; the axis was stopped");
    return 0;
}

static int try_stop(struct commission *c, const struct cancel *cancel, struct err *e) {
    struct axis *a = c->axis;
    int32_t ends[] = {c->start_udeg + (1 + STOP_WAY) * c->way_udeg, a->position_udeg};
    for (int k = 0; k < TRIES; k++) { /* there and back over the way that was said to be clear */
        int32_t to = ends[k % 2];
        bool late;
        int result = move_and_stop(c, to, &late, cancel, e);
        if (result)
            return result;
        say(c, "Stopped at %.3f deg.", deg(a->position_udeg));
        if (llabs((int64_t)to - a->position_udeg) > axis_deadband_udeg(a))
            return 0;
        if (!late) {
            say(c, " It went all the way: seq.stop does not stop it.");
            return end(c, false);
        }
        say(c, " This machine was busy and the order late. ");
    }
    return err_set(
        e, ERR_BUSY,
        "axis %s: the stop order was late in each of %d moves, because this machine does other work; "
        "end that and answer again",
        a->config.name, TRIES);
}

/* --- limits of the drive itself ---------------------------------------------------------------------------- */

static int look_at_limits(struct commission *c, struct err *e) {
    struct axis *a = c->axis;
    int64_t low = 0, high = 0;
    int known = drive_limits(c, &low, &high, e);
    if (known < 0)
        return known;
    if (!known || (low == 0 && high == 0))
        return ask(
            c, COMMISSION_LIMITS,
            "The drive has no soft limits of its own. Do limit switches or hard stops guard the travel "
            "%.1f .. %.1f deg?",
            deg(a->config.low_udeg), deg(a->config.high_udeg));
    int32_t one = axis_user_from_raw(a, low), other = axis_user_from_raw(a, high);
    say(c, " Soft limits of the drive: %.2f and %.2f deg; goniod.yaml: %.2f .. %.2f deg.", deg(one),
        deg(other), deg(a->config.low_udeg), deg(a->config.high_udeg));
    int32_t drive_low = one < other ? one : other, drive_high = one < other ? other : one;
    if (drive_low > a->config.low_udeg || drive_high < a->config.high_udeg)
        say(c, " They are narrower than limits_deg: moves beyond them will end in an alarm.");
    return 1;
}

static int go_back(struct commission *c, const struct cancel *cancel, struct err *e) {
    int result = move_to(c, c->start_udeg, cancel, e);
    if (result)
        return result;
    say(c, " Back at %.3f deg. Passed: status bits, word order, scale, direction, stop, limits.",
        deg(c->axis->position_udeg));
    return end(c, true);
}

/* --- the conversation -------------------------------------------------------------------------------------- */

static const char *const ADVICE[COMMISSION_STEPS] = {
    [COMMISSION_STATUS] =
        "Then the status bits of the profile do not fit this unit, or the unit number is another's.",
    [COMMISSION_WORDS] =
        "The order of the words has to be known before anything may move: begin again when the axis "
        "does not stand at zero.",
    [COMMISSION_POSITION] = "Set zero_deg and direction in goniod.yaml, or home the axis, and begin again.",
    [COMMISSION_MOVE] = "Nothing was moved.",
    [COMMISSION_SCALE] =
        "Then scale.steps_per_deg is wrong (or the drive's electronic gear is not as the profile "
        "says).",
    [COMMISSION_DIRECTION] = "Set direction: -1 (or +1) for this axis in goniod.yaml and begin again.",
    [COMMISSION_STOP] = "Nothing more was moved.",
    [COMMISSION_LIMITS] = "Wire limit switches or set soft limits in the drive first.",
};

static int stop_and_limits(struct commission *c, const struct cancel *cancel, struct err *e) {
    int result = try_stop(c, cancel, e);
    if (result || c->over)
        return result;
    result = look_at_limits(c, e);
    return result == 1 ? go_back(c, cancel, e) : result;
}

static int agreed(struct commission *c, const struct cancel *cancel, struct err *e) {
    switch (c->step) {
    case COMMISSION_STATUS:
    case COMMISSION_WORDS:
        return check_words(c, e);
    case COMMISSION_POSITION:
        return ask_move(c);
    case COMMISSION_MOVE:
        return try_move(c, cancel, e);
    case COMMISSION_SCALE:
        return ask(c, COMMISSION_DIRECTION, "Did it turn the way in which its angles %s?",
                   c->way_udeg > 0 ? "grow" : "shrink");
    case COMMISSION_DIRECTION:
        return ask_stop(c);
    case COMMISSION_STOP:
        return stop_and_limits(c, cancel, e);
    default:
        return go_back(c, cancel, e);
    }
}

void commission_begin(struct commission *c, struct axis *axis, struct bench *bench) {
    *c = (struct commission){.axis = axis, .bench = bench};
}

int commission_answer(struct commission *c, const char *answer, const struct cancel *cancel, struct err *e) {
    c->text[0] = 0;
    if (c->over)
        return 0;
    if (c->axis->config.kind != AXIS_MOTOR)
        return err_set(e, ERR_STATE, "axis %s has no motor to commission", c->axis->config.name);
    if (axis_busy(c->axis))
        return err_set(e, ERR_BUSY, "axis %s is moving; wait until it stands", c->axis->config.name);
    if (!c->asked)
        return look_at_rest(c, e);
    bool yes = !strcasecmp(answer, "yes") || !strcasecmp(answer, "y");
    bool no = !strcasecmp(answer, "no") || !strcasecmp(answer, "n");
    if (!yes && !no) {
        say(c, "Please answer yes or no.");
        return 0;
    }
    if (yes)
        return agreed(c, cancel, e);
    say(c, "%s", ADVICE[c->step]);
    return end(c, false);
}
