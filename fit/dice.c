#include "fit/dice.h"

#include <math.h>

double dice_uniform(struct dice *d) {
    uint64_t z = d->state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return (double)((z ^ z >> 31) >> 11) * 0x1p-53 + 0x1p-54;
}

double dice_normal(struct dice *d) {
    double radius = sqrt(-2 * log(dice_uniform(d)));
    return radius * cos(2 * M_PI * dice_uniform(d));
}
