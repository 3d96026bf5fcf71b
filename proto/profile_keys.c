#include <string.h>

#include "proto/profile_inside.h"

#define AT(member) .offset = offsetof(struct profile, member)
#define COUNT(member) .count_offset = offsetof(struct profile, member)
#define IN(outer, member) .offset = offsetof(struct profile, outer.member) - offsetof(struct profile, outer)

static const char *const EVIDENCE[] = {"sources-only", "bench", "field", NULL};
static const char *const KINDS[] = {"rtu", "tcp", NULL};
static const char *const PARITIES[] = {"N", "E", "O", NULL}; /* as profile_parities */
static const char *const WORD_ORDERS[] = {"hi_lo", "lo_hi", NULL};
static const char *const SPEEDS[] = {"step_s", "rpm", "user", NULL};
static const char *const ACCELS[] = {"step_s2", "ms_per_1000rpm", "user", "none", NULL};
static const char *const FEEDS[] = {"unit", "any_bus_traffic", NULL};
static const char *const TYPES[] = {"u16", "s16", "u32", "s32", NULL};

const char profile_parities[] = "NEO";

static const struct yaml_key LINK_KEYS[] = {
    {.name = "kind",
     .type = YAML_CHOICE,
     IN(link, tcp),
     .choices = KINDS,
     .default_text = "rtu",
     .doc = "what the drive speaks by itself; goniod.yaml's link decides"},
    {.name = "baud",
     .type = YAML_INT,
     IN(link, baud),
     .low = 1200,
     .high = 4000000,
     .default_text = "115200"},
    {.name = "parity", .type = YAML_CHOICE, IN(link, parity), .choices = PARITIES, .default_text = "E"},
    {.name = "data", .type = YAML_INT, IN(link, data), .low = 7, .high = 8, .default_text = "8"},
    {.name = "stop", .type = YAML_INT, IN(link, stop), .low = 1, .high = 2, .default_text = "1"},
    {.name = "port", .type = YAML_INT, IN(link, port), .low = 1, .high = 65535, .default_text = "502"},
    {.name = "unit", .type = YAML_INT, IN(link, unit), .low = 1, .high = 247, .default_text = "1"},
    {.name = "response_ms",
     .type = YAML_INT,
     IN(link, response_ms),
     .low = 10,
     .high = 5000,
     .default_text = "200",
     .unit = "ms",
     .doc = "the whole reply has arrived by then, or it is lost"},
    {.name = "byte_ms",
     .type = YAML_INT,
     IN(link, byte_ms),
     .low = 0,
     .high = 1000,
     .default_text = "50",
     .unit = "ms",
     .doc = "recorded only: the bound is response_ms for the whole reply"},
    {.name = "gap_ms",
     .type = YAML_INT,
     IN(link, gap_ms),
     .low = 0,
     .high = 50,
     .default_text = "3",
     .unit = "ms",
     .doc = "silence the drive needs between a reply and the next request"},
    {.name = "quarantine_ms",
     .type = YAML_INT,
     IN(link, quarantine_ms),
     .low = 0,
     .high = 5000,
     .default_text = "300",
     .unit = "ms",
     .doc = "silence after a lost reply: longer than the latest reply"},
    {.name = "fc_read", .type = YAML_INT, IN(link, fc_read), .low = 3, .high = 4, .default_text = "3"},
    {.name = "fc_write",
     .type = YAML_INT,
     IN(link, fc_write),
     .low = 6,
     .high = 16,
     .default_text = "16",
     .doc = "16, or 6 for a drive that takes one register a frame"},
    {.name = "max_read", .type = YAML_INT, IN(link, max_read), .low = 1, .high = 125, .default_text = "125"},
    {.name = "max_write",
     .type = YAML_INT,
     IN(link, max_write),
     .low = 1,
     .high = 123,
     .default_text = "123"},
    {.name = NULL},
};

static const struct yaml_key ORDER_KEYS[] = {
    {.name = "word",
     .type = YAML_CHOICE,
     .offset = 0,
     .choices = WORD_ORDERS,
     .required = true,
     .doc = "which half of a 32-bit value has the lower address"},
    {.name = NULL},
};

