#include <math.h>
#include <stdarg.h>
#include <string.h>

#include "proto/profile_inside.h"

struct check {
    struct profile *p;
    struct err_list *errors;
    int mistakes;
};

__attribute__((format(printf, 4, 5))) static void mistake(struct check *c, int line, int column,
                                                          const char *format, ...) {
    va_list ap;
    va_start(ap, format);
    err_list_mistake(c->errors, c->p->file, line, column, format, ap);
    va_end(ap);
    c->mistakes++;
}

static int find_reg(const struct profile *p, const char *name) {
    for (int i = 0; i < p->n_regs; i++)
        if (strcmp(p->reg[i].name, name) == 0)
            return i;
    return -1;
}

static int find_bit(const struct profile *p, const char *name) {
    for (int i = 0; i < p->n_bits; i++)
        if (strcmp(p->bit[i].name, name) == 0)
            return i;
    return -1;
}

static void known_names(struct profile *p) {
    p->reg_position = find_reg(p, "pos");
    p->reg_demand = find_reg(p, "dpos");
    p->reg_alarm = find_reg(p, "alarm");
    p->reg_limit_high = find_reg(p, "lim_hi");
    p->reg_limit_low = find_reg(p, "lim_lo");
    p->bit_moving = find_bit(p, "moving");
    p->bit_inpos = find_bit(p, "inpos");
    p->bit_alarm = find_bit(p, "alarm");
    p->bit_valid = find_bit(p, "valid");
}

static void resolve_bits(struct check *c) {
    for (int i = 0; i < c->p->n_bits; i++) {
        struct profile_bit *bit = &c->p->bit[i];
        bit->reg = find_reg(c->p, bit->reg_name);
        if (bit->reg < 0)
            mistake(c, 0, 0, "status.%s: there is no register '%s' under reg", bit->name, bit->reg_name);
    }
}

static void resolve_condition(struct check *c, struct profile_condition *k) {
    if (k->raw) {
        k->reg = find_reg(c->p, k->name);
        if (k->reg < 0)
            mistake(c, k->line, k->column, "there is no register '%s' under reg", k->name);
        return;
    }
    int bit = find_bit(c->p, k->name);
    if (bit < 0) {
        mistake(c, k->line, k->column, "there is no status bit '%s' under status", k->name);
        return;
    }
    k->reg = c->p->bit[bit].reg;
    k->mask = c->p->bit[bit].mask;
    k->is = c->p->bit[bit].is;
}

/* A word of 16 bit would silently lose the upper half: the axis would go somewhere else, or at another speed. */
static void check_word(struct check *c, const struct profile_step *step, const struct profile_word *word,
                       const char *seq) {
    if (step->wide || word->half != PROFILE_WHOLE || word->variable == PROFILE_CONSTANT)
        return;
    int32_t raw = word->variable == PROFILE_SPEED ? profile_raw_speed(c->p) : profile_raw_accel(c->p);
    if (word->variable == PROFILE_TARGET)
        mistake(c, step->line, step->column, "%s: $target is 32 bit wide; write $target.hi and $target.lo",
                seq);
    else if (raw > UINT16_MAX)
        mistake(c, step->line, step->column,
                "%s: the raw value %d of speed or acceleration does not fit into 16 bit; write .hi and .lo",
                seq, raw);
}

static void resolve_step(struct check *c, struct profile_step *step, const char *seq) {
    int words = step->n_words * (step->wide ? 2 : 1);
    if (words > c->p->link.max_write)
        mistake(c, step->line, step->column, "%s writes more registers than link.max_write", seq);
    for (int i = 0; i < step->n_words; i++)
        check_word(c, step, &step->word[i], seq);
    if (step->reg_name[0]) {
        step->reg = find_reg(c->p, step->reg_name);
        if (step->reg < 0)
            mistake(c, step->line, step->column, "%s: there is no register '%s' under reg", seq,
                    step->reg_name);
        else if (c->p->link.fc_write == 6 && profile_reg_words(&c->p->reg[step->reg]) == 2)
            mistake(c, step->line, step->column, "%s: link.fc_write 6 cannot write the 32-bit register '%s'",
                    seq, step->reg_name);
    }
    for (int i = 0; i < step->n_conditions; i++)
        resolve_condition(c, &step->condition[i]);
}

