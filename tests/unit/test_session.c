#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/support/session_rows.h"

static bool same_double(double a, double b) {
    return a == b || (isnan(a) && isnan(b));
}

static void assert_doubles(const double *a, const double *b, int n) {
    for (int i = 0; i < n; i++)
        if (!same_double(a[i], b[i]))
            fail_msg("number %d: %.17g is not %.17g", i, a[i], b[i]);
}

static int see_exposure(void *arg, const struct exposure *x) {
    struct exposure want;
    uint16_t counts[ROW_SCANS * ROW_PIXELS];
    int *n = arg;
    row_exposure(++*n, &want, counts);
    assert_int_equal(x->id, *n);
    assert_memory_equal(x->counts, counts, sizeof counts);
    assert_doubles(&x->temperature_c, &want.temperature_c, 1);
    struct exposure got = *x;
    got.id = 0;
    got.counts = counts;
    got.temperature_c = want.temperature_c = 0;
    assert_int_equal(got.kind, want.kind);
    assert_int_equal(got.step, want.step);
    assert_int_equal(got.attempt, want.attempt);
    assert_int_equal(got.bracket, want.bracket);
    assert_int_equal(got.opens, want.opens);
    assert_int_equal(got.control, want.control);
    assert_int_equal(got.mirrored, want.mirrored);
    assert_int_equal(got.theta_i_udeg, want.theta_i_udeg);
    assert_int_equal(got.theta_v_udeg, want.theta_v_udeg);
    assert_int_equal(got.source_udeg, want.source_udeg);
    assert_int_equal(got.sample_udeg, want.sample_udeg);
    assert_int_equal(got.holder_udeg, want.holder_udeg);
    assert_int_equal(got.settled_us, want.settled_us);
    assert_int_equal(got.start_us, want.start_us);
    assert_int_equal(got.end_us, want.end_us);
    assert_int_equal(got.utc_us, want.utc_us);
    assert_int_equal(got.exposure_us, want.exposure_us);
    assert_int_equal(got.saturated_pixels, want.saturated_pixels);
    assert_int_equal(got.lamp, want.lamp);
    return 0;
}

static int see_point(void *arg, const struct point *p) {
    struct point want;
    int *n = arg;
    ++*n;
    row_point(*n, *n, &want);
    assert_int_equal(p->id, *n);
    assert_int_equal(p->supersedes, 0);
    assert_int_equal(p->provisional, want.provisional);
    assert_int_equal(p->exposure_id, want.exposure_id);
    assert_int_equal(p->bracket, want.bracket);
    assert_int_equal(p->theta_i_udeg, want.theta_i_udeg);
    assert_int_equal(p->theta_v_udeg, want.theta_v_udeg);
    assert_int_equal(p->noisy, want.noisy);
    assert_doubles((double[]){p->tau_us, p->tau_r_us, p->scan_f, p->mean, p->mean_u_ind},
                   (double[]){want.tau_us, want.tau_r_us, want.scan_f, want.mean, want.mean_u_ind}, 5);
    assert_doubles(p->beta, want.beta, BANDS);
    assert_doubles(p->u_ind, want.u_ind, BANDS);
    assert_doubles(p->cov_next, want.cov_next, BANDS);
    assert_int_equal(p->n_common, want.n_common);
    for (int band = 0; band < BANDS; band++)
        assert_int_equal(p->present[band], want.present[band]);
    for (int k = 0; k < p->n_common; k++) {
        assert_string_equal(p->common[k].name, want.common[k].name);
        assert_doubles(&p->common[k].mean, &want.common[k].mean, 1);
        assert_doubles(p->common[k].sensitivity, want.common[k].sensitivity, BANDS);
    }
    return 0;
}

