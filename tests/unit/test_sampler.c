#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/sampler.h"

static void the_place_alone_decides(void **state) {
    (void)state;
    struct sampler a, b;
    double u[2], w[2];
    sampler_start(&a, 1, 77, 5);
    sampler_2d(&a, u);
    for (int i = 0; i < 100; i++) {
        sampler_start(&b, 1, (uint32_t)(i % 7), (uint32_t)i);
        sampler_2d(&b, w);
    }
    sampler_start(&b, 1, 77, 5);
    sampler_2d(&b, w);
    assert_memory_equal(u, w, sizeof u);
    assert_true(sampler_1d(&a) == sampler_1d(&b));
    for (uint32_t k = 0; k < 3; k++) { /* each of the three places counts */
        sampler_start(&b, 1 + (k == 0), 77 + (k == 1), 5 + (k == 2));
        sampler_2d(&b, w);
        assert_true(u[0] != w[0] && u[1] != w[1]);
    }
}

/* 2^m samples: one in each of the 2^m boxes of every shape 2^-i x 2^(i-m), in every pair of every pixel. */
static void samples_of_a_pixel_are_a_net(void **state) {
    (void)state;
    for (uint32_t pixel = 0; pixel < 20; pixel++)
        for (int pair = 0; pair < 3; pair++)
            for (int wide = 0; wide <= 6; wide++) {
                uint8_t box[64] = {0};
                for (uint32_t i = 0; i < 64; i++) {
                    struct sampler s;
                    double u[2];
                    sampler_start(&s, 9, pixel, i);
                    for (int k = 0; k <= pair; k++)
                        sampler_2d(&s, u);
                    assert_true(u[0] > 0 && u[0] < 1 && u[1] > 0 && u[1] < 1);
                    box[((int)(u[0] * (1 << wide)) << (6 - wide)) + (int)(u[1] * (64 >> wide))]++;
                }
                for (int i = 0; i < 64; i++)
                    assert_int_equal(box[i], 1);
            }
}

/* Two numbers of different pairs, pixels, seeds: their correlation over many is that of independent ones. */
static void pairs_pixels_and_seeds_are_independent(void **state) {
    (void)state;
    enum { N = 40000, KINDS = 4 };
    double product[KINDS] = {0}, mean = 0, square = 0;
    for (uint32_t i = 0; i < N; i++) {
        struct sampler s, pixel, seed;
        double u[2], next[2], other[2], third[2];
        sampler_start(&s, 3, i / 16, i % 16);
        sampler_start(&pixel, 3, i / 16 + 1, i % 16);
        sampler_start(&seed, 4, i / 16, i % 16);
        sampler_2d(&s, u);
        sampler_2d(&s, next);
        sampler_2d(&pixel, other);
        sampler_2d(&seed, third);
        double v[KINDS] = {u[1], next[0], other[0], third[0]};
        for (int k = 0; k < KINDS; k++)
            product[k] += 12 * (u[0] - 0.5) * (v[k] - 0.5) / N;
        mean += u[0] / N;
        square += u[0] * u[0] / N;
    }
    assert_true(fabs(mean - 0.5) < 1e-3 && fabs(square - 1.0 / 3) < 1e-3);
    for (int k = 0; k < KINDS; k++)
        if (!(fabs(product[k]) < 5 / sqrt(N)))
            fail_msg("correlation %d is %g", k, product[k]);
}

/* Root of the mean square error of the mean of exp(u + 2 w) over n samples; four numbers when deep. */
static double error_of(uint32_t n, bool deep) {
    double sum = 0, exact = (M_E - 1) * (M_E * M_E - 1) / 2;
    for (uint32_t pixel = 0; pixel < 400; pixel++) {
        double mean = 0;
        for (uint32_t i = 0; i < n; i++) {
            struct sampler s;
            double u[2], w[2];
            sampler_start(&s, 5, pixel, i);
            sampler_2d(&s, u);
            sampler_2d(&s, w);
            mean += exp(u[0] + 2 * (deep ? w[0] : u[1])) / n;
        }
        sum += (mean - exact) * (mean - exact);
    }
    return sqrt(sum / 400);
}

static void means_converge_faster_than_random_ones(void **state) {
    (void)state;
    double few = error_of(16, false), many = error_of(256, false), slope = log(many / few) / log(16);
    if (!(slope < -1.2))
        fail_msg("slope %g of the error in a pair: %g, %g", slope, few, many);
    few = error_of(16, true);
    many = error_of(1024, true);
    slope = log(many / few) / log(64);
    if (!(slope < -0.45))
        fail_msg("slope %g of the error over two pairs: %g, %g", slope, few, many);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_place_alone_decides),
        cmocka_unit_test(samples_of_a_pixel_are_a_net),
        cmocka_unit_test(pairs_pixels_and_seeds_are_independent),
        cmocka_unit_test(means_converge_faster_than_random_ones),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
