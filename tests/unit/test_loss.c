#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "fit/estimate.h"
#include "fit/loss.h"
#include "tests/support/goniometry.h"
#include "tests/support/seed.h"

#define SEED 20261123
#define FITS 100

static struct goniometry m; /* large: static */

static void fit(enum material_loss loss, struct estimate *estimate) {
    struct err e = {0};
    m.input.loss = loss;
    if (estimate_fit(&m.input, estimate, &e)) {
        fail_msg("%s", e.text);
    }
    if (!estimate->converged) {
        fail_msg("%s: refused: %s", material_loss_name(loss), estimate->refusal);
    }
}

static void transforms_by_hand(void **state) {
    (void)state;
    double slope;
    assert_float_equal(loss_value(MATERIAL_LOSS_LOG, 2, &slope), log(2), 1e-15);
    assert_float_equal(slope, 0.5, 1e-15);
    assert_float_equal(loss_value(MATERIAL_LOSS_CUBEROOT, 8, &slope), 2, 1e-15);
    assert_float_equal(slope, 1 / 12.0, 1e-15);
    assert_float_equal(loss_value(MATERIAL_LOSS_COSINE, -3, &slope), -3, 0);
    assert_float_equal(loss_weight(MATERIAL_LOSS_COSINE, 60, 9), 0.5, 1e-15);
    assert_float_equal(loss_weight(MATERIAL_LOSS_ML, 60, 0.25), 4, 0);
    assert_float_equal(loss_weight(MATERIAL_LOSS_LOG, 60, 0.25), 1, 0);
}

/* Dark and negative values have a loss: it rises with beta everywhere, and neither it nor its slope jumps. */
static void values_below_zero_have_a_loss(void **state) {
    (void)state;
    static const enum material_loss bent[] = {MATERIAL_LOSS_LOG, MATERIAL_LOSS_CUBEROOT};
    for (int k = 0; k < 2; k++) {
        double before = -INFINITY, slope, slope_below, slope_above;
        for (double beta = -1; beta < 1; beta += 1e-3) {
            double value = loss_value(bent[k], beta, &slope);
            assert_true(isfinite(value) && value > before && slope > 0);
            before = value;
        }
        double below = loss_value(bent[k], 0.005 - 1e-12, &slope_below);
        double above = loss_value(bent[k], 0.005 + 1e-12, &slope_above);
        assert_true(fabs(above - below - 2e-12 * slope_above) < 1e-14);
        assert_float_equal(slope_below / slope_above, 1, 1e-8);
    }
}

static void each_loss_is_least_where_it_is_minimised(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    for (int set = 0; set < GONIOMETRY_SETS; set++) {
        struct estimate of[MATERIAL_LOSSES];
        goniometry_make(&m, goniometry_set[set], 60, 5);
        goniometry_noise(&m, &d);
        m.beta[7] = -0.002; /* stays in every fit */
        m.u[7] = 0.1;
        for (int k = 0; k < MATERIAL_LOSSES; k++) {
            fit((enum material_loss)k, &of[k]);
            assert_int_equal(of[k].minimised, k);
        }
        for (int k = 0; k < MATERIAL_LOSSES; k++) {
            for (int other = 0; other < MATERIAL_LOSSES && k != MATERIAL_LOSS_ML; other++) {
                /* ml's own weights follow the model, which each fit has its own: not compared */
                assert_true(of[k].loss[k] <= of[other].loss[k] * (1 + 1e-9));
            }
        }
    }
}

/* The stated u is that of the points, carried through each loss's own weights: pulls of unit spread for all of them. */
static void uncertainty_covers_with_every_loss(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    for (int k = 0; k < MATERIAL_LOSSES; k++) {
        double square[5] = {0}, sum[5] = {0};
        goniometry_make(&m, goniometry_set[2], 60, 5);
        for (int run = 0; run < FITS; run++) {
            struct estimate estimate;
            goniometry_noise(&m, &d);
            fit((enum material_loss)k, &estimate);
            for (int j = 0; j < 5; j++) {
                double pull = (estimate.value[j] - m.value[j]) / sqrt(estimate.statistical[j][j]);
                square[j] += pull * pull / FITS;
                sum[j] += pull / FITS;
            }
        }
        for (int j = 0; j < 5; j++) {
            print_message("# %s, parameter %d: mean pull %+.2f, spread %.2f of stated u\n",
                          material_loss_name((enum material_loss)k), j, sum[j], sqrt(square[j]));
            /* of 100 fits a spread is known to 7 %, a mean to 0.1 */
            assert_true(sqrt(square[j]) > 0.72 && sqrt(square[j]) < 1.28 && fabs(sum[j]) < 0.45);
        }
    }
}

static void a_loss_survives_json(void **state) {
    (void)state;
    struct dice d = {test_seed(SEED)};
    struct estimate estimate, back;
    struct err e = {0};
    goniometry_make(&m, goniometry_set[1], 60, 5);
    goniometry_noise(&m, &d);
    fit(MATERIAL_LOSS_CUBEROOT, &estimate);
    json_t *json = estimate_to_json(&estimate);
    assert_string_equal(json_string_value(json_object_get(json, "loss")), "cuberoot");
    assert_int_equal(json_object_size(json_object_get(json, "losses")), MATERIAL_LOSSES);
    assert_int_equal(estimate_from_json(json, &back, &e), 0);
    assert_int_equal(back.minimised, MATERIAL_LOSS_CUBEROOT);
    assert_memory_equal(back.loss, estimate.loss, sizeof back.loss);
    json_object_del(json, "loss");
    json_object_del(json, "losses");
    assert_int_equal(estimate_from_json(json, &back, &e), 0); /* stored before there were any */
    assert_true(back.minimised == MATERIAL_LOSS_ML && isnan(back.loss[MATERIAL_LOSS_OLS]));
    json_decref(json);
}

static void names_are_known(void **state) {
    (void)state;
    enum material_loss loss;
    struct err e = {0};
    for (int k = 0; k < MATERIAL_LOSSES; k++) {
        assert_int_equal(loss_find(material_loss_name((enum material_loss)k), &loss, &e), 0);
        assert_int_equal(loss, k);
    }
    assert_int_equal(loss_find("huber", &loss, &e), -ERR_USAGE);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(transforms_by_hand),
        cmocka_unit_test(values_below_zero_have_a_loss),
        cmocka_unit_test(each_loss_is_least_where_it_is_minimised),
        cmocka_unit_test(uncertainty_covers_with_every_loss),
        cmocka_unit_test(a_loss_survives_json),
        cmocka_unit_test(names_are_known),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
