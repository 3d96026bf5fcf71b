#include <string.h>

#include "proto/profile_inside.h"
#include "proto/yaml_table.h"

#define AT(member) struct profile, member
#define MASKED(member) struct profile_masked, member
#define READBACK(member) struct readback_form, member
#define FORM(member) struct step_form, member
#define SEQ(member) struct seq_form, member

static const char *const SEQ_NAMES[PROFILE_SEQS + 1] = {
    [PROFILE_ENABLE] = "enable",     [PROFILE_DISABLE] = "disable",         [PROFILE_HOME] = "home",
    [PROFILE_SET_ZERO] = "set_zero", [PROFILE_MOVE_ABS] = "move_abs",       [PROFILE_STOP] = "stop",
    [PROFILE_ABORT] = "abort",       [PROFILE_ALARM_RESET] = "alarm_reset", [PROFILE_SEQS] = NULL,
};
static const char *const REPLAYS[] = {"unsafe", "safe", NULL};

const char *profile_seq_name(enum profile_seq_id id) {
    return SEQ_NAMES[id];
}

static void place(const struct yaml_node *node, int *line, int *column) {
    *line = yaml_node_line(node);
    *column = yaml_node_column(node);
}

static const struct yaml_key MASKED_KEYS[] = {
    YAML_TEXT("reg", MASKED(reg), .required = true),
    YAML_INTEGER("mask", MASKED(mask), 1, 0x7fffffff, .required = true),
    YAML_INTEGER("is", MASKED(is), 0, 0x7fffffff, YAML_SETS(MASKED(has_is)),
                 .doc = "value under the mask; default: the mask"),
    {0}};

int profile_parse_masked(struct yaml_reader *r, const struct yaml_node *node, struct profile_masked *masked) {
    *masked = (struct profile_masked){0};
    if (yaml_read_map(r, node, MASKED_KEYS, masked))
        return -ERR_INPUT;
    if (!masked->has_is)
        masked->is = masked->mask;
    return 0;
}

static int read_raw(struct yaml_reader *r, const struct yaml_node *node, struct profile_condition *c) {
    struct profile_masked masked;
    if (profile_parse_masked(r, node, &masked))
        return -ERR_INPUT;
    strcpy(c->name, masked.reg);
    c->raw = true;
    c->mask = (uint32_t)masked.mask;
    c->is = (uint32_t)masked.is;
    return 0;
}

static int read_name(struct yaml_reader *r, const struct yaml_node *node, const char *text,
                     struct profile_condition *c) {
    if (text && *text == '!') {
        c->negate = true;
        text++;
    }
    if (!text || !*text || strlen(text) >= PROFILE_NAME) {
        yaml_error(r, node, "expected the name of a status bit of at most %d letters", PROFILE_NAME - 1);
        return -ERR_INPUT;
    }
    strcpy(c->name, text);
    return 0;
}

/* {readback: dpos, equals: $target} or {readback: trig, mask: 0x0100} */
struct readback_form {
    char readback[PROFILE_NAME], equals[PROFILE_NAME];
    int mask;
};

static const struct yaml_key READBACK_KEYS[] = {YAML_TEXT("readback", READBACK(readback), .required = true),
                                                YAML_TEXT("equals", READBACK(equals)),
                                                YAML_INTEGER("mask", READBACK(mask), 1, 0x7fffffff),
                                                {0}};

static int read_readback(struct yaml_reader *r, const struct yaml_node *node, struct profile_condition *c) {
    struct readback_form form = {0};
    if (yaml_read_map(r, node, READBACK_KEYS, &form))
        return -ERR_INPUT;
    c->demand = strcmp(form.equals, "$target") == 0;
    if (c->demand == (form.mask != 0)) {
        yaml_error(r, node, "expected either equals: $target or mask with a readback");
        return -ERR_INPUT;
    }
    strcpy(c->name, form.readback);
    c->raw = true;
    c->mask = c->is = (uint32_t)form.mask;
    return 0;
}

