/*
 * draw.h — random numbers by key instead of by order: the same key gives the same draw, whoever asks first.
 *
 * A key is built by folding words into it; draw_normal(key) is a standard normal deviate, a pure function of
 * the key. draw_normals fills n of them from one key for a row of pixels (Box-Muller on a counter), about
 * 20 ns each. Words may be names (draw_word) or integers. No state, no allocation, any thread.
 * Checked    tests/unit/test_sim_light.c; through the detector: tests/unit/test_sim_noise.c
 */
#ifndef SIM_DRAW_H
#define SIM_DRAW_H

#include <stdint.h>

/* Finaliser of SplitMix64 (Steele, Lea, Flood 2014): every input bit reaches every output bit. */
static inline uint64_t draw_mix(uint64_t x) {
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

static inline uint64_t draw_fold(uint64_t key, uint64_t word) {
    return draw_mix(key + 0x9e3779b97f4a7c15u) ^ draw_mix(word * 0xd1342543de82ef95u + 0x632be59bd9b4e019u);
}

uint64_t draw_word(const char *name); /* FNV-1a */
double draw_normal(uint64_t key);
void draw_normals(uint64_t key, double *z, int n);
/* Standard Brownian motion at t_s >= 0, W(0) = 0: variance t, any two callers see one path. */
double draw_brownian(uint64_t key, double t_s);

#endif
