#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/axis_inside.h"

#define LOST_FAILURES 3        /* stage-modbus.md 4.3 rule 6 */
#define LOST_US (2 * US_PER_S) /* a reading older than this while the bus is quarantined again and again */
#define MUTE_RETRY_US US_PER_S /* a unit that stays mute must not eat the bus of the others .. */
#define MUTE_RETRY_MAX_US (10 * US_PER_S)
/* .. nor a link spin that says "not now" without saying until when */
#define LINK_RETRY_US (10 * US_PER_MS)

/* Beyond the limits of every axis, and near enough that differences with a place inside them fit into 32 bits. */
#define FAR_UDEG 1500000000

int64_t axis_raw_from_user(const struct axis *a, int32_t udeg) {
    const struct profile *p = a->profile;
    int64_t raw_udeg = a->config.direction * ((int64_t)udeg + a->config.zero_udeg);
    return llround((double)raw_udeg * p->scale.steps_per_deg / UDEG_PER_DEG) * p->scale.sign;
}

/* A reading from far outside stays far outside: cut to 32 bits, a turn count or swapped words of just the wrong
 * size would look like a place within the limits. */
int32_t axis_user_from_raw(const struct axis *a, int64_t raw) {
    const struct profile *p = a->profile;
    int64_t raw_udeg = llround((double)(raw * p->scale.sign) * UDEG_PER_DEG / p->scale.steps_per_deg);
    int64_t udeg = a->config.direction * raw_udeg - a->config.zero_udeg;
    return udeg > FAR_UDEG ? FAR_UDEG : udeg < -FAR_UDEG ? -FAR_UDEG : (int32_t)udeg;
}

static int by_address(const void *a, const void *b) {
    return ((const struct axis_block *)a)->addr - ((const struct axis_block *)b)->addr;
}

static void want(bool wanted[PROFILE_REGS], const struct profile_condition *c, int n) {
    for (int i = 0; i < n; i++)
        wanted[c[i].reg] = true;
}

/* Every register that a status bit or a wait looks at, and the position. */
static void wanted_registers(const struct profile *p, bool wanted[PROFILE_REGS]) {
    for (int i = 0; i < p->n_bits; i++)
        wanted[p->bit[i].reg] = true;
    want(wanted, p->done, p->n_done);
    for (int s = 0; s < PROFILE_SEQS; s++)
        for (int i = 0; i < p->seq[s].n; i++)
            if (p->seq[s].step[i].verb == PROFILE_WAIT)
                want(wanted, p->seq[s].step[i].condition, p->seq[s].step[i].n_conditions);
    wanted[p->reg_position] = true;
}

/* One frame for each run of neighbouring registers (stage-modbus.md 4.3 rule 5). The alarm code comes along
 * where it costs no frame of its own. */
void axis_plan_blocks(struct axis *a) {
    const struct profile *p = a->profile;
    bool wanted[PROFILE_REGS] = {false};
    struct axis_block reg[PROFILE_REGS];
    int n = 0;
    wanted_registers(p, wanted);
    for (int i = 0; i < p->n_regs; i++)
        if (wanted[i] || i == p->reg_alarm)
            reg[n++] = (struct axis_block){p->reg[i].addr, profile_reg_words(&p->reg[i])};
    qsort(reg, n, sizeof *reg, by_address);
    a->n_blocks = 0;
    for (int i = 0; i < n; i++) {
        struct axis_block *last = a->n_blocks ? &a->block[a->n_blocks - 1] : NULL;
        bool alone = p->reg_alarm >= 0 && !wanted[p->reg_alarm] && reg[i].addr == p->reg[p->reg_alarm].addr;
        if (last && last->addr + last->count == reg[i].addr && last->count + reg[i].count <= p->link.max_read)
            last->count += reg[i].count;
        else if (!alone)
            a->block[a->n_blocks++] = reg[i];
    }
}

static int read_block(struct axis *a, const struct axis_block *b, struct modbus_request *rq, struct err *e) {
    *rq = (struct modbus_request){
        .unit = a->config.unit, .function = a->profile->link.fc_read, .addr = b->addr, .count = b->count};
    return modbus_link_transact(a->link, rq, e);
}

static void decode_block(struct axis *a, const struct axis_block *b, const uint16_t *words) {
    const struct profile *p = a->profile;
    for (int i = 0; i < p->n_regs; i++) {
        int at = p->reg[i].addr - b->addr;
        if (at >= 0 && at + profile_reg_words(&p->reg[i]) <= b->count)
            a->value[i] = profile_decode(p, p->reg[i].type, words + at);
    }
}

