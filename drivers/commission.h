/*
 * commission.h — tries a profile on a live unit, step by step, with small moves, together with a person.
 *
 * What a profile taken from manuals can have wrong is found before anything moves far: status bits at rest, the
 * order of the two words of a position (a wrong one turns 1 deg into 65,536), where the axis stands, then scale,
 * direction and the bits in motion by a move of at most COMMISSION_MOVE_DEG, the stop order on the way, and the
 * drive's own limits. Every step that moves asks first. It ends with the axis where it began.
 *
 * Use        commission_begin, then commission_answer with "" until question is empty, each time with the
 *            person's answer ("yes" or "no"). text says what the last step found. Nothing is kept here: who calls
 *            records date, profile hash and unit when passed. commission_begin again starts over.
 * Errors     those of the axis; the step can be answered again after one. A "no", or a reading that contradicts
 *            the profile, ends it: over, not passed, text says what to change.
 * Checked    tests/scenario/test_commission.c
 */
#ifndef DRIVERS_COMMISSION_H
#define DRIVERS_COMMISSION_H

#include <stdbool.h>
#include <stdint.h>

#include "drivers/axis.h"

#define COMMISSION_MOVE_DEG 2.0

enum commission_step {
    COMMISSION_STATUS,    /* asks: does it stand, without an alarm? */
    COMMISSION_WORDS,     /* asks only where the words cannot be told apart */
    COMMISSION_POSITION,  /* asks: is that where it stands? */
    COMMISSION_MOVE,      /* asks: is the way clear? then moves */
    COMMISSION_SCALE,     /* asks: was it so far? */
    COMMISSION_DIRECTION, /* asks: was it this way? */
    COMMISSION_STOP,      /* asks: is the way clear? then moves and stops */
    COMMISSION_LIMITS,    /* asks where the drive guards nothing by itself */
    COMMISSION_STEPS
};

struct commission {
    struct axis *axis;
    struct bench *bench;
    enum commission_step step; /* what the answer is to */
    bool asked;                /* false: the first call, there is no answer yet */
    bool over, passed;
    bool position_confirmed; /* the person has said that the position is right */
    int32_t start_udeg, way_udeg;
    char text[600];
    char question[300]; /* empty when over */
};

void commission_begin(struct commission *c, struct axis *axis, struct bench *bench);
int commission_answer(struct commission *c, const char *answer, const struct cancel *cancel, struct err *e);

#endif
