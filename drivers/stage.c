#include "drivers/stage.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/profile.h"
#include "proto/units.h"

#define STANDSTILL_US (5 * US_PER_S) /* after a failure: the longest ramp and the stop's own time limit */

static const char *const NAMES[STAGE_AXES] = {"source", "sample", "holder"};

struct span {
    int32_t low, high;
};

static double deg(int32_t udeg) {
    return deg_from_udeg(udeg);
}

/* How far an axis may overshoot on its way to a target, so that it arrives from its usual side. */
static int32_t overshoot_udeg(const struct axis *a) {
    const struct axis_config *c = a ? axis_config(a) : NULL;
    return c && c->kind == AXIS_MOTOR ? abs(udeg_from_deg(c->profile->backlash_deg)) : 0;
}

static struct span swept(const struct stage *s, int i, int32_t from, const struct stage_target *to) {
    struct span span = {from, from};
    if (!to->used[i] || to->udeg[i] == from)
        return span;
    int32_t more = overshoot_udeg(s->axis[i]);
    span.low = (from < to->udeg[i] ? from : to->udeg[i]) - more;
    span.high = (from > to->udeg[i] ? from : to->udeg[i]) + more;
    const struct axis_config *c = s->axis[i] ? axis_config(s->axis[i]) : NULL;
    if (c && c->kind == AXIS_MOTOR) { /* the overshoot itself keeps to the limits */
        span.low = span.low < c->low_udeg && from >= c->low_udeg ? c->low_udeg : span.low;
        span.high = span.high > c->high_udeg && from <= c->high_udeg ? c->high_udeg : span.high;
    }
    return span;
}

static int check_limits(const struct stage *s, const struct stage_target *to, struct err *e) {
    for (int i = 0; i < STAGE_AXES; i++) {
        const struct axis_config *c = s->axis[i] ? axis_config(s->axis[i]) : NULL;
        if (!c || !to->used[i])
            continue;
        bool fixed = c->kind == AXIS_FIXED;
        int32_t low = fixed ? c->fixed_udeg : c->low_udeg, high = fixed ? c->fixed_udeg : c->high_udeg;
        if (to->udeg[i] < low || to->udeg[i] > high)
            return err_set(e, ERR_RANGE, "axis %s: %.3f deg is outside its limits %.3f .. %.3f", c->name,
                           deg(to->udeg[i]), deg(low), deg(high));
    }
    return 0;
}

static void describe(const struct keep_out *z, const struct span span[STAGE_AXES], char *text, size_t size) {
    size_t used = 0;
    text[0] = 0;
    for (int i = 0; i < STAGE_AXES; i++)
        if (z->used[i] && used < size)
            used += snprintf(text + used, size - used, "%s%s sweeps %.2f .. %.2f (zone %.2f .. %.2f)",
                             used ? ", " : "", NAMES[i], deg(span[i].low), deg(span[i].high),
                             deg(z->low_udeg[i]), deg(z->high_udeg[i]));
}

/* The rectangle the axes sweep and not the line they are meant to take: a lost reply delays one of them, and
 * then any point of it can be passed. */
static int check_zone(const struct stage *s, const struct keep_out *z, const int32_t from_udeg[STAGE_AXES],
                      const struct stage_target *to, struct err *e) {
    struct span span[STAGE_AXES];
    bool inside = true, moves = false;
    for (int i = 0; i < STAGE_AXES; i++) {
        span[i] = swept(s, i, from_udeg[i], to);
        moves |= to->used[i] && to->udeg[i] != from_udeg[i];
        if (z->used[i])
            inside &= span[i].low <= z->high_udeg[i] && span[i].high >= z->low_udeg[i];
    }
    if (!inside || !moves)
        return 0;
    char text[300];
    describe(z, span, text, sizeof text);
    return err_set(e, ERR_RANGE, "the way touches a keep-out zone: %s; move one axis at a time around it",
                   text);
}

int stage_check_path(const struct stage *s, const int32_t from_udeg[STAGE_AXES],
                     const struct stage_target *to, struct err *e) {
    int result = check_limits(s, to, e);
    for (int z = 0; z < s->n_zones && result == 0; z++)
        result = check_zone(s, &s->zone[z], from_udeg, to, e);
    return result;
}

void stage_read(const struct stage *s, struct stage_reading *r) {
    *r = (struct stage_reading){.settled_us = INT64_MIN, .read_us = clock_now_us(s->bench->clock)};
    for (int i = 0; i < STAGE_AXES; i++) {
        struct axis_status status;
        if (!s->axis[i])
            continue;
        axis_status(s->axis[i], &status);
        r->udeg[i] = status.position_udeg;
        r->settled_us = status.settled_us > r->settled_us ? status.settled_us : r->settled_us;
        r->read_us = status.read_us < r->read_us ? status.read_us : r->read_us;
    }
}

