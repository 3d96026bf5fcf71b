#include <string.h>

#include "proto/profile_inside.h"
#include "proto/yaml_table.h"

#define AT(member) struct profile, member
#define REG(member) struct profile_reg, member

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
    YAML_WORD("kind", AT(link.tcp), KINDS, .default_text = "rtu",
              .doc = "what the drive speaks by itself; goniod.yaml's link decides"),
    YAML_INTEGER("baud", AT(link.baud), 1200, 4000000, .default_text = "115200"),
    YAML_WORD("parity", AT(link.parity), PARITIES, .default_text = "E"),
    YAML_INTEGER("data", AT(link.data), 7, 8, .default_text = "8"),
    YAML_INTEGER("stop", AT(link.stop), 1, 2, .default_text = "1"),
    YAML_INTEGER("port", AT(link.port), 1, 65535, .default_text = "502"),
    YAML_INTEGER("unit", AT(link.unit), 1, 247, .default_text = "1"),
    YAML_INTEGER("response_ms", AT(link.response_ms), 10, 5000, .default_text = "200", .unit = "ms",
                 .doc = "the whole reply has arrived by then, or it is lost"),
    YAML_INTEGER("byte_ms", AT(link.byte_ms), 0, 1000, .default_text = "50", .unit = "ms",
                 .doc = "recorded only: the bound is response_ms for the whole reply"),
    YAML_INTEGER("gap_ms", AT(link.gap_ms), 0, 50, .default_text = "3", .unit = "ms",
                 .doc = "silence the drive needs between a reply and the next request"),
    YAML_INTEGER("quarantine_ms", AT(link.quarantine_ms), 0, 5000, .default_text = "300", .unit = "ms",
                 .doc = "silence after a lost reply: longer than the latest reply"),
    YAML_INTEGER("fc_read", AT(link.fc_read), 3, 4, .default_text = "3"),
    YAML_INTEGER("fc_write", AT(link.fc_write), 6, 16, .default_text = "16",
                 .doc = "16, or 6 for a drive that takes one register a frame"),
    YAML_INTEGER("max_read", AT(link.max_read), 1, 125, .default_text = "125"),
    YAML_INTEGER("max_write", AT(link.max_write), 1, 123, .default_text = "123"),
    {0}};

static const struct yaml_key ORDER_KEYS[] = {
    YAML_WORD("word", AT(low_word_first), WORD_ORDERS, .required = true,
              .doc = "which half of a 32-bit value has the lower address"),
    {0}};

static const struct yaml_key SPEED_KEYS[] = {
    YAML_WORD("kind", AT(scale.speed.kind), SPEEDS, .required = true),
    YAML_NUMBER("factor", AT(scale.speed.factor), 1e-6, 1e9, .default_text = "1",
                .doc = "raw speed of 1 deg/s"),
    {0}};

static const struct yaml_key ACCEL_KEYS[] = {
    YAML_WORD("kind", AT(scale.accel.kind), ACCELS, .required = true),
    YAML_NUMBER("factor", AT(scale.accel.factor), 1e-6, 1e9, .default_text = "1",
                .doc = "raw acceleration of 1 deg/s^2"),
    {0}};

static const struct yaml_key SCALE_KEYS[] = {
    YAML_NUMBER("steps_per_deg", AT(scale.steps_per_deg), 1e-3, 1e7, .required = true, .unit = "1/deg"),
    YAML_INTEGER("sign", AT(scale.sign), -1, 1, .default_text = "1"),
    YAML_PART("speed", SPEED_KEYS, .required = true),
    YAML_PART("accel", ACCEL_KEYS, .required = true),
    {0}};

static const struct yaml_key POLL_KEYS[] = {
    YAML_INTEGER("moving_ms", AT(poll.moving_ms), 5, 1000, .default_text = "50", .unit = "ms"),
    YAML_INTEGER("idle_ms", AT(poll.idle_ms), 5, 10000, .default_text = "500", .unit = "ms"),
    YAML_INTEGER("fast_polls", AT(poll.fast_polls), 0, 20, .default_text = "3",
                 .doc = "quick polls after an order and around the expected arrival"),
    {0}};

static const struct yaml_key WATCHDOG_KEYS[] = {
    YAML_INTEGER("drive_ms", AT(watchdog.drive_ms), 0, 60000, .required = true, .unit = "ms",
                 .doc = "the drive stops when it hears nothing for so long; 0 = it has no watchdog"),
    YAML_WORD("feeds", AT(watchdog.any_traffic), FEEDS, .default_text = "unit",
              .doc = "recorded only: each axis polls its own unit often enough for either"),
    {0}};

