/*
 * profile_seq.h — how a drive is ordered about, as a profile says it: sequences of steps, and conditions.
 *
 * Sequences  lists of steps out of seven verbs: w (registers, one frame), set, clr, pulse (mask in a command
 *            word whose state is remembered), wait (conditions within ms), expect (the same, now), delay.
 *            replay: safe means that sending it again does no harm (an absolute target).
 * Conditions name a status bit, "!name" negates it; or {reg, mask, is}. All of a list must hold.
 * Values     constants, or $target $speed $accel $decel in the drive's own units, with .hi or .lo for a half.
 * Checked    tests/unit/test_profile.c
 */
#ifndef PROTO_PROFILE_SEQ_H
#define PROTO_PROFILE_SEQ_H

#include <stdbool.h>
#include <stdint.h>

#define PROFILE_STEPS 10
#define PROFILE_WORDS 16
#define PROFILE_CONDITIONS 6
#define PROFILE_NAME 16

struct profile_condition {
    char name[PROFILE_NAME]; /* of a status bit, or of a register */
    bool raw;                /* {reg, mask, is} instead of a status bit */
    bool demand;             /* accept only: the register equals $target */
    bool negate;
    int reg;
    uint32_t mask, is;
    int line, column;
};

enum profile_verb {
    PROFILE_W,
    PROFILE_SET,
    PROFILE_CLR,
    PROFILE_PULSE,
    PROFILE_WAIT,
    PROFILE_EXPECT,
    PROFILE_DELAY
};
enum profile_variable { PROFILE_CONSTANT, PROFILE_TARGET, PROFILE_SPEED, PROFILE_ACCEL, PROFILE_DECEL };
enum profile_half { PROFILE_WHOLE, PROFILE_HI, PROFILE_LO };

struct profile_word {
    enum profile_variable variable;
    enum profile_half half;
    int64_t constant;
};

struct profile_step {
    enum profile_verb verb;
    int addr;     /* w */
    int function; /* w: 6 or 16 */
    bool wide;    /* w: each word is 32 bit */
    int n_words;
    struct profile_word word[PROFILE_WORDS];
    char reg_name[PROFILE_NAME]; /* set, clr, pulse */
    int reg;
    uint32_t mask;
    int ms;    /* pulse: hold; wait: time limit; delay */
    bool soft; /* wait: running out of time is no error */
    int n_conditions;
    struct profile_condition condition[PROFILE_CONDITIONS];
    int line, column;
};

enum profile_seq_id {
    PROFILE_ENABLE, /* before the first order after every connect */
    PROFILE_DISABLE,
    PROFILE_HOME,
    PROFILE_SET_ZERO,
    PROFILE_MOVE_ABS,
    PROFILE_STOP,  /* with ramp; lets the axis move again at its end */
    PROFILE_ABORT, /* when goniod leaves a moving axis behind */
    PROFILE_ALARM_RESET,
    PROFILE_SEQS
};

struct profile_seq {
    bool present, replay_safe;
    int n;
    struct profile_step step[PROFILE_STEPS];
};

const char *profile_seq_name(enum profile_seq_id id);

#endif
