#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/cie.h"
#include "fit/render/colour.h"
#include "fit/render/encode.h"
#include "fit/render/spd.h"

static struct spd spd_of(const char *name) {
    struct spd spd;
    struct err e = {0};
    struct err_list errors = {0};
    if (spd_find(&spd, name, ".", &errors, &e))
        fail_msg("%s", e.text);
    return spd;
}

static void the_tables_have_the_published_sums(void **state) {
    (void)state;
    double y2 = 0;
    for (int k = 0; k < BANDS; k++)
        y2 += cie_2deg[k][1];
    assert_true(fabs(y2 - 21.371328) < 5e-7);
}

/* Sums over 380..780 nm at 5 nm. */
static void white_points(void **state) {
    (void)state;
    static const struct {
        const char *name;
        enum colour_observer observer;
        double x, y;
    } cases[] = {
        {"A", COLOUR_2DEG, .44758, .40745},    {"D65", COLOUR_2DEG, .31272, .32903},
        {"D50", COLOUR_2DEG, .34567, .35851},  {"F2", COLOUR_2DEG, .37207, .37512},
        {"F11", COLOUR_2DEG, .38054, .37692},  {"A", COLOUR_10DEG, .45117, .40594},
        {"D65", COLOUR_10DEG, .31381, .33098}, {"D50", COLOUR_10DEG, .34773, .35952},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct spd spd = spd_of(cases[i].name);
        double white[3];
        assert_int_equal(colour_white(spd.power, cases[i].observer, white, NULL), 0);
        double sum = white[0] + white[1] + white[2];
        assert_true(fabs(white[1] - 1) < 1e-15);
        assert_true(fabs(white[0] / sum - cases[i].x) < 5.5e-6 && fabs(white[1] / sum - cases[i].y) < 5.5e-6);
    }
}

/* A daylight of D65's temperature is D65, up to the rounding of its table. */
static void daylight_at_d65_is_d65(void **state) {
    (void)state;
    struct spd made, table = spd_of("D65");
    struct err_list errors = {0};
    struct err e = {0};
    assert_int_equal(spd_daylight(&made, 6500 * 1.4388 / 1.4380, NULL), 0);
    for (int k = 0; k < BANDS; k++)
        assert_true(fabs(made.power[k] - table.power[k]) < 8.5e-4);
    struct spd named = spd_of("6503.6 K");
    assert_true(fabs(named.power[10] - made.power[10]) < 0.01);
    assert_int_equal(spd_find(&made, "2700 K", ".", &errors, &e), -ERR_INPUT);
    assert_non_null(strstr(e.text, "4000 to 25000 K"));
    err_clear(&e);
    assert_int_equal(spd_find(&made, "D66", ".", &errors, &e), -ERR_INPUT);
    assert_int_equal(errors.n, 0);
}

static void a_lamp_that_no_eye_sees_is_refused(void **state) {
    (void)state;
    double dark[BANDS] = {0}, s[BANDS] = {0};
    struct colour_matrix m;
    struct err e = {0};
    assert_int_equal(colour_collapse(s, dark, COLOUR_2DEG, &m, &e), -ERR_RANGE);
    dark[36] = 1; /* one line */
    assert_int_equal(colour_collapse(s, dark, COLOUR_2DEG, &m, NULL), 0);
    assert_true(fabs(m.m[1][2] - 1) < 1e-15);
}

/* The matrix against the 81 terms, within 1e-12 of the sum of their absolute values; seeded, 2,000 draws. */
static void the_collapse_is_the_sum(void **state) {
    (void)state;
    struct spd spd = spd_of("F11");
    unsigned short dice[3] = {1, 2, 3};
    for (int draw = 0; draw < 2000; draw++) {
        double s[BANDS], radiance[BANDS], abc[3] = {erand48(dice), erand48(dice), 10 * erand48(dice)};
        double exposure = 0, sum[3], collapsed[3], size[3] = {0};
        struct colour_matrix m;
        for (int k = 0; k < BANDS; k++) {
            s[k] = 1.2 * erand48(dice);
            exposure += spd.power[k] * cie_2deg[k][1];
        }
        for (int k = 0; k < BANDS; k++) {
            radiance[k] = spd.power[k] / exposure * (abc[0] * s[k] + abc[1] * s[k] * s[k] + abc[2]);
            for (int i = 0; i < 3; i++)
                size[i] += fabs(radiance[k] * cie_2deg[k][i]);
        }
        assert_int_equal(colour_collapse(s, spd.power, COLOUR_2DEG, &m, NULL), 0);
        colour_apply(&m, abc, collapsed);
        colour_sum(radiance, COLOUR_2DEG, sum);
        for (int i = 0; i < 3; i++)
            if (!(fabs(collapsed[i] - sum[i]) <= 1e-12 * size[i]))
                fail_msg("draw %d, channel %d: %.17g, summed %.17g", draw, i, collapsed[i], sum[i]);
    }
}

