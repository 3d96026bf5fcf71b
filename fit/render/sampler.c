#include "fit/render/sampler.h"

#define STEP 0x1p-32

static uint32_t reverse(uint32_t x) {
    x = __builtin_bswap32(x);
    x = (x >> 4 & 0x0f0f0f0fu) | (x & 0x0f0f0f0fu) << 4;
    x = (x >> 2 & 0x33333333u) | (x & 0x33333333u) << 2;
    return (x >> 1 & 0x55555555u) | (x & 0x55555555u) << 1;
}

/* Each bit is changed by what stands below it only: with the bits reversed, Owen's scrambling. */
static uint32_t scramble(uint32_t x, uint32_t seed) {
    x = reverse(x);
    x ^= x * 0x3d20adeau;
    x += seed;
    x *= (seed >> 16) | 1;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return reverse(x);
}

/* All bits of x to all bits (Wellons, hash-prospector: lowbias32). */
static uint32_t mix(uint32_t x) {
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    return x ^ x >> 16;
}

/* Sobol's second dimension: x^1 + 1, direction numbers 1, 3, 5, 15, ... */
static uint32_t second(uint32_t index) {
    uint32_t x = 0;
    for (uint32_t direction = 1u << 31; index; index >>= 1, direction ^= direction >> 1) {
        x ^= index & 1 ? direction : 0;
    }
    return x;
}

static double in_unit(uint32_t x) {
    return (x + 0.5) * STEP;
}

void sampler_start(struct sampler *s, uint32_t seed, uint32_t pixel, uint32_t sample) {
    s->place = mix(pixel + mix(seed + 0x9e3779b9u));
    s->sample = sample;
}

void sampler_2d(struct sampler *s, double u[2]) {
    s->place = mix(s->place + 0x9e3779b9u);
    uint32_t index = scramble(s->sample, s->place); /* another order in each pair */
    u[0] = in_unit(scramble(reverse(index), mix(s->place ^ 0x68bc21ebu)));
    u[1] = in_unit(scramble(second(index), mix(s->place ^ 0x02e5be93u)));
}

double sampler_1d(struct sampler *s) {
    double u[2];
    sampler_2d(s, u);
    return u[0];
}

double sampler_within(double at, double part) {
    double u = at / part;
    return u > STEP / 2 ? u < 1 - STEP / 2 ? u : 1 - STEP / 2 : STEP / 2;
}
