#include "sim/draw.h"

#include <math.h>
#include <stdbool.h>

#define TWO_PI 6.283185307179586477

uint64_t draw_word(const char *name) {
    uint64_t h = 0xcbf29ce484222325u;
    for (; *name; name++)
        h = (h ^ (uint8_t)*name) * 0x100000001b3u;
    return h;
}

/* (0, 1], so that its logarithm is finite. */
static double unit(uint64_t bits) {
    return (double)((bits >> 11) + 1) * 0x1p-53;
}

static double radius(uint64_t bits) {
    return sqrt(-2 * log(unit(bits)));
}

double draw_normal(uint64_t key) {
    uint64_t a = draw_mix(key), b = draw_mix(key ^ 0xa0761d6478bd642fu);
    return radius(a) * cos(TWO_PI * unit(b));
}

void draw_normals(uint64_t key, double *z, int n) {
    uint64_t counter = draw_mix(key);
    for (int i = 0; i < n; i += 2) {
        counter += 0x9e3779b97f4a7c15u;
        double r = radius(draw_mix(counter)), sine, cosine;
        counter += 0x9e3779b97f4a7c15u;
        sincos(TWO_PI * unit(draw_mix(counter)), &sine, &cosine);
        z[i] = r * cosine;
        if (i + 1 < n)
            z[i + 1] = r * sine;
    }
}

/*
 * Levy's construction: the value at the far end first, then midpoints of ever shorter bridges, each drawn
 * from its own node of the tree. 2^26 s is two years; below 1 ms the path is taken as straight.
 */
double draw_brownian(uint64_t key, double t_s) {
    double left = 0, span = 0x1p26, at_left = 0, at_right = sqrt(span) * draw_normal(draw_fold(key, 0));
    for (uint64_t node = 1; span > 0x1p-10; span /= 2) {
        double middle = (at_left + at_right) / 2 + sqrt(span / 4) * draw_normal(draw_fold(key, node));
        bool right = t_s >= left + span / 2;
        if (right) {
            left += span / 2;
            at_left = middle;
        } else {
            at_right = middle;
        }
        node = 2 * node + right;
    }
    return at_left + (at_right - at_left) * (t_s - left) / span;
}