static void exposures_and_points_come_back(void **state) {
    (void)state;
    ROW_OK(session_close(row_fill(row_path, 12), e));
    struct session *s;
    int exposures = 0, points = 0;
    ROW_OK(session_open(&s, row_path, true, e));
    ROW_OK(session_each_exposure(s, see_exposure, &exposures, e));
    ROW_OK(session_each_point(s, true, see_point, &points, e));
    assert_int_equal(exposures, 12);
    assert_int_equal(points, 12);
    struct session_summary m;
    ROW_OK(session_get_summary(s, &m, e));
    assert_int_equal(m.n_exposures, 12);
    assert_int_equal(m.n_final, 0);
    assert_int_equal(m.first_us, 1000010);
    assert_int_equal(m.last_us, 12500000);
    ROW_OK(session_close(s, e));
}

static int see_bracket(void *arg, const struct bracket *b) {
    struct bracket want;
    row_bracket(++*(int *)arg, &want);
    assert_int_equal(b->number, want.number);
    assert_int_equal(b->open_us, want.open_us);
    assert_int_equal(b->close_us, want.close_us);
    assert_int_equal(b->last_exposure_id, want.last_exposure_id);
    assert_string_equal(b->ended_by, want.ended_by);
    assert_doubles(&b->mean_rate, &want.mean_rate, 1);
    assert_doubles(b->rate, want.rate, BANDS);
    return 0;
}

static int see_event(void *arg, int64_t us, const char *kind, const char *json) {
    (void)arg;
    assert_int_equal(us, 77);
    assert_string_equal(kind, "held");
    assert_string_equal(json, "{\"why\":\"door\"}");
    return 5;
}

static int see_exchange(void *arg, const struct exchange *x) {
    static const uint8_t request[] = {1, 3, 0, 0xCC, 0, 2};
    int *n = arg;
    assert_int_equal(x->sent_us, 1000 * *n);
    assert_int_equal(x->done_us, 1000 * *n + 7);
    assert_string_equal(x->link, *n % 2 ? "rtu:A" : "rtu:B");
    assert_memory_equal(x->request, request, sizeof request);
    assert_int_equal(x->request_size, sizeof request);
    assert_int_equal(x->reply_size, *n == 3 ? 0 : 4);
    assert_int_equal(x->result, *n == 3 ? -ERR_TIMEOUT : 0);
    ++*n;
    return 0;
}

static int see_text(void *arg, const char *key, const char *value) {
    char *all = arg;
    snprintf(all + strlen(all), 100 - strlen(all), "%s=%s;", key, value);
    return 0;
}

static void brackets_events_exchanges_and_texts_come_back(void **state) {
    (void)state;
    struct session *s = row_fill(row_path, 0);
    static const uint8_t request[] = {1, 3, 0, 0xCC, 0, 2}, reply[] = {0, 0, 0x30, 0x39};
    for (int n = 1; n <= 3; n++) {
        struct bracket b;
        row_bracket(n, &b);
        ROW_OK(session_add_bracket(s, &b, e));
    }
    ROW_OK(session_add_event(s, 77, "held", "{\"why\":\"door\"}", e));
    for (int n = 0; n < 6; n++)
        ROW_OK(session_add_exchange(s, 1000 * n, 1000 * n + 7, n % 2 ? "rtu:A" : "rtu:B", request,
                                    sizeof request, n == 3 ? NULL : reply, n == 3 ? 0 : 4,
                                    n == 3 ? -ERR_TIMEOUT : 0, e));
    int brackets = 0, exchanges = 0;
    ROW_OK(session_each_bracket(s, see_bracket, &brackets, e));
    assert_int_equal(brackets, 3);
    assert_int_equal(session_each_event(s, see_event, NULL, NULL), 5);
    ROW_OK(session_each_exchange(s, see_exchange, &exchanges, e));
    assert_int_equal(exchanges, 6);
    char all[100] = "", *text;
    ROW_OK(session_each_text(s, see_text, all, e));
    assert_string_equal(all, "job=name: test\nsamples: []\t# tab\n;seed=17;");
    ROW_OK(session_get_text(s, "seed", &text, e));
    assert_string_equal(text, "17");
    free(text);
    ROW_OK(session_get_text(s, "nothing", &text, e));
    assert_null(text);
    assert_int_equal(session_set_text(s, "seed", "18", NULL), -ERR_STATE);
    struct calibration c, want;
    row_calibration(&want);
    ROW_OK(session_get_calibration(s, &c, e));
    assert_doubles(c.wavelength, want.wavelength, 4);
    assert_doubles(c.nonlinearity, want.nonlinearity, 8);
    assert_string_equal(c.serial, want.serial);
    assert_int_equal(c.active_last, want.active_last);
    assert_int_equal(c.saturation, 60000);
    assert_true(c.nonlinearity_used);
    ROW_OK(session_close(s, e));
}