static int read_condition(struct yaml_reader *r, const struct yaml_node *node, struct profile_condition *c) {
    place(node, &c->line, &c->column);
    if (!yaml_is_map(node))
        return read_name(r, node, yaml_text(node), c);
    return yaml_find(node, "readback") ? read_readback(r, node, c) : read_raw(r, node, c);
}

static int read_conditions(struct yaml_reader *r, const struct yaml_node *node, struct profile_condition *c,
                           int *n) {
    if (!node || !yaml_is_list(node) || yaml_count(node) == 0 || yaml_count(node) > PROFILE_CONDITIONS) {
        yaml_error(r, node, "expected a list of 1 to %d conditions", PROFILE_CONDITIONS);
        return -ERR_INPUT;
    }
    for (size_t i = 0; i < yaml_count(node); i++)
        if (read_condition(r, yaml_item(node, i), &c[*n]) == 0)
            ++*n;
    return 0;
}

static int parse_all(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct profile *p = object;
    return read_conditions(r, node, p->done, &p->n_done);
}

static int parse_any(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct profile *p = object;
    return read_conditions(r, node, p->accept, &p->n_accept);
}

static const struct yaml_key DONE_KEYS[] = {
    YAML_OWN("all", parse_all, .required = true),
    YAML_INTEGER("debounce_polls", AT(debounce_polls), 1, 10, .default_text = "2"),
    {0}};

static const struct yaml_key ACCEPT_KEYS[] = {
    YAML_OWN("any", parse_any, .required = true),
    YAML_INTEGER("within_ms", AT(accept_ms), 1, 5000, .default_text = "100"),
    {0}};

int profile_parse_done(struct yaml_reader *r, const struct yaml_node *node, void *profile) {
    return yaml_read_map(r, node, DONE_KEYS, profile);
}

int profile_parse_accept(struct yaml_reader *r, const struct yaml_node *node, void *profile) {
    return yaml_read_map(r, node, ACCEPT_KEYS, profile);
}

/* "{ready: 1, moving: 0}" or one raw condition */
static int parse_wait(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct profile_step *step = object;
    if (yaml_is_map(node) && yaml_find(node, "reg")) {
        step->n_conditions = 1;
        return read_condition(r, node, &step->condition[0]);
    }
    if (!yaml_is_map(node) || yaml_count(node) == 0 || yaml_count(node) > PROFILE_CONDITIONS) {
        yaml_error(r, node, "expected {bit: 0 or 1, ...} or {reg, mask, is}");
        return -ERR_INPUT;
    }
    for (size_t i = 0; i < yaml_count(node); i++) {
        struct profile_condition *c = &step->condition[step->n_conditions++];
        int64_t on;
        place(yaml_item_key(node, i), &c->line, &c->column);
        if (read_name(r, yaml_item_key(node, i), yaml_item_name(node, i), c) ||
            yaml_read_int(r, yaml_item(node, i), 0, 1, &on))
            return -ERR_INPUT;
        c->negate = !on;
    }
    return 0;
}

static bool word_variable(const char *text, struct profile_word *word) {
    static const char *const NAMES[] = {"", "$target", "$speed", "$accel", "$decel"};
    for (int i = PROFILE_TARGET; i <= PROFILE_DECEL; i++) {
        size_t size = strlen(NAMES[i]);
        if (strncmp(text, NAMES[i], size) != 0)
            continue;
        word->variable = i;
        word->half = strcmp(text + size, ".hi") == 0   ? PROFILE_HI
                     : strcmp(text + size, ".lo") == 0 ? PROFILE_LO
                                                       : PROFILE_WHOLE;
        return word->half != PROFILE_WHOLE || text[size] == 0;
    }
    return false;
}