static const struct yaml_key SPEED_KEYS[] = {
    {.name = "kind", .type = YAML_CHOICE, IN(scale.speed, kind), .choices = SPEEDS, .required = true},
    {.name = "factor",
     .type = YAML_DOUBLE,
     IN(scale.speed, factor),
     .low = 1e-6,
     .high = 1e9,
     .default_text = "1",
     .doc = "raw speed of 1 deg/s"},
    {.name = NULL},
};

static const struct yaml_key ACCEL_KEYS[] = {
    {.name = "kind", .type = YAML_CHOICE, IN(scale.accel, kind), .choices = ACCELS, .required = true},
    {.name = "factor",
     .type = YAML_DOUBLE,
     IN(scale.accel, factor),
     .low = 1e-6,
     .high = 1e9,
     .default_text = "1",
     .doc = "raw acceleration of 1 deg/s^2"},
    {.name = NULL},
};

static const struct yaml_key SCALE_KEYS[] = {
    {.name = "steps_per_deg",
     .type = YAML_DOUBLE,
     IN(scale, steps_per_deg),
     .low = 1e-3,
     .high = 1e7,
     .required = true,
     .unit = "1/deg"},
    {.name = "sign", .type = YAML_INT, IN(scale, sign), .low = -1, .high = 1, .default_text = "1"},
    {.name = "speed", .type = YAML_MAP, IN(scale, speed), .keys = SPEED_KEYS, .required = true},
    {.name = "accel", .type = YAML_MAP, IN(scale, accel), .keys = ACCEL_KEYS, .required = true},
    {.name = NULL},
};

static const struct yaml_key POLL_KEYS[] = {
    {.name = "moving_ms",
     .type = YAML_INT,
     IN(poll, moving_ms),
     .low = 5,
     .high = 1000,
     .default_text = "50",
     .unit = "ms"},
    {.name = "idle_ms",
     .type = YAML_INT,
     IN(poll, idle_ms),
     .low = 5,
     .high = 10000,
     .default_text = "500",
     .unit = "ms"},
    {.name = "fast_polls",
     .type = YAML_INT,
     IN(poll, fast_polls),
     .low = 0,
     .high = 20,
     .default_text = "3",
     .doc = "quick polls after an order and around the expected arrival"},
    {.name = NULL},
};

static const struct yaml_key WATCHDOG_KEYS[] = {
    {.name = "drive_ms",
     .type = YAML_INT,
     IN(watchdog, drive_ms),
     .low = 0,
     .high = 60000,
     .required = true,
     .unit = "ms",
     .doc = "the drive stops when it hears nothing for so long; 0 = it has no watchdog"},
    {.name = "feeds",
     .type = YAML_CHOICE,
     IN(watchdog, any_traffic),
     .choices = FEEDS,
     .default_text = "unit",
     .doc = "recorded only: each axis polls its own unit often enough for either"},
    {.name = NULL},
};

static const struct yaml_key LIMITS_KEYS[] = {
    {.name = "low_deg",
     .type = YAML_DOUBLE,
     IN(limits, low_deg),
     .low = -2000,
     .high = 2000,
     .required = true,
     .unit = "deg"},
    {.name = "high_deg",
     .type = YAML_DOUBLE,
     IN(limits, high_deg),
     .low = -2000,
     .high = 2000,
     .required = true,
     .unit = "deg"},
    {.name = NULL},
};

static const struct yaml_key REG_KEYS[] = {
    {.name = "addr",
     .type = YAML_INT,
     .offset = offsetof(struct profile_reg, addr),
     .low = 0,
     .high = 65535,
     .required = true,
     .doc = "address in the frame, counted from 0"},
    {.name = "type",
     .type = YAML_CHOICE,
     .offset = offsetof(struct profile_reg, type),
     .choices = TYPES,
     .required = true},
    {.name = NULL},
};

/* A map of names to something: walks it and hands each entry, named, to read(). */
static int read_named(struct yaml_reader *r, const struct yaml_node *node, int capacity, const char *what,
                      int (*read)(struct yaml_reader *r, const struct yaml_node *value, const char *name,
                                  struct profile *p),
                      struct profile *p) {
    if (!yaml_is_map(node)) {
        yaml_error(r, node, "expected a map of names to %s", what);
        return -ERR_INPUT;
    }
    for (size_t i = 0; i < yaml_count(node); i++) {
        if (i == (size_t)capacity) {
            yaml_error(r, yaml_item_key(node, i), "more than %d %s", capacity, what);
            return -ERR_INPUT;
        }
        const char *name = yaml_item_name(node, i);
        if (strlen(name) >= PROFILE_NAME)
            yaml_error(r, yaml_item_key(node, i), "the name '%s' is longer than %d letters", name,
                       PROFILE_NAME - 1);
        else
            read(r, yaml_item(node, i), name, p);
    }
    return 0;
}

