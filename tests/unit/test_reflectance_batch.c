#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit/lobe.h"
#include "fit/reflectance_wide.h"

#define COUNT(array) (sizeof(array) / sizeof *(array))
#define N 203 /* no multiple of the lanes */
#define ROOM 208

static const struct reflectance_optics optics = {.kappa = 1.3, .q = 1.7, .polarisation = 0.2};
static struct reflectance_geometry geometry[N];
static struct reflectance_batch batch;
static double memory[(ROOM + 16) * REFLECTANCE_BATCH_COLUMNS];

/* S, sigma, gamma, beta', n and both extras by model, as ordinary as they come and as extreme */
static const double sets[][5] = {{0.1, 0.35, 0.05, 126, 1.4},      {0.3, 0.01, 0.01, 1, 1 + 1e-8},
                                 {1.2, 0.5, 0.2, 15.7, 1.3},       {0.01, 1e-4, 0.002, 1.6, 2.42},
                                 {0.8, 1.0, 1.0, 0.01, 1 + 1e-12}, {1, 1e8, 1e3, 1e12, 10},
                                 {0.5, 1e-8, 1e-6, 1e6, 1.0001}};
static const double extras[REFLECTANCE_MODELS][3][2] = {
    [REFLECTANCE_HEAVY_TAIL] = {{0}, {0.7}, {2}},
    [REFLECTANCE_TRANSMITTED] = {{1.01}, {1.5}, {3}},
    [REFLECTANCE_TWO_LOBE] = {{0.3, 0.5}, {0.02, 40}, {1, 0}},
};

static void value_of(enum reflectance_model model, size_t set, size_t extra, double *value) {
    memset(value, 0, MATERIAL_PARAMETERS * sizeof *value);
    memcpy(value, sets[set], sizeof sets[set]);
    value[MATERIAL_EXTRA_1] = extras[model][extra][0];
    value[MATERIAL_EXTRA_2] = extras[model][extra][1];
}

/* Every pair of the extreme angles, in plane and across it. */
static int make_batch(void **state) {
    (void)state;
    static const double angles_deg[] = {0, 1e-9, 1e-3, 1, 20, 44.9, 45.1, 60, 75, 88, 90 - 1e-3, 90 - 1e-9};
    static const double turns_deg[] = {0, 180, 1e-6, 60, 90, 179};
    for (size_t i = 0; i < N; i++) {
        reflectance_geometry_general(&geometry[i], angles_deg[i % 12], angles_deg[i / 12 % 12],
                                     turns_deg[(i / 144 + i) % 6], NULL);
    }
    reflectance_batch_fill(&batch, N, geometry, memory);
    return 0;
}

static double log_lobe(enum reflectance_model model, const double *value, double phi_rad) {
    struct lobe_tail tail = lobe_tail_of(model == REFLECTANCE_HEAVY_TAIL ? value[MATERIAL_EXTRA_1] : 0);
    double narrow = log(lobe_tailed(&tail, phi_rad, value[MATERIAL_GAMMA]).value);
    return model == REFLECTANCE_TWO_LOBE
               ? fmin(narrow, log(lobe_gaussian(phi_rad, value[MATERIAL_EXTRA_1]).value))
               : narrow;
}

struct size { /* what an error is judged against: the sum of absolute terms */
    double beta, slope[MATERIAL_PARAMETERS];
};

static struct size size_of(enum reflectance_model model, const struct reflectance_geometry *g,
                           const double *value) {
    struct reflectance_parts parts;
    double row[MATERIAL_PARAMETERS] = {0}, l1, l2, beta;
    struct size size = {0};
    reflectance_eval_parts(model, g, value, &optics, &parts, NULL);
    reflectance_eval(model, 1, g, value, &optics, &beta, row, NULL);
    reflectance_diffuse_factors(g, value[MATERIAL_SIGMA], &l1, &l2);
    double terms = 1.5 + fabs(l1) + fabs(g->direct);
    double diffuse = value[MATERIAL_S] * terms + parts.interreflection;
    size.beta = diffuse + parts.specular;
    for (int j = 0; j < reflectance_parameters(model); j++) {
        enum material_parameter p = reflectance_parameter(model, j);
        size.slope[p] = fabs(row[j]);
    }
    size.slope[MATERIAL_S] = terms + 2 * parts.interreflection / value[MATERIAL_S];
    size.slope[MATERIAL_SIGMA] *= 1 + 2 * terms;
    if (model == REFLECTANCE_TRANSMITTED) {
        size.slope[MATERIAL_EXTRA_1] += diffuse / (value[MATERIAL_EXTRA_1] - 1);
    }
    return size;
}

static void compare(enum reflectance_model model, const double *value, size_t i, double got, double plain,
                    double size, const char *what) {
    double log_d =
        reflectance_column(model, MATERIAL_GAMMA) >= 0 ? log_lobe(model, value, geometry[i].phi_rad) : 0;
    double allowed = 4e-15 * (1 + 2 * fabs(log_d)) * size;
    if (log_d > -700 && !(fabs(got - plain) <= allowed)) {
        fail_msg("%s, point %zu, %s: %.17g, plainly %.17g, apart %.3g, allowed %.3g", reflectance_name(model),
                 i, what, got, plain, fabs(got - plain), allowed);
    }
    assert_false(isnan(got));
}