static void resolve_sequences(struct check *c) {
    for (int s = 0; s < PROFILE_SEQS; s++)
        for (int i = 0; i < c->p->seq[s].n; i++)
            resolve_step(c, &c->p->seq[s].step[i], profile_seq_name(s));
    static const int REQUIRED[] = {PROFILE_MOVE_ABS, PROFILE_STOP, PROFILE_ABORT};
    for (int i = 0; i < 3; i++)
        if (!c->p->seq[REQUIRED[i]].present)
            mistake(c, 0, 0, "seq.%s is missing: goniod cannot move and stop this drive without it",
                    profile_seq_name(REQUIRED[i]));
    for (int s = PROFILE_STOP; s <= PROFILE_ABORT; s++)
        if (c->p->seq[s].present && !c->p->seq[s].replay_safe)
            mistake(c, 0, 0, "seq.%s must be replay: safe, a stop is sent until it is seen to work",
                    profile_seq_name(s));
}

static bool raw_accel_fits(const struct profile *p) {
    bool time = p->scale.accel.kind == PROFILE_ACCEL_MS_PER_1000RPM;
    double raw =
        time ? 1e6 / (p->accel_deg_s2 * p->scale.speed.factor) : p->accel_deg_s2 * p->scale.accel.factor;
    return p->scale.accel.kind == PROFILE_ACCEL_NONE || (raw >= 0.5 && raw <= INT32_MAX);
}

static void check_figures(struct check *c) {
    const struct profile *p = c->p;
    if (p->reg_position < 0)
        mistake(c, 0, 0, "reg.pos, the position that is read back, is missing");
    if (p->bit_moving < 0 && p->bit_inpos < 0)
        mistake(c, 0, 0, "status has neither moving nor inpos: the end of a move could not be seen");
    if (p->scale.sign == 0)
        mistake(c, 0, 0, "scale.sign is +1 or -1");
    if (fabs(p->speed_deg_s * p->scale.speed.factor) > INT32_MAX || profile_raw_speed(p) == 0)
        mistake(c, 0, 0, "speed_deg_s times scale.speed.factor must round to 1 .. 2147483647");
    if (!raw_accel_fits(p))
        mistake(c, 0, 0, "accel_deg_s2 by scale.accel must round to 1 .. 2147483647");
    if (p->speed_deg_s > p->max_speed_deg_s)
        mistake(c, 0, 0, "speed_deg_s is above max_speed_deg_s");
    if (p->accel_deg_s2 > p->max_accel_deg_s2)
        mistake(c, 0, 0, "accel_deg_s2 is above max_accel_deg_s2");
    if (p->link.fc_write != 6 && p->link.fc_write != 16)
        mistake(c, 0, 0, "link.fc_write is 6 or 16");
    if (p->limits.low_deg > p->limits.high_deg)
        mistake(c, 0, 0, "limits.low_deg is above limits.high_deg");
    double far = fmax(fabs(p->limits.low_deg), fabs(p->limits.high_deg)) * p->scale.steps_per_deg;
    if (far > INT32_MAX)
        mistake(c, 0, 0, "limits times scale.steps_per_deg does not fit into 32 bits");
    if (p->poll.moving_ms > p->poll.idle_ms)
        mistake(c, 0, 0, "poll.moving_ms is longer than poll.idle_ms");
    if (fabs(p->backlash_deg) > 0 && fabs(p->backlash_deg) <= p->inpos_deg)
        mistake(c, 0, 0, "backlash_deg is not longer than inpos_deg");
}

int profile_check(struct profile *p, struct err_list *errors) {
    struct check c = {.p = p, .errors = errors};
    known_names(p);
    resolve_bits(&c);
    for (int i = 0; i < p->n_done; i++)
        resolve_condition(&c, &p->done[i]);
    for (int i = 0; i < p->n_accept; i++)
        resolve_condition(&c, &p->accept[i]);
    resolve_sequences(&c);
    check_figures(&c);
    return c.mistakes ? -ERR_INPUT : 0;
}