static int see_estimate(void *arg, int64_t us, int64_t last_point_id, const struct estimate *m) {
    int n = ++*(int *)arg;
    struct estimate want;
    row_estimate(n, &want);
    assert_int_equal(us, 1000 * n);
    assert_int_equal(last_point_id, n);
    assert_string_equal(m->model, want.model);
    assert_string_equal(m->refusal, want.refusal);
    assert_int_equal(m->converged, want.converged);
    assert_int_equal(m->provisional, want.provisional);
    assert_int_equal(m->n_points, want.n_points);
    assert_int_equal(m->n_parameters, want.n_parameters);
    assert_doubles(m->value, want.value, MATERIAL_PARAMETERS);
    assert_doubles(m->statistical[0], want.statistical[0], MATERIAL_PARAMETERS * MATERIAL_PARAMETERS);
    assert_doubles(m->common[0], want.common[0], MATERIAL_PARAMETERS * MATERIAL_PARAMETERS);
    assert_doubles(m->limit_95, want.limit_95, MATERIAL_PARAMETERS);
    assert_memory_equal(m->at_bound, want.at_bound, sizeof m->at_bound);
    assert_memory_equal(m->not_identifiable, want.not_identifiable, sizeof m->not_identifiable);
    assert_doubles(
        (double[]){m->kappa, m->q, m->chi2, m->bic, m->r2, m->median_relative_error, m->specular_energy},
        (double[]){want.kappa, want.q, want.chi2, want.bic, want.r2, want.median_relative_error,
                   want.specular_energy},
        7);
    assert_int_equal(m->has_spectrum, want.has_spectrum);
    assert_doubles(m->s_lambda, want.s_lambda, BANDS);
    assert_doubles(m->u_s_lambda, want.u_s_lambda, BANDS);
    assert_doubles(
        (double[]){m->theta_i_low_deg, m->theta_i_high_deg, m->theta_v_low_deg, m->theta_v_high_deg},
        (double[]){10, 60, -80, 79.5}, 4);
    assert_string_equal(m->gap[4].why, want.gap[4].why);
    assert_true(m->gap[4].has_next && !m->gap[3].has_next);
    assert_true(m->gap[4].next_theta_i_deg == 60 && m->gap[4].next_theta_v_deg == 75.5);
    assert_int_equal(m->n_warnings, 2);
    assert_string_equal(m->warning[1], want.warning[1]);
    assert_int_equal(m->iterations, want.iterations);
    assert_int_equal(m->minimised, want.minimised);
    assert_doubles(m->loss, want.loss, MATERIAL_LOSSES);
    assert_doubles(
        (double[]){m->condition, m->n_effective, m->loio, m->source_width_deg, m->sensor_width_deg},
        (double[]){3.25, 31.5, 1.125, 1, 0.5}, 5);
    assert_doubles((double[]){m->mirror_offset_deg, m->u_mirror_offset_deg, m->zero_source_deg,
                              m->zero_sample_deg, m->polarisation, m->u_polarisation},
                   (double[]){0.0125, 0.001, 0.005, -0.01, 0.03, 0.004}, 6);
    assert_int_equal(m->beam_in_view, want.beam_in_view);
    assert_memory_equal(&m->polarisation_span, &want.polarisation_span, sizeof want.polarisation_span);
    return 0;
}