static void adaptation_takes_white_to_white(void **state) {
    (void)state;
    double from[3] = {1.0985, 1, 0.3558}, to[3], got[3];
    colour_space_white(COLOUR_SRGB, to);
    for (int a = COLOUR_VON_KRIES; a < COLOUR_ADAPTATIONS; a++) {
        struct colour_matrix m = colour_adapt((enum colour_adaptation)a, from, to);
        colour_apply(&m, from, got);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(got[i] - to[i]) < 1e-14);
    }
    struct colour_matrix none = colour_adapt(COLOUR_NONE, from, to);
    colour_apply(&none, from, got);
    assert_memory_equal(got, from, sizeof got);
}

/* IEC 61966-2-1 prints its matrix with four decimals. */
static void the_srgb_matrix_is_the_published_one(void **state) {
    (void)state;
    static const double published[3][3] = {
        {3.2406, -1.5372, -0.4986}, {-0.9689, 1.8758, 0.0415}, {0.0557, -0.2040, 1.0570}};
    struct colour_matrix m = colour_from_xyz(COLOUR_SRGB);
    double white[3], rgb[3];
    for (int i = 0; i < 9; i++)
        assert_true(fabs(m.m[i / 3][i % 3] - published[i / 3][i % 3]) < 5e-4);
    for (int space = 0; space < COLOUR_SPACES; space++) {
        m = colour_from_xyz((enum colour_space)space);
        colour_space_white((enum colour_space)space, white);
        colour_apply(&m, white, rgb);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(rgb[i] - 1) < 1e-14);
    }
}

static double by_curve(const struct colour_curve *c, double v) {
    return v <= c->low ? c->gain * v : c->scale * pow(v, 1 / c->gamma) - c->offset;
}

static void codes_are_the_nearest(void **state) {
    (void)state;
    unsigned short dice[3] = {4, 5, 6};
    for (int space = 0; space < COLOUR_SPACES; space++) {
        const struct colour_curve *curve = colour_curve((enum colour_space)space);
        for (int bits = 8; bits <= 16; bits += 8) {
            struct encode encode;
            assert_int_equal(encode_make(&encode, curve, bits, NULL), 0);
            for (int draw = 0; draw < 100000; draw++) {
                double v = draw % 2 ? erand48(dice) : pow(10, -8 * erand48(dice));
                double exact = by_curve(curve, v) * encode.top;
                if (!(fabs(encode_code(&encode, v) - exact) <= 0.5 + 1e-6))
                    fail_msg("space %d, %d bits: %.17g is code %d, exactly %.9g", space, bits, v,
                             encode_code(&encode, v), exact);
            }
            assert_int_equal(encode_code(&encode, NAN), 0);
            assert_int_equal(encode_code(&encode, -1), 0);
            assert_int_equal(encode_code(&encode, 1), encode.top);
            assert_int_equal(encode_code(&encode, INFINITY), encode.top);
            encode_free(&encode);
        }
    }
}

static void lab_of_white_and_black(void **state) {
    (void)state;
    double white[3] = {.95, 1, 1.09}, lab[3], black[3] = {0};
    colour_lab(white, white, lab);
    assert_true(fabs(lab[0] - 100) < 1e-12 && fabs(lab[1]) < 1e-12 && fabs(lab[2]) < 1e-12);
    colour_lab(black, white, lab);
    assert_true(fabs(lab[0]) < 1e-12);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_tables_have_the_published_sums),
        cmocka_unit_test(white_points),
        cmocka_unit_test(daylight_at_d65_is_d65),
        cmocka_unit_test(a_lamp_that_no_eye_sees_is_refused),
        cmocka_unit_test(the_collapse_is_the_sum),
        cmocka_unit_test(adaptation_takes_white_to_white),
        cmocka_unit_test(the_srgb_matrix_is_the_published_one),
        cmocka_unit_test(codes_are_the_nearest),
        cmocka_unit_test(lab_of_white_and_black),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
