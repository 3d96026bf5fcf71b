/*
 * sampler.h — random numbers for one sample of one pixel, from their place alone: no state, no order.
 *
 * Sobol's first two dimensions, Owen-scrambled by hashes, afresh for each pixel, seed and pair of numbers asked for:
 * the samples 0, 1, ... n - 1 of a pixel are spread evenly in every pair (n a power of two: a net), pairs are
 * independent of each other, and so are pixels and seeds. A mean over n samples of something smooth errs by about
 * n^-3/2, of anything by at most about n^-1/2.
 *
 * Domain     u in (0, 1), never its ends, in steps of 2^-32. The same place gives the same bits in any thread.
 * Source     Burley, Practical hash-based Owen scrambling, JCGT 9(4) 2020; hash of Laine and Karras with the
 *            constants of Vegdahl, 2021.
 * Checked    tests/unit/test_sampler.c: evenness, independence, convergence, bits
 */
#ifndef FIT_RENDER_SAMPLER_H
#define FIT_RENDER_SAMPLER_H

#include <stdint.h>

struct sampler {
    uint32_t place;  /* hash of seed, pixel and the pairs taken so far */
    uint32_t sample; /* counted from 0 in each pixel */
};

void sampler_start(struct sampler *s, uint32_t seed, uint32_t pixel, uint32_t sample);
void sampler_2d(struct sampler *s, double u[2]);
double sampler_1d(struct sampler *s);
/* Of a number that fell at `at` into one of several parts, this one from 0 to `part`: where in it, as even in (0, 1) as
 * the number was. So one pair chooses a way and a direction, and the directions of each way are evenly spread. */
double sampler_within(double at, double part);

#endif