static void estimates_come_back(void **state) {
    (void)state;
    struct session *s = row_fill(row_path, 3);
    struct estimate m;
    assert_int_equal(session_last_estimate(s, &m, NULL), -ERR_STATE);
    for (int n = 1; n <= 3; n++) {
        row_estimate(n, &m);
        ROW_OK(session_add_estimate(s, 1000 * n, n, &m, e));
    }
    int n = 0;
    ROW_OK(session_each_estimate(s, see_estimate, &n, e));
    assert_int_equal(n, 3);
    ROW_OK(session_last_estimate(s, &m, e));
    assert_int_equal(m.n_points, 13);
    ROW_OK(session_close(s, e));
}

static void models_belong_to_the_newest_estimate(void **state) {
    (void)state;
    struct session *s = row_fill(row_path, 3);
    struct estimate m;
    char *text;
    ROW_OK(session_last_models(s, &text, e));
    assert_null(text);
    for (int n = 1; n <= 2; n++) {
        row_estimate(n, &m);
        ROW_OK(session_add_estimate(s, 1000 * n, n, &m, e));
        ROW_OK(session_last_models(s, &text, e));
        assert_null(text);
        ROW_OK(session_add_models(s, n == 1 ? "[]" : "[{\"why\":\"2\"}]", e));
    }
    ROW_OK(session_last_models(s, &text, e));
    assert_string_equal(text, "[{\"why\":\"2\"}]");
    free(text);
    ROW_OK(session_close(s, e));
}

static void slopes_belong_to_the_newest_estimate(void **state) {
    (void)state;
    struct session *s = row_fill(row_path, 3);
    struct estimate m;
    const struct point_slope slope[] = {{1, .25, -.5}, {2, 1e-3, 0}};
    for (int n = 1; n <= 2; n++) {
        row_estimate(n, &m);
        ROW_OK(session_add_estimate(s, 1000 * n, n, &m, e));
    }
    ROW_OK(session_add_slopes(s, slope, 2, e));
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    ROW_OK(session_dump_table(s, "estimation_point", out, e));
    fclose(out);
    assert_string_equal(
        text, "estimation_point\testimation_id=2\tpoint_id=1\tsource_per_deg=0.25\tsample_per_deg=-0.5\n"
              "estimation_point\testimation_id=2\tpoint_id=2\tsource_per_deg=0.001\tsample_per_deg=0\n");
    free(text);
    ROW_OK(session_close(s, e));
}

