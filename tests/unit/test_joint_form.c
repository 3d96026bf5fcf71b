#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "proto/joint.h"

/* Two shared parameters, three bands. */
static void make(struct joint *joint, bool per_band) {
    *joint = (struct joint){
        .model = "composite", .converged = true, .kappa = 1, .chi2 = 12.5, .chi2_expected = 11};
    joint->beta_prime_per_band = per_band;
    joint->n_points = 20;
    joint->n_values = 60;
    joint->n_bands = 3;
    joint->mirror_offset_deg = -0.1 / 3;
    joint->u_mirror_offset_deg = 0.01 / 3;
    joint->polarisation = 0.1 / 7;
    joint->u_polarisation = 0.01 / 7;
    for (int p = 0; p < MATERIAL_PARAMETERS; p++)
        joint->value[p] = p == MATERIAL_S || p > MATERIAL_N ? NAN : 0.1 + p / 7.0;
    joint->value[MATERIAL_BETA_PRIME] = per_band ? NAN : 3.3;
    joint->at_bound[MATERIAL_N] = true;
    for (int b = 0; b < BANDS; b++) {
        joint->s_lambda[b] = b < 3 ? 0.2 + b / 3.0 : NAN;
        joint->beta_prime[b] = b >= 3 ? NAN : per_band ? 3.0 + b / 9.0 : 3.3;
    }
    assert_int_equal(joint_allocate(joint, 5, NULL), 0);
    joint->row[0] = (struct joint_row){MATERIAL_SIGMA, -1};
    joint->row[1] = (struct joint_row){MATERIAL_GAMMA, -1};
    for (int b = 0; b < 3; b++)
        joint->row[2 + b] = (struct joint_row){per_band ? MATERIAL_BETA_PRIME : MATERIAL_S, b};
    for (int i = 0; i < 5; i++)
        for (int k = 0; k < 5; k++) {
            joint->statistical[i * 5 + k] = (i == k ? 4 : 1.0 / 3) * 1e-6;
            joint->common[i * 5 + k] = (i + 1) * (k + 1) * 1e-7;
        }
}

static void assert_same(const struct joint *a, const struct joint *b) {
    assert_string_equal(a->model, b->model);
    assert_true(a->converged == b->converged && a->misfit == b->misfit && a->kappa == b->kappa);
    assert_true(a->n_points == b->n_points && a->n_values == b->n_values && a->n_bands == b->n_bands);
    assert_true(a->chi2 == b->chi2 && a->chi2_expected == b->chi2_expected && a->n == b->n);
    assert_true(a->mirror_offset_deg == b->mirror_offset_deg && a->polarisation == b->polarisation);
    assert_true(a->u_mirror_offset_deg == b->u_mirror_offset_deg && a->u_polarisation == b->u_polarisation);
    assert_memory_equal(a->at_bound, b->at_bound, sizeof a->at_bound);
    for (int p = 0; p < MATERIAL_PARAMETERS; p++)
        assert_true(a->value[p] == b->value[p] || (isnan(a->value[p]) && isnan(b->value[p])));
    for (int k = 0; k < BANDS; k++) {
        assert_true(a->s_lambda[k] == b->s_lambda[k] || (isnan(a->s_lambda[k]) && isnan(b->s_lambda[k])));
        assert_true(a->beta_prime[k] == b->beta_prime[k] ||
                    (isnan(a->beta_prime[k]) && isnan(b->beta_prime[k])));
    }
    assert_memory_equal(a->row, b->row, (size_t)a->n * sizeof *a->row);
    assert_memory_equal(a->statistical, b->statistical, (size_t)(a->n * a->n) * sizeof(double));
    assert_memory_equal(a->common, b->common, (size_t)(a->n * a->n) * sizeof(double));
}

static void json_and_back_to_the_last_bit(void **state) {
    (void)state;
    for (int per_band = 0; per_band < 2; per_band++) {
        struct joint joint, back, copy;
        make(&joint, per_band);
        json_t *json = joint_to_json(&joint);
        char *text = json_dumps(json, JSON_COMPACT);
        json_t *again = json_loads(text, 0, NULL);
        assert_int_equal(joint_from_json(again, &back, NULL), 0);
        assert_same(&joint, &back);
        assert_int_equal(joint_copy(&copy, &back, NULL), 0);
        assert_same(&joint, &copy);
        joint_free(&copy);
        joint_free(&back);
        joint_free(&joint);
        free(text);
        json_decref(json);
        json_decref(again);
    }
}

static void u_is_the_total(void **state) {
    (void)state;
    struct joint joint;
    make(&joint, false);
    assert_int_equal(joint_row(&joint, MATERIAL_S, 1), 3);
    assert_int_equal(joint_row(&joint, MATERIAL_N, -1), -1);
    assert_float_equal(joint_u(&joint, MATERIAL_S, 1), sqrt(4e-6 + 16e-7), 1e-12);
    assert_true(isnan(joint_u(&joint, MATERIAL_S, 5)) && isnan(joint_u(&joint, MATERIAL_S, -1)));
    joint_free(&joint);
}

/* Each damage to a sound answer is refused with a sentence that names its key. */
static void damage_is_refused(void **state) {
    (void)state;
    static const struct {
        const char *key, *value;
    } damage[] = {{"model", "\"phong\""},         {"rows", "7"},
                  {"rows", "[[\"tail\"]]"},       {"rows", "[[\"S\", 9000]]"},
                  {"s_lambda", "[1, 2]"},         {"covariance_statistical", "[1]"},
                  {"covariance_common", "\"x\""}, {"covariance_common", "null"}};
    struct joint joint, back;
    make(&joint, false);
    for (size_t i = 0; i < sizeof damage / sizeof *damage; i++) {
        struct err e = {0};
        json_t *json = joint_to_json(&joint);
        json_object_set_new(json, damage[i].key, json_loads(damage[i].value, JSON_DECODE_ANY, NULL));
        assert_int_equal(joint_from_json(json, &back, &e), -ERR_INPUT);
        assert_non_null(strstr(e.text, damage[i].key));
        assert_null(back.statistical);
        json_decref(json);
    }
    joint_free(&joint);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(json_and_back_to_the_last_bit),
        cmocka_unit_test(u_is_the_total),
        cmocka_unit_test(damage_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