static void check_against_plain(enum reflectance_model model, const double *value) {
    static double beta[ROOM], slope[MATERIAL_PARAMETERS * ROOM], plain[N], row[N * MATERIAL_PARAMETERS];
    int k = reflectance_parameters(model);
    assert_int_equal(reflectance_batch_eval(&batch, 0, N, model, value, &optics, beta, slope, ROOM, NULL), 0);
    assert_int_equal(reflectance_eval(model, N, geometry, value, &optics, plain, row, NULL), 0);
    for (size_t i = 0; i < N; i++) {
        struct size size = size_of(model, &geometry[i], value);
        compare(model, value, i, beta[i], plain[i], size.beta, "beta");
        for (int j = 0; j < k; j++) {
            enum material_parameter p = reflectance_parameter(model, j);
            compare(model, value, i, slope[(size_t)j * ROOM + i], row[i * (size_t)k + (size_t)j],
                    fmax(size.slope[p], 1e-300), material_parameter_name(reflectance_name(model), (int)p));
        }
    }
}

static void each_case(void (*check)(enum reflectance_model model, const double *value)) {
    for (int m = 0; m < REFLECTANCE_MODELS; m++) {
        for (size_t set = 0; set < COUNT(sets); set++) {
            for (size_t extra = 0; extra < 3; extra++) {
                double value[MATERIAL_PARAMETERS];
                value_of((enum reflectance_model)m, set, extra, value);
                check((enum reflectance_model)m, value);
            }
        }
    }
}

static void agrees_with_the_plain_model(void **state) {
    (void)state;
    each_case(check_against_plain);
}

/* Whatever the width, and wherever a point stands in a call. */
static void check_bits(enum reflectance_model model, const double *value) {
    static double beta[ROOM], slope[MATERIAL_PARAMETERS * ROOM], other[ROOM],
        other_slope[MATERIAL_PARAMETERS * ROOM];
    size_t k = (size_t)reflectance_parameters(model);
    reflectance_batch_eval_with(REFLECTANCE_SSE2, &batch, 0, N, model, value, &optics, beta, slope, ROOM,
                                NULL);
    for (int width = REFLECTANCE_SSE2; width <= (int)reflectance_batch_width(); width++) {
        for (size_t first = 0; first < N; first += 41) {
            size_t n = (N - first) / (1 + first % 3);
            reflectance_batch_eval_with((enum reflectance_width)width, &batch, first, n, model, value,
                                        &optics, other, other_slope, ROOM, NULL);
            assert_memory_equal(other, beta + first, n * sizeof *other);
            for (size_t j = 0; j < k; j++) {
                assert_memory_equal(other_slope + j * ROOM, slope + j * ROOM + first, n * sizeof *other);
            }
        }
    }
}

static void every_width_gives_the_same_bits(void **state) {
    (void)state;
    printf("# widest: %d (0 SSE2, 1 AVX2, 2 AVX-512)\n", reflectance_batch_width());
    each_case(check_bits);
}

static void single_points_and_none(void **state) {
    (void)state;
    double value[MATERIAL_PARAMETERS], all[ROOM], all_slope[8 * ROOM], beta[8], slope[8 * 8];
    value_of(REFLECTANCE_COMPOSITE, 0, 0, value);
    reflectance_batch_eval(&batch, 0, N, REFLECTANCE_COMPOSITE, value, &optics, all, all_slope, ROOM, NULL);
    for (size_t i = 0; i < N; i++) {
        reflectance_batch_eval(&batch, i, 1, REFLECTANCE_COMPOSITE, value, &optics, beta, slope, 8, NULL);
        assert_true(beta[0] == all[i] && slope[2 * 8] == all_slope[2 * ROOM + i]);
    }
    beta[0] = 7;
    assert_int_equal(
        reflectance_batch_eval(&batch, 0, 0, REFLECTANCE_COMPOSITE, value, &optics, beta, slope, 8, NULL), 0);
    assert_true(beta[0] == 7);
}

static void outside_the_domain_is_an_error(void **state) {
    (void)state;
    double value[MATERIAL_PARAMETERS], beta[8] = {7}, slope[8 * 8];
    struct err e = {0};
    value_of(REFLECTANCE_HEAVY_TAIL, 0, 1, value);
    value[MATERIAL_EXTRA_1] = NAN;
    assert_int_equal(
        reflectance_batch_eval(&batch, 0, 8, REFLECTANCE_HEAVY_TAIL, value, &optics, beta, slope, 8, &e),
        -ERR_RANGE);
    assert_non_null(strstr(e.text, "tail"));
    assert_true(beta[0] == 7);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(agrees_with_the_plain_model),
        cmocka_unit_test(every_width_gives_the_same_bits),
        cmocka_unit_test(single_points_and_none),
        cmocka_unit_test(outside_the_domain_is_an_error),
    };
    return cmocka_run_group_tests(tests, make_batch, NULL);
}
