/*
 * dice.h — random numbers that are the same on every machine, for made-up measurements and resampling.
 *
 * splitmix64 (Steele, Lea and Flood 2014) for uniform numbers inside (0, 1), Box and Muller for normal ones. The
 * state is the seed, and all there is.
 * Checked    tests/unit/test_fit_parts.c
 */
#ifndef FIT_DICE_H
#define FIT_DICE_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

struct dice {
    uint64_t state;
};

double dice_uniform(struct dice *d);
double dice_normal(struct dice *d);

#ifdef __cplusplus
}
#endif

#endif
