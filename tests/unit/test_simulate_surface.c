/* The truth of a simulated sample as text, and a fitted estimate as a surface for the bench. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/simulate_surface.h"
#include "sim/sim.h"

static const int VISIBLE[2] = {400, 700};
static const struct aperture_form POINTS = {0}; /* source and sensor without width */

static void find(struct sim_surface *paint, struct simulate_surface *s) {
    assert_int_equal(sim_paint_find("Hooker's Green", "acrylic board", 0, paint, NULL), 0);
    *s = (struct simulate_surface){
        .sigma = paint->sigma, .gamma = paint->gamma, .beta_prime = paint->beta_prime, .n = paint->n};
    memcpy(s->s_lambda, paint->s_lambda, sizeof s->s_lambda);
}

/* S and q of the mean are enough for the mean of the bands (measurement.md 5). */
static void the_mean_is_that_of_the_bands(void **state) {
    static const double at[][2] = {{40, 38.5}, {10, -60}, {60, 60}, {-20, -15}, {0, 30}};
    struct sim_surface paint;
    struct simulate_surface s;
    (void)state;
    find(&paint, &s);
    for (size_t i = 0; i < sizeof at / sizeof *at; i++) {
        double sum = 0, sign = at[i][0] < 0 ? -1 : 1;
        for (int k = 0; k < BANDS; k++)
            if (band_nm(k) >= 400 && band_nm(k) <= 700)
                sum += sim_surface_beta(&paint, sign * at[i][0], sign * at[i][1], k) / 61;
        double mean = simulate_surface_mean(&s, &POINTS, at[i][0], at[i][1], VISIBLE);
        assert_true(fabs(mean - sum) <= 1e-13 * sum);
    }
}

/* Against a plain sum over the directions within both widths (fit/aperture.h). */
static void widths_blur_it(void **state) {
    enum { N = 60 };
    const struct aperture_form form = {1.5, 1, false};
    struct sim_surface paint;
    struct simulate_surface s;
    double sum = 0, weights = 0;
    (void)state;
    find(&paint, &s);
    for (int a = 0; a < N; a++)
        for (int b = 0; b < N; b++) {
            double i = 40 + form.source_width_deg * ((a + 0.5) / N - 0.5);
            double v = 40 + form.sensor_width_deg * ((b + 0.5) / N - 0.5);
            double weight = cos(i * M_PI / 180);
            sum += weight * simulate_surface_mean(&s, &POINTS, i, v, VISIBLE);
            weights += weight;
        }
    double sharp = simulate_surface_mean(&s, &POINTS, 40, 40, VISIBLE);
    double seen = simulate_surface_mean(&s, &form, 40, 40, VISIBLE);
    assert_true(fabs(seen - sum / weights) < 1e-5 * seen);
    assert_true(seen < sharp * (1 - 1e-4));
}

static void its_text_keeps_every_bit(void **state) {
    struct sim_surface paint;
    struct simulate_surface s, back;
    (void)state;
    find(&paint, &s);
    json_t *json = simulate_surface_to_json(&s, VISIBLE);
    char *text = json_dumps(json, JSON_COMPACT);
    json_t *read = json_loads(text, 0, NULL);
    assert_int_equal(simulate_surface_from_json(read, &back, NULL), 0);
    assert_true(back.sigma == s.sigma && back.gamma == s.gamma && back.n == s.n);
    assert_true(back.beta_prime == s.beta_prime);
    for (int k = 0; k < BANDS; k++)
        assert_true(back.s_lambda[k] == s.s_lambda[k]);
    assert_true(json_number_value(json_object_get(json, "q")) > 1);
    free(text);
    json_decref(read);
    json_decref(json);
}

static void a_text_without_its_spectrum_is_refused(void **state) {
    struct simulate_surface s;
    struct err e = {0};
    (void)state;
    json_t *json = json_loads("{\"sigma\":0.3,\"gamma\":0.05,\"beta_prime\":1,\"n\":1.4}", 0, NULL);
    assert_int_equal(simulate_surface_from_json(json, &s, &e), -ERR_INPUT);
    assert_non_null(strstr(e.text, "s_lambda"));
    json_object_del(json, "n");
    err_clear(&e);
    assert_int_equal(simulate_surface_from_json(json, &s, &e), -ERR_INPUT);
    assert_non_null(strstr(e.text, "\"n\""));
    json_decref(json);
}

static void an_estimate_becomes_a_surface(void **state) {
    struct simulate_surface s;
    (void)state;
    struct estimate m = {
        .model = "composite", .kappa = 1, .has_spectrum = true, .band_first = 4, .band_last = 70};
    m.value[MATERIAL_S] = 0.2;
    m.value[MATERIAL_SIGMA] = 0.3;
    m.value[MATERIAL_N] = 1.5;
    for (int k = 0; k < BANDS; k++)
        m.s_lambda[k] = k < 4 || k > 70 ? NAN : 0.1 + 0.001 * k;
    assert_int_equal(simulate_surface_from_estimate(&m, &s, NULL), 0);
    assert_true(s.s_lambda[0] == m.s_lambda[4] && s.s_lambda[80] == m.s_lambda[70]);
    assert_true(s.sigma == 0.3 && s.n == 1.5);
    strcpy(m.model, "lambert");
    assert_int_equal(simulate_surface_from_estimate(&m, &s, NULL), 0);
    double flat = simulate_surface_mean(&s, &POINTS, 10, 20, VISIBLE),
           steep = simulate_surface_mean(&s, &POINTS, 70, -60, VISIBLE);
    assert_true(fabs(flat - steep) < 1e-9);
}

static void estimates_that_are_no_surface_are_refused(void **state) {
    struct simulate_surface s;
    struct err e = {0};
    (void)state;
    struct estimate m = {.model = "composite", .kappa = M_PI};
    assert_int_equal(simulate_surface_from_estimate(&m, &s, &e), -ERR_INPUT);
    assert_non_null(strstr(e.text, "kappa"));
    err_clear(&e);
    m.kappa = 1;
    strcpy(m.refusal, "too few angles");
    assert_int_equal(simulate_surface_from_estimate(&m, &s, &e), -ERR_INPUT);
    assert_non_null(strstr(e.text, "too few angles"));
    err_clear(&e);
    *m.refusal = 0;
    strcpy(m.model, "two-lobe");
    assert_int_equal(simulate_surface_from_estimate(&m, &s, &e), -ERR_INPUT);
    assert_non_null(strstr(e.text, "two-lobe"));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_mean_is_that_of_the_bands),
        cmocka_unit_test(widths_blur_it),
        cmocka_unit_test(its_text_keeps_every_bit),
        cmocka_unit_test(a_text_without_its_spectrum_is_refused),
        cmocka_unit_test(an_estimate_becomes_a_surface),
        cmocka_unit_test(estimates_that_are_no_surface_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