static int read_reg(struct yaml_reader *r, const struct yaml_node *value, const char *name,
                    struct profile *p) {
    struct profile_reg *reg = &p->reg[p->n_regs++];
    strcpy(reg->name, name);
    return yaml_read_map(r, value, REG_KEYS, reg);
}

static int parse_reg(struct yaml_reader *r, const struct yaml_node *node, void *profile) {
    return read_named(r, node, PROFILE_REGS, "registers", read_reg, profile);
}

struct bit_form {
    int mask, is;
    bool has_is;
    char reg[PROFILE_NAME];
};

static const struct yaml_key BIT_KEYS[] = {
    {.name = "reg",
     .type = YAML_STRING,
     .offset = offsetof(struct bit_form, reg),
     .size = PROFILE_NAME,
     .required = true},
    {.name = "mask",
     .type = YAML_INT,
     .offset = offsetof(struct bit_form, mask),
     .low = 1,
     .high = 0x7fffffff,
     .required = true},
    {.name = "is",
     .type = YAML_INT,
     .offset = offsetof(struct bit_form, is),
     .low = 0,
     .high = 0x7fffffff,
     .set_offset = offsetof(struct bit_form, has_is) + 1,
     .doc = "value under the mask; default: the mask"},
    {.name = NULL},
};

static int read_bit(struct yaml_reader *r, const struct yaml_node *value, const char *name,
                    struct profile *p) {
    struct bit_form form = {0};
    if (yaml_read_map(r, value, BIT_KEYS, &form))
        return -ERR_INPUT;
    struct profile_bit *bit = &p->bit[p->n_bits++];
    strcpy(bit->name, name);
    strcpy(bit->reg_name, form.reg);
    bit->mask = (uint32_t)form.mask;
    bit->is = (uint32_t)(form.has_is ? form.is : form.mask);
    return 0;
}

static int parse_status(struct yaml_reader *r, const struct yaml_node *node, void *profile) {
    return read_named(r, node, PROFILE_BITS, "status bits", read_bit, profile);
}

static int parse_alarms(struct yaml_reader *r, const struct yaml_node *node, void *profile) {
    struct profile *p = profile;
    if (!yaml_is_map(node) || yaml_count(node) > PROFILE_ALARMS) {
        yaml_error(r, node, "expected a map of at most %d alarm codes to their texts", PROFILE_ALARMS);
        return -ERR_INPUT;
    }
    for (size_t i = 0; i < yaml_count(node); i++) {
        int64_t code;
        struct profile_alarm *alarm = &p->alarm[p->n_alarms];
        if (yaml_read_int(r, yaml_item_key(node, i), 1, 0xffff, &code) ||
            yaml_read_string(r, yaml_item(node, i), alarm->text, sizeof alarm->text))
            continue;
        alarm->code = (int)code;
        p->n_alarms++;
    }
    return 0;
}