static int read_words(struct yaml_reader *r, const struct yaml_node *node, struct profile_step *step,
                      bool wide) {
    step->wide = wide;
    if (!yaml_is_list(node) || yaml_count(node) == 0 || yaml_count(node) > PROFILE_WORDS) {
        yaml_error(r, node, "expected a list of 1 to %d values", PROFILE_WORDS);
        return -ERR_INPUT;
    }
    for (size_t i = 0; i < yaml_count(node); i++) {
        const struct yaml_node *item = yaml_item(node, i);
        const char *text = yaml_text(item);
        struct profile_word *word = &step->word[step->n_words++];
        if (text && *text == '$') {
            if (!word_variable(text, word))
                yaml_error(r, item, "unknown value %s; known are $target $speed $accel $decel, .hi .lo",
                           text);
        } else {
            yaml_read_int(r, item, wide ? INT32_MIN : INT16_MIN, wide ? UINT32_MAX : UINT16_MAX,
                          &word->constant);
        }
    }
    return 0;
}

static int parse_u16(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    return read_words(r, node, object, false);
}

static int parse_s32(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    return read_words(r, node, object, true);
}

struct step_form {
    struct profile_step step; /* first: the custom parsers are given this address */
    bool has_w, has_mask, has_ms, has_hold, has_delay;
    int fc, mask, hold_ms, delay_ms;
    char set[PROFILE_NAME], clr[PROFILE_NAME], pulse[PROFILE_NAME];
};

static int parse_expect(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    ((struct profile_step *)object)->verb = PROFILE_EXPECT;
    return parse_wait(r, node, object);
}

static const struct yaml_key STEP_KEYS[] = {
    YAML_INTEGER("w", FORM(step.addr), 0, 65535, YAML_SETS(FORM(has_w)),
                 .doc = "write the values of s32 or u16 from this address on, in one frame"),
    YAML_OWN("s32", parse_s32),
    YAML_OWN("u16", parse_u16),
    YAML_INTEGER("fc", FORM(fc), 6, 16, .doc = "6 for a single register"),
    YAML_TEXT("set", FORM(set)),
    YAML_TEXT("clr", FORM(clr)),
    YAML_TEXT("pulse", FORM(pulse)),
    YAML_INTEGER("mask", FORM(mask), 1, 0x7fffffff, YAML_SETS(FORM(has_mask))),
    YAML_INTEGER("hold_ms", FORM(hold_ms), 1, 5000, YAML_SETS(FORM(has_hold))),
    YAML_OWN("wait", parse_wait),
    YAML_OWN("expect", parse_expect),
    YAML_INTEGER("ms", FORM(step.ms), 1, 600000, YAML_SETS(FORM(has_ms))),
    YAML_FLAG("soft", FORM(step.soft)),
    YAML_INTEGER("delay", FORM(delay_ms), 1, 60000, YAML_SETS(FORM(has_delay)), .unit = "ms"),
    {0}};

static const char *masked_verb(const struct step_form *f, enum profile_verb *verb) {
    *verb = f->set[0] ? PROFILE_SET : f->clr[0] ? PROFILE_CLR : PROFILE_PULSE;
    return f->set[0] ? f->set : f->clr[0] ? f->clr : f->pulse;
}

/* A key of another verb would be read and then not obeyed. */
static const char *foreign_key(const struct step_form *f, bool masked, bool waits) {
    bool values = f->step.n_words > 0 || f->fc;
    if (values && !f->has_w)
        return "s32, u16 and fc belong to w";
    if ((f->has_mask || f->has_hold) && !masked)
        return "mask and hold_ms belong to set, clr and pulse";
    if ((f->has_ms || f->step.soft) && !waits)
        return "ms and soft belong to wait";
    return NULL;
}

