/*
 * noise_law.h — how the variance of a reading runs with the radiance factor: u^2 = a + c beta^2.
 *
 * By least squares of relative deviations over the readings of one set. It carries u from the noisy value to the model's,
 * since weights from the noisy data themselves bias low (reflection-model.md 3.7).
 * Checked    tests/unit/test_fit_parts.c
 */
#ifndef FIT_NOISE_LAW_H
#define FIT_NOISE_LAW_H

#ifdef __cplusplus
extern "C" {
#endif

struct noise_law { /* zero at first */
    double s00, s01, s11, t0, t1;
    double a, c;
};

void noise_law_add(struct noise_law *law, double u, double beta);
/* a and c; where the readings do not follow such a law, a = 1 and c = 0: u is then kept as it is. */
void noise_law_solve(struct noise_law *law);
/* Factor on u^2 of a reading seen at `seen` where the model says `fitted`. A deviation of many u is not noise: the model
 * misses the reading, and its noise is as it was seen. */
double noise_law_carry(const struct noise_law *law, double u, double seen, double fitted);

#ifdef __cplusplus
}
#endif

#endif
