/*
 * roughness.h — everything in the model of Oren and Nayar that depends on sigma alone.
 *
 * x = sigma^2 / (sigma^2 + a) with its derivative by sigma, for a = 0.33 (C1), 0.09 (C2, C3), 0.13 (interreflection).
 * Domain     sigma > 0; its square may be 0 or infinite.
 * Source     reflection-model.md 1.2, 1.6.
 * Checked    tests/unit/test_reflectance.c
 */
#ifndef FIT_ROUGHNESS_H
#define FIT_ROUGHNESS_H

struct saturation {
    double value, slope;
};

struct roughness {
    struct saturation h, k, j;
};

static inline struct saturation roughness_saturation(double sigma, double a) {
    double s2 = sigma * sigma, sum = s2 + a;
    return (struct saturation){1 / (1 + a / s2), 2 * sigma * (a / sum) / sum};
}

static inline struct roughness roughness_of(double sigma) {
    return (struct roughness){roughness_saturation(sigma, 0.33), roughness_saturation(sigma, 0.09),
                              roughness_saturation(sigma, 0.13)};
}

#endif
