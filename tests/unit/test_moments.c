#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "fit/dice.h"
#include "fit/moments.h"
#include "tests/support/seed.h"

#define SEED 20261122
enum { N = 53, BANDS_MAX = 19, FUNCTIONS = 10, ROOM = 56 };

static double f[FUNCTIONS * N], weight[BANDS_MAX * N], row[N * ROOM];

static void draw(struct dice *d) {
    for (size_t i = 0; i < FUNCTIONS * N; i++) {
        f[i] = dice_normal(d);
    }
    for (size_t i = 0; i < BANDS_MAX * N; i++) {
        weight[i] = dice_uniform(d);
    }
}

/* Any number of bands and functions, by every width this processor has: the same bits, and the plain sums. */
static void products_are_summed_for_every_band(void **state) {
    (void)state;
    static double sum[REFLECTANCE_WIDTHS][BANDS_MAX * ROOM];
    struct dice d = {test_seed(SEED)};
    for (int functions = 1; functions <= FUNCTIONS; functions++) {
        const size_t bands = 1 + (size_t)(functions * 7) % BANDS_MAX, columns = moments_products(functions);
        draw(&d);
        moments_lay_products(f, N, functions, row);
        for (int w = 0; w <= (int)reflectance_batch_width(); w++) {
            memset(sum[w], 0xff, sizeof sum[w]); /* not added to */
            moments_take((enum reflectance_width)w, weight, N, bands, row, columns, sum[w]);
            assert_memory_equal(sum[w], sum[0], bands * moments_room(columns) * sizeof(double));
        }
        for (size_t band = 0; band < bands; band++) {
            for (int a = 0; a < functions; a++) {
                for (int b = 0; b < functions; b++) {
                    double plain = 0;
                    for (int i = 0; i < N; i++) {
                        plain += weight[band * N + (size_t)i] * f[a * N + i] * f[b * N + i];
                    }
                    assert_float_equal(sum[0][band * moments_room(columns) + (size_t)moments_at(a, b)], plain,
                                       1e-12);
                }
            }
        }
    }
}

static void functions_are_summed_for_every_band(void **state) {
    (void)state;
    double sum[BANDS_MAX * ROOM];
    struct dice d = {test_seed(SEED)};
    draw(&d);
    moments_lay(f, N, 3, row);
    moments_take(reflectance_batch_width(), weight, N, BANDS_MAX, row, 3, sum);
    for (size_t band = 0; band < BANDS_MAX; band++) {
        for (int a = 0; a < 3; a++) {
            double plain = 0;
            for (int i = 0; i < N; i++) {
                plain += weight[band * N + (size_t)i] * f[a * N + i];
            }
            assert_float_equal(sum[band * moments_room(3) + (size_t)a], plain, 1e-12);
        }
    }
}

static void residuals_are_those_of_the_band(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    double got[REFLECTANCE_WIDTHS][N], value[N], sum[REFLECTANCE_WIDTHS];
    const double s = 0.3, t = 1.1;
    draw(&d);
    for (int i = 0; i < N; i++) {
        value[i] = dice_normal(&d);
    }
    for (int w = 0; w <= (int)reflectance_batch_width(); w++) {
        sum[w] = moments_residuals((enum reflectance_width)w, f, N, s, t, value, weight, got[w]);
        assert_memory_equal(got[w], got[0], sizeof got[0]);
        assert_true(sum[w] == sum[0]);
    }
    double plain = 0;
    for (int i = 0; i < N; i++) {
        const double r = s * f[i] + s * s * f[N + i] + t * f[2 * N + i] - value[i];
        assert_float_equal(got[0][i], weight[i] * r, 1e-14);
        plain += weight[i] * r * r;
    }
    assert_float_equal(sum[0], plain, 1e-12 * plain);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(products_are_summed_for_every_band),
        cmocka_unit_test(functions_are_summed_for_every_band),
        cmocka_unit_test(residuals_are_those_of_the_band),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