const struct yaml_key profile_keys[] = {
    {.name = "id", .type = YAML_STRING, AT(id), .size = sizeof((struct profile *)0)->id, .required = true},
    {.name = "vendor",
     .type = YAML_STRING,
     AT(vendor),
     .size = sizeof((struct profile *)0)->vendor,
     .required = true},
    {.name = "models",
     .type = YAML_STRINGS,
     AT(model),
     .size = sizeof((struct profile *)0)->model[0],
     .capacity = 16,
     COUNT(n_models)},
    {.name = "evidence",
     .type = YAML_CHOICE,
     AT(evidence),
     .choices = EVIDENCE,
     .required = true,
     .doc = "sources-only: a campaign asks for commissioning on the unit first"},
    {.name = "link", .type = YAML_MAP, AT(link), .keys = LINK_KEYS, .default_text = "{}"},
    {.name = "order", .type = YAML_MAP, AT(low_word_first), .keys = ORDER_KEYS, .required = true},
    {.name = "scale", .type = YAML_MAP, AT(scale), .keys = SCALE_KEYS, .required = true},
    {.name = "speed_deg_s",
     .type = YAML_DOUBLE,
     AT(speed_deg_s),
     .low = 0.001,
     .high = 2000,
     .required = true,
     .unit = "deg/s",
     .doc = "speed of every move"},
    {.name = "accel_deg_s2",
     .type = YAML_DOUBLE,
     AT(accel_deg_s2),
     .low = 0.001,
     .high = 1e6,
     .required = true,
     .unit = "deg/s^2",
     .doc = "acceleration and deceleration of every move"},
    {.name = "max_speed_deg_s",
     .type = YAML_DOUBLE,
     AT(max_speed_deg_s),
     .low = 0.001,
     .high = 1e5,
     .default_text = "2000",
     .unit = "deg/s"},
    {.name = "max_accel_deg_s2",
     .type = YAML_DOUBLE,
     AT(max_accel_deg_s2),
     .low = 0.001,
     .high = 1e7,
     .default_text = "1e6",
     .unit = "deg/s^2"},
    {.name = "reg",
     .type = YAML_CUSTOM,
     .custom = parse_reg,
     .required = true,
     .doc = "registers by name; pos is required; dpos, alarm, lim_hi, lim_lo are known names"},
    {.name = "status",
     .type = YAML_CUSTOM,
     .custom = parse_status,
     .required = true,
     .doc = "bits by name; moving or inpos is required; alarm, homed, valid are known names"},
    {.name = "done",
     .type = YAML_CUSTOM,
     .custom = profile_parse_done,
     .required = true,
     .doc = "{all: [condition..], debounce_polls: 2}"},
    {.name = "accept",
     .type = YAML_CUSTOM,
     .custom = profile_parse_accept,
     .required = true,
     .doc = "{any: [bit, {readback: reg, equals: $target}, {readback: reg, mask}], within_ms: 100}"},
    {.name = "seq",
     .type = YAML_CUSTOM,
     .custom = profile_parse_seq,
     .required = true,
     .doc = "enable disable home set_zero move_abs stop abort alarm_reset: {replay: safe, steps: [..]}"},
    {.name = "poll", .type = YAML_MAP, AT(poll), .keys = POLL_KEYS, .default_text = "{}"},
    {.name = "watchdog", .type = YAML_MAP, AT(watchdog), .keys = WATCHDOG_KEYS, .required = true},
    {.name = "limits",
     .type = YAML_MAP,
     AT(limits),
     .keys = LIMITS_KEYS,
     .doc = "travel of the mechanics in drive coordinates"},
    {.name = "settle_ms",
     .type = YAML_INT,
     AT(settle_ms),
     .low = 0,
     .high = 10000,
     .required = true,
     .unit = "ms"},
    {.name = "inpos_deg",
     .type = YAML_DOUBLE,
     AT(inpos_deg),
     .low = 0.0001,
     .high = 5,
     .default_text = "0.02",
     .unit = "deg",
     .doc = "retry deadband: readback against setpoint"},
    {.name = "retry_max", .type = YAML_INT, AT(retry_max), .low = 0, .high = 10, .default_text = "2"},
    {.name = "backlash_deg",
     .type = YAML_DOUBLE,
     AT(backlash_deg),
     .low = -10,
     .high = 10,
     .default_text = "0",
     .unit = "deg",
     .doc = "distance of the last approach; its sign is its direction"},
    {.name = "u_repeat_deg",
     .type = YAML_DOUBLE,
     AT(u_repeat_deg),
     .low = 0,
     .high = 5,
     .required = true,
     .unit = "deg",
     .doc = "standard uncertainty of one move, independent"},
    {.name = "u_transmission_deg",
     .type = YAML_DOUBLE,
     AT(u_transmission_deg),
     .low = 0,
     .high = 5,
     .required = true,
     .unit = "deg",
     .doc = "standard uncertainty of the gear, common"},
    {.name = "no_reset",
     .type = YAML_INTS,
     AT(no_reset),
     .capacity = 16,
     COUNT(n_no_reset),
     .low = 0,
     .high = 0xffff,
     .doc = "alarms whose cause a person has to look at"},
    {.name = "revokes",
     .type = YAML_INTS,
     AT(revokes),
     .capacity = 8,
     COUNT(n_revokes),
     .low = 0,
     .high = 0xffff,
     .doc = "alarms after which the position is not valid"},
    {.name = "alarms", .type = YAML_CUSTOM, .custom = parse_alarms, .doc = "code: text"},
    {.name = NULL},
};