/* Which verb the step is, and whether it has what that verb needs. */
static const char *complete_step(struct step_form *f) {
    struct profile_step *step = &f->step;
    bool masked = f->set[0] || f->clr[0] || f->pulse[0], waits = step->n_conditions > 0;
    if (f->has_w + masked + waits + f->has_delay != 1 || !!f->set[0] + !!f->clr[0] + !!f->pulse[0] > 1)
        return "a step has exactly one of w, set, clr, pulse, wait, expect, delay";
    const char *foreign = foreign_key(f, masked, waits);
    if (foreign)
        return foreign;
    if (f->has_w) {
        step->verb = PROFILE_W;
        step->function = f->fc ? f->fc : 16;
        if (step->n_words == 0)
            return "w needs its values: s32: [..] or u16: [..]";
        if (step->function != 16 && (step->function != 6 || step->wide || step->n_words != 1))
            return "fc: 6 writes one 16-bit value; leave it out otherwise";
    } else if (masked) {
        strcpy(step->reg_name, masked_verb(f, &step->verb));
        step->mask = (uint32_t)f->mask;
        step->ms = f->hold_ms;
        if (!f->has_mask || (step->verb == PROFILE_PULSE) != f->has_hold)
            return "set and clr need mask; pulse needs mask and hold_ms";
    } else if (waits) {
        if (step->verb != PROFILE_EXPECT)
            step->verb = PROFILE_WAIT;
        if ((step->verb == PROFILE_WAIT) != f->has_ms)
            return "wait needs ms, its time limit; expect has none";
    } else {
        step->verb = PROFILE_DELAY;
        step->ms = f->delay_ms;
    }
    return NULL;
}

static int read_step(struct yaml_reader *r, const struct yaml_node *node, struct profile_step *step) {
    struct step_form form = {0};
    place(node, &form.step.line, &form.step.column);
    if (yaml_read_map(r, node, STEP_KEYS, &form))
        return -ERR_INPUT;
    const char *mistake = complete_step(&form);
    if (mistake)
        yaml_error(r, node, "%s", mistake);
    *step = form.step;
    return mistake ? -ERR_INPUT : 0;
}

static int parse_steps(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct profile_seq *seq = object;
    if (!yaml_is_list(node) || yaml_count(node) == 0 || yaml_count(node) > PROFILE_STEPS) {
        yaml_error(r, node, "expected a list of 1 to %d steps", PROFILE_STEPS);
        return -ERR_INPUT;
    }
    for (size_t i = 0; i < yaml_count(node); i++)
        read_step(r, yaml_item(node, i), &seq->step[seq->n++]);
    return 0;
}

struct seq_form {
    struct profile_seq seq; /* first, as above */
    int replay;
};

static const struct yaml_key SEQ_KEYS[] = {
    YAML_WORD("replay", SEQ(replay), REPLAYS, .required = true, .doc = "safe: sending it twice does no harm"),
    YAML_OWN("steps", parse_steps, .required = true),
    {0}};

static int seq_index(const char *name) {
    for (int i = 0; i < PROFILE_SEQS; i++)
        if (strcmp(name, SEQ_NAMES[i]) == 0)
            return i;
    return -1;
}

int profile_parse_seq(struct yaml_reader *r, const struct yaml_node *node, void *profile) {
    struct profile *p = profile;
    if (!yaml_is_map(node)) {
        yaml_error(r, node, "expected a map of sequences");
        return -ERR_INPUT;
    }
    for (size_t i = 0; i < yaml_count(node); i++) {
        const char *name = yaml_item_name(node, i);
        int id = seq_index(name);
        if (id < 0) {
            const char *near = yaml_nearest(name, SEQ_NAMES);
            yaml_error(r, yaml_item_key(node, i), "unknown sequence '%s'%s%s%s", name,
                       near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "");
            continue;
        }
        struct seq_form form = {0};
        yaml_read_map(r, yaml_item(node, i), SEQ_KEYS, &form);
        form.seq.present = true;
        form.seq.replay_safe = form.replay == 1;
        p->seq[id] = form.seq;
    }
    return 0;
}