static void a_joint_fit_stands_beside_its_estimate(void **state) {
    (void)state;
    struct session *s = row_fill(row_path, 3);
    struct estimate m;
    struct joint joint = {.model = "composite", .converged = true, .kappa = 1, .n_bands = 2, .chi2 = 1.5},
                 back;
    assert_int_equal(session_last_joint(s, &back, NULL), -ERR_STATE);
    joint.at_bound[MATERIAL_N] = true;
    joint.value[MATERIAL_SIGMA] = 0.3;
    joint.mirror_offset_deg = -0.1 / 3;
    joint.u_mirror_offset_deg = 0.01 / 3;
    joint.polarisation = 0.1 / 7;
    joint.u_polarisation = 0.01 / 7;
    joint.value[MATERIAL_BETA_PRIME] = 7.5;
    for (int b = 0; b < BANDS; b++)
        joint.s_lambda[b] = b == 3 || b == 80 ? b / 100.0 : NAN;
    ROW_OK(joint_allocate(&joint, 3, e));
    joint.row[0] = (struct joint_row){MATERIAL_SIGMA, -1};
    joint.row[1] = (struct joint_row){MATERIAL_S, 3};
    joint.row[2] = (struct joint_row){MATERIAL_S, 80};
    for (int i = 0; i < 9; i++) {
        joint.statistical[i] = 1e-6 / (1 + i / 3 + i % 3);
        joint.common[i] = 1e-7 * (1 + i / 3) * (1 + i % 3);
    }
    row_estimate(1, &m);
    ROW_OK(session_add_estimate(s, 1000, 1, &m, e));
    ROW_OK(session_add_joint(s, &joint, e));
    ROW_OK(session_close(s, e));
    ROW_OK(session_open(&s, row_path, true, e));
    ROW_OK(session_last_joint(s, &back, e));
    assert_true(back.n == 3 && back.kappa == 1 && back.at_bound[MATERIAL_N] && !back.at_bound[MATERIAL_S]);
    assert_memory_equal(back.row, joint.row, sizeof joint.row[0] * 3);
    assert_memory_equal(back.statistical, joint.statistical, 9 * sizeof(double));
    assert_memory_equal(back.common, joint.common, 9 * sizeof(double));
    assert_true(back.s_lambda[3] == 0.03 && back.s_lambda[80] == 0.8 && isnan(back.s_lambda[4]));
    assert_true(back.beta_prime[80] == 7.5 && isnan(back.beta_prime[0]) && back.value[MATERIAL_SIGMA] == 0.3);
    assert_doubles(
        (double[]){back.mirror_offset_deg, back.u_mirror_offset_deg, back.polarisation, back.u_polarisation},
        (double[]){-0.1 / 3, 0.01 / 3, 0.1 / 7, 0.01 / 7}, 4);
    joint_free(&back);
    joint_free(&joint);
    ROW_OK(session_close(s, e));
}

/* Held, not fitted: without u, and still what the fit went by. */
static void a_joint_fit_keeps_the_stated_polarisation(void **state) {
    (void)state;
    struct session *s = row_fill(row_path, 3);
    struct estimate m;
    struct joint joint = {.model = "composite", .converged = true, .polarisation = 0.1 / 7}, back;
    row_estimate(1, &m);
    ROW_OK(session_add_estimate(s, 1000, 1, &m, e));
    ROW_OK(session_add_joint(s, &joint, e));
    ROW_OK(session_last_joint(s, &back, e));
    assert_true(back.polarisation == 0.1 / 7 && back.u_polarisation == 0 && back.u_mirror_offset_deg == 0);
    joint_free(&back);
    ROW_OK(session_close(s, e));
}

#define TEST(f) cmocka_unit_test_setup_teardown(f, row_setup, row_teardown)

/* --make FILE: a session for tests/unit/test_session_format.py. */
static int make_example(const char *file) {
    snprintf(row_path, sizeof row_path, "%s", file);
    struct session *s = row_fill(row_path, 2);
    struct point p;
    struct bracket b;
    ROW_OK(session_set_text(s, "goniod_version", "0.1.0", e));
    row_bracket(1, &b);
    ROW_OK(session_add_bracket(s, &b, e));
    for (int n = 1; n <= 2; n++) {
        row_point(n, n, &p);
        p.provisional = false;
        p.supersedes = n;
        ROW_OK(session_add_point(s, &p, e));
    }
    ROW_OK(session_close(s, e));
    return 0;
}

int main(int argc, char **argv) {
    if (argc == 3 && strcmp(argv[1], "--make") == 0)
        return make_example(argv[2]);
    const struct CMUnitTest tests[] = {
        TEST(exposures_and_points_come_back),
        TEST(brackets_events_exchanges_and_texts_come_back),
        TEST(estimates_come_back),
        TEST(models_belong_to_the_newest_estimate),
        TEST(slopes_belong_to_the_newest_estimate),
        TEST(a_joint_fit_stands_beside_its_estimate),
        TEST(a_joint_fit_keeps_the_stated_polarisation),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