struct moving { /* the axes a stage_move waits for */
    struct stage *stage;
    bool axis[STAGE_AXES];
};

static bool all_over_or_one_failed(void *arg) {
    const struct moving *m = arg;
    bool busy = false;
    for (int i = 0; i < STAGE_AXES; i++) {
        if (!m->axis[i])
            continue;
        if (axis_result(m->stage->axis[i], NULL) < 0)
            return true;
        busy |= axis_busy(m->stage->axis[i]);
    }
    return !busy;
}

/* The first cause: an axis that failed by itself, not one that was stopped because of it. */
static int first_failure(const struct moving *m, struct err *e) {
    for (int i = 0; i < STAGE_AXES; i++)
        if (m->axis[i] && axis_result(m->stage->axis[i], NULL) < 0)
            return axis_result(m->stage->axis[i], e);
    return 0;
}

static bool moved_stand(void *arg) {
    const struct moving *m = arg;
    for (int i = 0; i < STAGE_AXES; i++)
        if (m->axis[i] && !axis_stands(m->stage->axis[i]))
            return false;
    return true;
}

static void stop_the_rest(const struct moving *m) {
    for (int i = 0; i < STAGE_AXES; i++)
        if (m->axis[i] && axis_busy(m->stage->axis[i]) && axis_result(m->stage->axis[i], NULL) == 0)
            axis_order_stop(m->stage->axis[i]);
}

/* Ends what failed or was cancelled: after a cancel its caller waits for standstill, with its own deadline. */
static int end_early(struct moving *m, int result, const struct cancel *cancel) {
    struct bench *bench = m->stage->bench;
    stop_the_rest(m);
    if (result != -ERR_CANCELLED)
        bench_wait(bench, clock_now_us(bench->clock) + STANDSTILL_US, moved_stand, m, cancel);
    return result;
}

static int wait_for(struct moving *m, const struct cancel *cancel, struct err *e) {
    int waited = bench_wait(m->stage->bench, CLOCK_NEVER, all_over_or_one_failed, m, cancel);
    int result = first_failure(m, e);
    if (result == 0 && waited == -ERR_CANCELLED)
        result = err_set(e, ERR_CANCELLED, "the move was cancelled");
    else if (result == 0 && waited < 0)
        result = err_set(e, -waited, "nothing is left that could end the move");
    return result ? end_early(m, result, cancel) : 0;
}

int stage_move(struct stage *s, const struct stage_target *to, const struct cancel *cancel,
               struct stage_reading *reading, struct err *e) {
    struct moving moving = {.stage = s};
    stage_read(s, reading);
    int result = stage_check_path(s, reading->udeg, to, e);
    for (int i = 0; i < STAGE_AXES && result == 0; i++) {
        if (!to->used[i])
            continue;
        if (!s->axis[i])
            result = err_set(e, ERR_STATE, "this bench has no %s axis to move", NAMES[i]);
        else
            result = axis_begin_move(s->axis[i], to->udeg[i], e);
        moving.axis[i] = result == 0;
    }
    result = result ? end_early(&moving, result, cancel) : wait_for(&moving, cancel, e);
    stage_read(s, reading);
    return result;
}

int stage_home(struct stage *s, enum stage_axis which, const struct cancel *cancel, struct err *e) {
    struct moving moving = {.stage = s};
    if (!s->axis[which])
        return err_set(e, ERR_STATE, "this bench has no %s axis to home", NAMES[which]);
    int result = axis_begin_home(s->axis[which], e);
    if (result)
        return result;
    moving.axis[which] = true;
    return wait_for(&moving, cancel, e);
}

int stage_reset_alarms(struct stage *s, const struct cancel *cancel, struct err *e) {
    struct moving resetting = {.stage = s};
    for (int i = 0; i < STAGE_AXES; i++) {
        struct axis_status status;
        if (!s->axis[i])
            continue;
        axis_status(s->axis[i], &status);
        if (!status.alarm)
            continue;
        int result = axis_reset_alarm(s->axis[i], e);
        if (result)
            return result;
        resetting.axis[i] = true;
    }
    return wait_for(&resetting, cancel, e);
}

/* A mute unit holds up whoever is asked after it for a response time: those that answer come first. */
void stage_order_stop(struct stage *s) {
    bool ordered[STAGE_AXES] = {false};
    for (int mute_too = 0; mute_too < 2; mute_too++)
        for (int i = 0; i < STAGE_AXES; i++) {
            struct axis_status status;
            if (!s->axis[i] || ordered[i])
                continue;
            axis_status(s->axis[i], &status);
            if (!status.answers && !mute_too)
                continue;
            axis_order_stop(s->axis[i]);
            ordered[i] = true;
        }
}

bool stage_standstill(void *stage) {
    const struct stage *s = stage;
    for (int i = 0; i < STAGE_AXES; i++)
        if (s->axis[i] && !axis_stands(s->axis[i]))
            return false;
    return true;
}
