/*
 * profile.h — the register map of a positioner as data: what a Modbus unit means, without a line of C.
 *
 * One YAML file a family of drives (form: docs/profiles.md, structure: stage-modbus.md 3): how its link is
 * set, its registers, status bits, how a move is ordered, accepted and done, its alarms, and the figures of
 * its mechanics. The axis driver interprets it; the simulator never loads it, so that an error in a profile
 * shows.
 *
 * Units      raw speed = deg/s * speed.factor; raw accel = deg/s^2 * accel.factor, or for ms_per_1000rpm the
 *            milliseconds to 1000 rpm at speed.factor rpm per deg/s.
 * Errors     -ERR_INPUT with every mistake at its place; -ERR_IO when the file cannot be read.
 * Checked    tests/unit/test_profile.c
 */
#ifndef PROTO_PROFILE_H
#define PROTO_PROFILE_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "proto/err.h"
#include "proto/profile_seq.h"

#define PROFILE_REGS 24
#define PROFILE_BITS 16
#define PROFILE_ALARMS 64
#ifndef PROFILE_DIR
#define PROFILE_DIR "/usr/share/goniod/profiles"
#endif

enum profile_evidence { PROFILE_SOURCES_ONLY, PROFILE_BENCH, PROFILE_FIELD };
enum profile_type { PROFILE_U16, PROFILE_S16, PROFILE_U32, PROFILE_S32 };
enum profile_speed_kind { PROFILE_SPEED_STEP_S, PROFILE_SPEED_RPM, PROFILE_SPEED_USER };
enum profile_accel_kind {
    PROFILE_ACCEL_STEP_S2,
    PROFILE_ACCEL_MS_PER_1000RPM,
    PROFILE_ACCEL_USER,
    PROFILE_ACCEL_NONE
};

struct profile_reg {
    char name[PROFILE_NAME];
    int addr; /* PDU address, from 0 */
    enum profile_type type;
};

struct profile_bit { /* true when (register & mask) == is */
    char name[PROFILE_NAME];
    char reg_name[PROFILE_NAME];
    int reg; /* index into profile.reg */
    uint32_t mask, is;
};

struct profile_alarm {
    int code;
    char text[80];
};

struct profile {
    char id[32], vendor[48];
    char file[256];
    char hash[17]; /* FNV-1a of the file's text: which profile was this */
    int n_models;
    char model[16][24];
    int evidence; /* enum profile_evidence */
    struct {
        int tcp;                                  /* kind: 0 rtu, 1 tcp */
        int baud, parity, data, stop, port, unit; /* parity: index into profile_parities */
        int response_ms, byte_ms, gap_ms, quarantine_ms;
        int fc_read, fc_write, max_read, max_write;
    } link;
    int low_word_first; /* order.word: 0 hi_lo, 1 lo_hi */
    struct {
        double steps_per_deg;
        int sign;
        struct {
            int kind;
            double factor;
        } speed, accel;
    } scale;
    double speed_deg_s, accel_deg_s2; /* what goniod asks for */
    double max_speed_deg_s, max_accel_deg_s2;
    int n_regs;
    struct profile_reg reg[PROFILE_REGS];
    int reg_position, reg_demand, reg_alarm; /* pos, dpos, alarm; -1 = none */
    int reg_limit_high, reg_limit_low;       /* lim_hi, lim_lo: the drive's own soft limits; -1 = none */
    int n_bits;
    struct profile_bit bit[PROFILE_BITS];
    int bit_moving, bit_inpos, bit_alarm, bit_valid; /* -1 = the drive has none */
    int n_done, debounce_polls;
    struct profile_condition done[PROFILE_CONDITIONS]; /* all */
    int n_accept, accept_ms;
    struct profile_condition accept[PROFILE_CONDITIONS]; /* any */
    struct profile_seq seq[PROFILE_SEQS];
    struct {
        int moving_ms, idle_ms, fast_polls;
    } poll;
    struct {
        int drive_ms;    /* 0 = the drive has none or it is off */
        int any_traffic; /* feeds: 0 unit, 1 any_bus_traffic */
    } watchdog;
    struct {
        double low_deg, high_deg; /* of the mechanics, drive coordinates; equal = none */
    } limits;
    int settle_ms, retry_max;
    double inpos_deg, backlash_deg; /* backlash: sign = side of the last approach; 0 = none */
    double u_repeat_deg, u_transmission_deg;
    int n_alarms;
    struct profile_alarm alarm[PROFILE_ALARMS];
    int n_no_reset, no_reset[16]; /* alarms a person has to clear at the drive */
    int n_revokes, revokes[8];    /* alarms after which the position is not valid */
};

extern const char profile_parities[]; /* "NEO" */

/* name: a path (holds a '/'), or the name of a file NAME.yaml in $GONIOD_PROFILES, PROFILE_DIR, or the source
 * tree of a program that has not been installed. */
int profile_load(const char *name, struct profile *p, struct err_list *errors);
int profile_read_text(const char *file, const char *text, size_t size, struct profile *p,
                      struct err_list *errors);

const char *profile_alarm_text(const struct profile *p, int code); /* "overload", or "unknown alarm" */
bool profile_alarm_revokes(const struct profile *p, int code);
bool profile_alarm_needs_person(const struct profile *p, int code);
const char *profile_evidence_name(int evidence);
int profile_reg_words(const struct profile_reg *reg); /* 1 or 2 */

/* Raw drive units of the speed and acceleration this profile asks for. */
int32_t profile_raw_speed(const struct profile *p);
int32_t profile_raw_accel(const struct profile *p);
/* A value of a register from its words in the drive's order, and back; no undefined shifts. */
int64_t profile_decode(const struct profile *p, enum profile_type type, const uint16_t *words);
int profile_encode(const struct profile *p, bool wide, int64_t value, uint16_t *words); /* words written */

void profile_print_reference(FILE *out); /* docs/profiles.md */

#endif