int axis_read_register(struct axis *a, int reg, struct err *e) {
    const struct profile_reg *r = &a->profile->reg[reg];
    struct axis_block block = {r->addr, profile_reg_words(r)};
    struct modbus_request rq;
    int result = read_block(a, &block, &rq, e);
    if (result == 0)
        decode_block(a, &block, rq.regs);
    return result;
}

bool axis_holds(const struct axis *a, const struct profile_condition *c) {
    int64_t value = a->value[c->reg];
    bool holds = c->demand ? value == a->run.target : ((uint32_t)value & c->mask) == c->is;
    return holds != c->negate;
}

bool axis_all(const struct axis *a, const struct profile_condition *c, int n) {
    for (int i = 0; i < n; i++)
        if (!axis_holds(a, &c[i]))
            return false;
    return true;
}

static bool bit(const struct axis *a, int index) {
    const struct profile_bit *b = &a->profile->bit[index];
    return ((uint32_t)a->value[b->reg] & b->mask) == b->is;
}

bool axis_moves(const struct axis *a) {
    return a->profile->bit_moving >= 0 ? bit(a, a->profile->bit_moving) : !bit(a, a->profile->bit_inpos);
}

static bool in_blocks(const struct axis *a, int reg) {
    int addr = a->profile->reg[reg].addr;
    for (int i = 0; i < a->n_blocks; i++)
        if (addr >= a->block[i].addr && addr < a->block[i].addr + a->block[i].count)
            return true;
    return false;
}

/* The code, where there is a register for it; a bare bit counts as code 1. */
static int read_alarm(struct axis *a, struct err *e) {
    const struct profile *p = a->profile;
    bool flagged = p->bit_alarm >= 0 && bit(a, p->bit_alarm);
    int result = 0;
    if (flagged && p->reg_alarm >= 0 && !in_blocks(a, p->reg_alarm))
        result = axis_read_register(a, p->reg_alarm, e);
    if (result)
        return result;
    bool code_known = p->reg_alarm >= 0 && (flagged || in_blocks(a, p->reg_alarm));
    int code = code_known ? (int)a->value[p->reg_alarm] : 0;
    a->alarm = flagged && code == 0 ? 1 : code;
    return 0;
}

/* Which of several proofs of acceptance has to be asked for apart from the status. */
static int read_proof(struct axis *a, struct err *e) {
    const struct profile *p = a->profile;
    if (a->task != TASK_MOVE || a->stage != STAGE_ACCEPT)
        return 0;
    for (int i = 0; i < p->n_accept; i++)
        if (!in_blocks(a, p->accept[i].reg)) {
            int result = axis_read_register(a, p->accept[i].reg, e);
            if (result)
                return result;
        } else if (axis_holds(a, &p->accept[i])) {
            return 0;
        }
    return 0;
}

static void judge_validity(struct axis *a) {
    const struct profile *p = a->profile;
    if (p->bit_valid >= 0)
        a->valid = bit(a, p->bit_valid);
    if (a->alarm && profile_alarm_revokes(p, a->alarm))
        a->valid = false;
}

int axis_poll(struct axis *a, struct err *e) {
    int result = 0;
    for (int i = 0; i < a->n_blocks && result == 0; i++) {
        struct modbus_request rq;
        result = read_block(a, &a->block[i], &rq, e);
        if (result == 0)
            decode_block(a, &a->block[i], rq.regs);
    }
    if (result == 0)
        result = read_alarm(a, e);
    if (result == 0)
        result = read_proof(a, e);
    if (result) {
        axis_exchange_failed(a, result);
        return result;
    }
    a->read_us = axis_now_us(a);
    a->polls_since_write++;
    a->position_udeg = axis_user_from_raw(a, a->value[a->profile->reg_position]);
    a->failures = 0;
    a->retry_us = INT64_MIN;
    a->lost = false;
    judge_validity(a);
    return 0;
}

void axis_exchange_failed(struct axis *a, int result) {
    struct modbus_link_state link;
    int64_t now = axis_now_us(a);
    modbus_link_state(a->link, &link);
    a->retry_us = link.ready_us > now ? link.ready_us : now + LINK_RETRY_US;
    if (result != -ERR_BUSY && result != -ERR_LINK)
        a->failures++;
    if (a->failures >= LOST_FAILURES) {
        int64_t pause = (a->failures - LOST_FAILURES + 1) * MUTE_RETRY_US;
        int64_t later = now + (pause < MUTE_RETRY_MAX_US ? pause : MUTE_RETRY_MAX_US);
        if (a->retry_us < later)
            a->retry_us = later;
    }
    bool stale = a->read_us != INT64_MIN && now - a->read_us > LOST_US;
    if (!a->lost && (!link.connected || a->failures >= LOST_FAILURES || stale)) {
        a->lost = true;
        a->enabled = false; /* a drive that lost its power has lost that too */
    }
}