static const struct yaml_key LIMITS_KEYS[] = {
    YAML_NUMBER("low_deg", AT(limits.low_deg), -2000, 2000, .required = true, .unit = "deg"),
    YAML_NUMBER("high_deg", AT(limits.high_deg), -2000, 2000, .required = true, .unit = "deg"),
    {0}};

static const struct yaml_key REG_KEYS[] = {YAML_INTEGER("addr", REG(addr), 0, 65535, .required = true,
                                                        .doc = "address in the frame, counted from 0"),
                                           YAML_WORD("type", REG(type), TYPES, .required = true),
                                           {0}};

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

static int read_bit(struct yaml_reader *r, const struct yaml_node *value, const char *name,
                    struct profile *p) {
    struct profile_masked masked;
    if (profile_parse_masked(r, value, &masked))
        return -ERR_INPUT;
    struct profile_bit *bit = &p->bit[p->n_bits++];
    strcpy(bit->name, name);
    strcpy(bit->reg_name, masked.reg);
    bit->mask = (uint32_t)masked.mask;
    bit->is = (uint32_t)masked.is;
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
    YAML_TEXT("id", AT(id), .required = true),
    YAML_TEXT("vendor", AT(vendor), .required = true),
    YAML_TEXTS("models", AT(model), AT(n_models)),
    YAML_WORD("evidence", AT(evidence), EVIDENCE, .required = true,
              .doc = "sources-only: a campaign asks for commissioning on the unit first"),
    YAML_PART("link", LINK_KEYS, .default_text = "{}"),
    YAML_PART("order", ORDER_KEYS, .required = true),
    YAML_PART("scale", SCALE_KEYS, .required = true),
    YAML_NUMBER("speed_deg_s", AT(speed_deg_s), 0.001, 2000, .required = true, .unit = "deg/s",
                .doc = "speed of every move"),
    YAML_NUMBER("accel_deg_s2", AT(accel_deg_s2), 0.001, 1e6, .required = true, .unit = "deg/s^2",
                .doc = "acceleration and deceleration of every move"),
    YAML_NUMBER("max_speed_deg_s", AT(max_speed_deg_s), 0.001, 1e5, .default_text = "2000", .unit = "deg/s"),
    YAML_NUMBER("max_accel_deg_s2", AT(max_accel_deg_s2), 0.001, 1e7, .default_text = "1e6",
                .unit = "deg/s^2"),
    YAML_OWN("reg", parse_reg, .required = true,
             .doc = "registers by name; pos is required; dpos, alarm, lim_hi, lim_lo are known names"),
    YAML_OWN("status", parse_status, .required = true,
             .doc = "bits by name; moving or inpos is required; alarm, homed, valid are known names"),
    YAML_OWN("done", profile_parse_done, .required = true, .doc = "{all: [condition..], debounce_polls: 2}"),
    YAML_OWN("accept", profile_parse_accept, .required = true,
             .doc = "{any: [bit, {readback: reg, equals: $target}, {readback: reg, mask}], within_ms: 100}"),
    YAML_OWN("seq", profile_parse_seq, .required = true,
             .doc =
                 "enable disable home set_zero move_abs stop abort alarm_reset: {replay: safe, steps: [..]}"),
    YAML_PART("poll", POLL_KEYS, .default_text = "{}"),
    YAML_PART("watchdog", WATCHDOG_KEYS, .required = true),
    YAML_PART("limits", LIMITS_KEYS, .doc = "travel of the mechanics in drive coordinates"),
    YAML_INTEGER("settle_ms", AT(settle_ms), 0, 10000, .required = true, .unit = "ms"),
    YAML_NUMBER("inpos_deg", AT(inpos_deg), 0.0001, 5, .default_text = "0.02", .unit = "deg",
                .doc = "retry deadband: readback against setpoint"),
    YAML_INTEGER("retry_max", AT(retry_max), 0, 10, .default_text = "2"),
    YAML_NUMBER("backlash_deg", AT(backlash_deg), -10, 10, .default_text = "0", .unit = "deg",
                .doc = "distance of the last approach; its sign is its direction"),
    YAML_NUMBER("u_repeat_deg", AT(u_repeat_deg), 0, 5, .required = true, .unit = "deg",
                .doc = "standard uncertainty of one move, independent"),
    YAML_NUMBER("u_transmission_deg", AT(u_transmission_deg), 0, 5, .required = true, .unit = "deg",
                .doc = "standard uncertainty of the gear, common"),
    YAML_INTEGERS("no_reset", AT(no_reset), AT(n_no_reset), 0, 0xffff,
                  .doc = "alarms whose cause a person has to look at"),
    YAML_INTEGERS("revokes", AT(revokes), AT(n_revokes), 0, 0xffff,
                  .doc = "alarms after which the position is not valid"),
    YAML_OWN("alarms", parse_alarms, .doc = "code: text"),
    {0}};
