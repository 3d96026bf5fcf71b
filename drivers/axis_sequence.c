#include <string.h>

#include "drivers/axis_inside.h"

#define STEP_WAITS 1 /* go on later */

void axis_sequence_start(struct axis *a, enum profile_seq_id id, bool urgent) {
    a->run = (struct axis_sequence){.seq = &a->profile->seq[id],
                                    .id = id,
                                    .since_us = axis_now_us(a),
                                    .due_us = axis_now_us(a),
                                    .target = axis_raw_from_user(a, a->leg_udeg),
                                    .urgent = urgent};
}

static int64_t word_value(const struct axis *a, const struct profile_word *w) {
    int64_t value = w->constant;
    if (w->variable == PROFILE_TARGET)
        value = a->run.target;
    else if (w->variable == PROFILE_SPEED)
        value = profile_raw_speed(a->profile);
    else if (w->variable == PROFILE_ACCEL || w->variable == PROFILE_DECEL)
        value = profile_raw_accel(a->profile);
    if (w->half == PROFILE_HI)
        return (uint32_t)value >> 16;
    return w->half == PROFILE_LO ? (uint32_t)value & 0xffff : value;
}

static int send(struct axis *a, struct modbus_request *rq, struct err *e) {
    rq->unit = a->config.unit;
    rq->urgent = a->run.urgent;
    a->polls_since_write = 0;
    int result = modbus_link_transact(a->link, rq, e);
    if (result && result != -ERR_DEVICE)
        axis_exchange_failed(a, result);
    else
        a->retry_us = INT64_MIN;
    return result;
}

static int write_words(struct axis *a, const struct profile_step *step, struct err *e) {
    struct modbus_request rq = {.function = step->function, .addr = step->addr};
    for (int i = 0; i < step->n_words; i++)
        rq.count += profile_encode(a->profile, step->wide, word_value(a, &step->word[i]), rq.regs + rq.count);
    return send(a, &rq, e);
}

/* A command word is written whole: the bits that goniod does not mean to change keep their value. */
static int write_mask(struct axis *a, const struct profile_step *step, bool on, struct err *e) {
    const struct profile_reg *reg = &a->profile->reg[step->reg];
    uint32_t *shadow = &a->shadow[step->reg];
    *shadow = on ? *shadow | step->mask : *shadow & ~step->mask;
    struct modbus_request rq = {.function = a->profile->link.fc_write, .addr = reg->addr};
    rq.count = profile_encode(a->profile, profile_reg_words(reg) == 2, *shadow, rq.regs);
    return send(a, &rq, e);
}

static int pulse(struct axis *a, const struct profile_step *step, struct err *e) {
    if (!a->run.started) {
        int result = write_mask(a, step, true, e);
        if (result)
            return result;
        a->run.started = true;
        a->run.due_us = axis_now_us(a) + step->ms * US_PER_MS;
        return STEP_WAITS;
    }
    return write_mask(a, step, false, e);
}

static int delay(struct axis *a, const struct profile_step *step) {
    if (a->run.started)
        return 0;
    a->run.started = true;
    a->run.due_us = axis_now_us(a) + step->ms * US_PER_MS;
    return STEP_WAITS;
}

/* A condition counts only on a reading taken after the last write. */
static int wait(struct axis *a, const struct profile_step *step, struct err *e) {
    bool fresh = a->polls_since_write > 0 && a->read_us >= a->run.since_us;
    if (fresh && axis_all(a, step->condition, step->n_conditions))
        return 0;
    int64_t now = axis_now_us(a), until = a->run.since_us + step->ms * US_PER_MS;
    if (fresh && now >= until) {
        const struct profile_condition *c = &step->condition[0];
        return step->soft
                   ? 0
                   : err_set(e, ERR_DEVICE,
                             "axis %s: during %s the drive did not reach %s%s within %d ms (profile %s)",
                             a->config.name, profile_seq_name(a->run.id), c->negate ? "no " : "", c->name,
                             step->ms, a->profile->id);
    }
    a->run.due_us = now < until ? until : CLOCK_NEVER; /* the next reading goes on with it */
    int64_t slow = a->profile->poll.moving_ms * US_PER_MS;
    int64_t soon = !a->run.started ? now : now + (now - a->run.since_us < 4 * slow ? slow / AXIS_FAST : slow);
    if (a->next_poll_us > soon)
        a->next_poll_us = soon;
    a->run.started = true;
    return STEP_WAITS;
}

static int expect(struct axis *a, const struct profile_step *step, struct err *e) {
    for (int i = 0; i < step->n_conditions; i++) {
        const struct profile_condition *c = &step->condition[i];
        int result = axis_read_register(a, c->reg, e);
        if (result)
            return result;
        if (!axis_holds(a, c))
            return err_set(e, ERR_DEVICE, "axis %s: %s expects another value of %s than 0x%llX (profile %s)",
                           a->config.name, profile_seq_name(a->run.id), c->name,
                           (unsigned long long)a->value[c->reg], a->profile->id);
    }
    return 0;
}

static int do_step(struct axis *a, const struct profile_step *step, struct err *e) {
    switch (step->verb) {
    case PROFILE_W:
        return write_words(a, step, e);
    case PROFILE_SET:
        return write_mask(a, step, true, e);
    case PROFILE_CLR:
        return write_mask(a, step, false, e);
    case PROFILE_PULSE:
        return pulse(a, step, e);
    case PROFILE_WAIT:
        return wait(a, step, e);
    case PROFILE_EXPECT:
        return expect(a, step, e);
    default:
        return delay(a, step);
    }
}

int axis_sequence_run(struct axis *a, struct err *e) {
    struct axis_sequence *run = &a->run;
    while (run->at < run->seq->n) {
        int result = do_step(a, &run->seq->step[run->at], e);
        if (result)
            return result;
        run->at++;
        run->started = false;
        run->since_us = run->due_us = axis_now_us(a);
    }
    return 0;
}
