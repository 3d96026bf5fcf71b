#include "fit/noise_law.h"

#include <math.h>
#include <stdbool.h>

#define MISSED_U 4 /* beyond this many u a deviation is no noise */

void noise_law_add(struct noise_law *law, double u, double beta) {
    double w = 1 / (u * u), b2 = beta * beta * w;
    law->s00 += w * w;
    law->s01 += w * b2;
    law->s11 += b2 * b2;
    law->t0 += w;
    law->t1 += b2;
}

void noise_law_solve(struct noise_law *law) {
    double det = law->s00 * law->s11 - law->s01 * law->s01;
    bool solvable = det > 1e-12 * law->s00 * law->s11;
    law->a = solvable ? (law->t0 * law->s11 - law->t1 * law->s01) / det : 1;
    law->c = solvable ? (law->t1 * law->s00 - law->t0 * law->s01) / det : 0;
    if (law->a <= 0 || law->c < 0) {
        law->a = 1;
        law->c = 0;
    }
}

double noise_law_carry(const struct noise_law *law, double u, double seen, double fitted) {
    return fabs(fitted - seen) > MISSED_U * u
               ? 1
               : (law->a + law->c * fitted * fitted) / (law->a + law->c * seen * seen);
}
