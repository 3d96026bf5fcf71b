#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <jansson.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/plan.h"
#include "proto/units.h"
#include "tests/support/plan_bench.h"

#define GRID "{theta_i_deg: [10, 20, 30, 40, 50, 60], theta_v_deg: {from: -80, to: 80, step: 5}}"
#define FIXED "{certificate: ptfe.csv, bracket_min: 2}"

static struct plan_bench bench;

static void make(const char *config, const char *samples, const char *geometry, const char *reference) {
    plan_bench_open(&bench, config);
    plan_bench_job(&bench, samples, geometry, reference);
    if (plan_bench_make(&bench) < 0)
        plan_bench_show(&bench.errors);
    assert_int_equal(bench.errors.n, 0);
}

static int count(enum step_kind kind) {
    int n = 0;
    for (int i = 0; i < bench.plan.n_steps; i++)
        n += bench.plan.step[i].kind == kind;
    return n;
}

static int count_refused(const char *part) {
    int n = 0;
    for (int i = 0; i < bench.plan.n_refusals; i++)
        n += strstr(bench.plan.refusal[i].why, part) != NULL;
    return n;
}

static int refused_at(double theta_i_deg, double theta_v_deg, const char *part) {
    for (int i = 0; i < bench.plan.n_refusals; i++)
        if (bench.plan.refusal[i].theta_i_deg == theta_i_deg &&
            bench.plan.refusal[i].theta_v_deg == theta_v_deg)
            return strstr(bench.plan.refusal[i].why, part) != NULL;
    return 0;
}

static void a_grid_on_the_built_in_bench(void **state) {
    (void)state;
    make(NULL, NULL, GRID, FIXED);
    const struct plan *plan = &bench.plan;
    assert_int_equal(plan->step[0].kind, STEP_WARM_UP);
    assert_int_equal(plan->step[1].kind, STEP_OVERLAP);
    assert_int_equal(plan->step[1].bracket, 0);
    assert_int_equal(count(STEP_OVERLAP), 1);
    assert_int_equal(plan->step[2].kind, STEP_REFERENCE);
    assert_true(plan->step[2].control && plan->step[2].opens == 1 && plan->step[2].bracket == 1);
    assert_int_equal(plan->step[1].theta_i_udeg, plan->step[2].theta_i_udeg);
    assert_int_equal(plan->step[plan->n_steps - 1].kind, STEP_PARK);
    assert_true(plan->step[plan->n_steps - 2].control && plan->step[plan->n_steps - 2].opens == 0);
    /* |theta_i + theta_v| < 8 deg is blind: three views of each incidence. */
    assert_int_equal(count_refused("blind zone"), 6 * 3);
    assert_true(refused_at(20, -25, "5 deg from the sensor"));
    int between = count_refused("between the two filling cases");
    assert_int_equal(plan->n_geometries, 6 * 33 - 18 - between);
    int repeats = (plan->n_geometries + 10) / 20;
    assert_int_equal(plan->n_points, plan->n_geometries + repeats);
    assert_int_equal(count(STEP_HOLD), 0);
    assert_true(plan->uses[STAGE_SOURCE] && plan->uses[STAGE_SAMPLE] && plan->uses[STAGE_HOLDER]);
    assert_true(plan->estimate_low_us < plan->estimate_us && plan->estimate_us < plan->estimate_high_us);
    plan_bench_close(&bench);
}

static void sample_readings_know_their_reference(void **state) {
    (void)state;
    static const char *const modes[] = {"fixed", "per_incidence", "every_geometry", "start_end"};
    for (size_t m = 0; m < 4; m++) {
        char reference[100];
        snprintf(reference, sizeof reference, "{certificate: ptfe.csv, bracket_min: 3, mode: %s}", modes[m]);
        make(NULL, NULL, "{theta_i_deg: [20, 40], theta_v_deg: {from: -60, to: 60, step: 5}}", reference);
        for (int i = 0; i < bench.plan.n_steps; i++) {
            const struct step *step = &bench.plan.step[i];
            if (step->kind != STEP_SAMPLE)
                continue;
            assert_in_range(step->reference, 0, i - 1);
            const struct step *r = &bench.plan.step[step->reference];
            assert_int_equal(r->kind, STEP_REFERENCE);
            assert_int_equal(r->control, m != 2);
            assert_int_equal(m == 2 ? r->bracket : r->opens, step->bracket);
            assert_int_equal(r->theta_i_udeg, m == 0 || m == 3 ? 45000000 : step->theta_i_udeg);
            assert_int_equal(r->theta_v_udeg, m == 2 ? step->theta_v_udeg : 0);
        }
        assert_int_equal(bench.plan.n_brackets == 1, m == 3);
        plan_bench_close(&bench);
    }
}

static void the_mirror_direction_is_refined_within_the_views(void **state) {
    (void)state;
    make(NULL, NULL,
         "{theta_i_deg: [40], theta_v_deg: [0, 40, 45], mirror_step_deg: 2.5, mirror_half_width_deg: 10}",
         FIXED);
    /* 0, then 30 .. 45 by 2.5: 47.5 and 50 lie beyond the views asked for; 40 and 45 only once. */
    assert_int_equal(bench.plan.n_geometries, 1 + 7);
    plan_bench_close(&bench);
}

static void what_cannot_be_measured_is_refused_with_its_reason(void **state) {
    (void)state;
    make(NULL, "  - {name: chip, size_mm: [10, 5]}\n  - {name: card, size_mm: [60, 40]}\n",
         "{pairs: [[60, 85], [10, 80], [10, 85], [40, 0], [40, 76], [60, -62]]}", FIXED);
    assert_true(refused_at(60, 85, "source axis at 145 deg, outside its limits -70 .. 140"));
    assert_true(refused_at(60, -62, "blind zone"));
    assert_true(
        refused_at(10, 85, "between the two filling cases: the view is 34.4 mm wide, the beam only 20.3 mm"));
    assert_true(refused_at(40, 76, "larger than chip"));
    assert_true(refused_at(10, 80, "larger than chip"));
    assert_int_equal(bench.plan.n_refusals, 5);
    assert_int_equal(bench.plan.n_points, 1 + 3); /* chip at 40:0; card at 10:80, 40:0 and 40:76 */
    plan_bench_close(&bench);
}

static void the_mirror_image_is_used_where_only_it_can_be_reached(void **state) {
    (void)state;
    make("spectrometer: {model: usb4000}\noptics: {beam_mm: 20, view_mm: 3}\n"
         "axes:\n"
         "  source: {profile: om-az, link: \"tcp:a:1\", unit: 1, limits_deg: [-140, 70], blind_deg: 8}\n"
         "  sample: {profile: om-az, link: \"tcp:a:1\", unit: 2, limits_deg: [-90, 90]}\n"
         "holder: {profile: om-az, link: \"tcp:a:1\", unit: 3, positions: {sample: 0, reference: 90}}\n",
         NULL, "{pairs: [[60, 60], [20, 10]]}", FIXED);
    assert_int_equal(bench.plan.n_points, 2);
    for (int i = 0; i < bench.plan.n_steps; i++) {
        const struct step *step = &bench.plan.step[i];
        if (step->kind != STEP_SAMPLE)
            continue;
        bool far = step->theta_i_udeg == 60000000;
        assert_int_equal(step->mirrored, far);
        assert_int_equal(step->target.udeg[STAGE_SOURCE], far ? -120000000 : 30000000);
        assert_int_equal(step->target.udeg[STAGE_SAMPLE], far ? -60000000 : 10000000);
    }
    plan_bench_close(&bench);
}

#define BY_HAND(sample)                                                                                      \
    "spectrometer: {model: usb2000plus}\noptics: {beam_mm: 20, view_mm: 3}\nlamp: {warm_up_min: 0}\n"        \
    "axes:\n"                                                                                                \
    "  source: {profile: om-az, link: \"tcp:a:1\", unit: 1, limits_deg: [-160, 160], blind_deg: 8}\n"        \
    "  sample: " sample "\n"

static void a_sample_turned_by_hand_needs_few_holds(void **state) {
    (void)state;
    make(BY_HAND("manual") "holder: {profile: om-az, link: \"tcp:a:1\", unit: 3, positions: {sample: 0, "
                           "reference: "
                           "90}}\n",
         NULL, GRID, "{certificate: ptfe.csv, mode: start_end}");
    /* 17 angles of 0 .. 80 show both signs of theta_v, mirrored; the control geometry is at one of them. */
    assert_in_range(count(STEP_HOLD), 17, 17 + 2 + bench.plan.n_geometries / 20);
    int32_t stands_udeg = INT32_MIN;
    for (int i = 0; i < bench.plan.n_steps; i++) {
        const struct step *step = &bench.plan.step[i];
        if (step->kind == STEP_HOLD)
            stands_udeg = step->target.udeg[STAGE_SAMPLE];
        if (step->kind == STEP_SAMPLE || step->kind == STEP_REFERENCE)
            assert_int_equal(step->target.udeg[STAGE_SAMPLE], stands_udeg);
    }
    assert_false(bench.plan.uses[STAGE_SAMPLE]);
    plan_bench_close(&bench);
}

static void a_holder_worked_by_hand_is_changed_once_a_bracket(void **state) {
    (void)state;
    make(BY_HAND("{profile: om-az, link: \"tcp:a:1\", unit: 2, limits_deg: [-90, 90]}"), NULL,
         "{theta_i_deg: [20, 40], theta_v_deg: {from: -60, to: 60, step: 5}}",
         "{certificate: ptfe.csv, mode: every_geometry, bracket_min: 15}");
    /* Diffuser first, then for each bracket: the sample, and the diffuser again. */
    assert_int_equal(count(STEP_HOLD), 1 + 2 * bench.plan.n_brackets);
    assert_int_equal(bench.plan.step[0].kind, STEP_HOLD);
    assert_string_equal(bench.plan.step[0].text, "put the reference diffuser into the holder");
    assert_int_equal(bench.plan.n_mounted, 0);
    plan_bench_close(&bench);
}

static void reciprocity_extends_a_source_axis_alone(void **state) {
    (void)state;
    const char *config = BY_HAND(
        "{fixed_deg: 45}") "holder: {profile: om-az, link: \"tcp:a:1\", unit: 3, positions: {sample: 0, "
                           "reference: 90}}\n";
    const char *reference = "{certificate: ptfe.csv, geometry: {theta_i_deg: 10, theta_v_deg: 45}}";
    make(config, NULL, "{pairs: [[20, 45], [45, 30], [45, -20], [30, 20]]}", reference);
    assert_int_equal(bench.plan.n_points, 1 + 0);
    assert_true(refused_at(45, 30, "needs the sample axis at 30 deg, but it is fixed at 45 deg"));
    plan_bench_close(&bench);
    make(config, NULL, "{reciprocity: true, pairs: [[20, 45], [45, 30], [45, -20], [30, 20]]}", reference);
    assert_int_equal(bench.plan.n_points, 3);
    int reciprocal = 0;
    for (int i = 0; i < bench.plan.n_steps; i++) {
        const struct step *step = &bench.plan.step[i];
        if (step->kind != STEP_SAMPLE)
            continue;
        assert_int_equal(abs(step->target.udeg[STAGE_SAMPLE]), 45000000);
        reciprocal += step->reciprocal;
        if (step->reciprocal) /* 45:-20 is seen as 20:-45 */
            assert_true(step->theta_i_udeg == 30000000 ? step->theta_v_udeg == 45000000
                                                       : step->theta_v_udeg == -45000000);
    }
    assert_int_equal(reciprocal, 2);
    assert_true(refused_at(30, 20, "fixed"));
    plan_bench_close(&bench);
}

static void samples_with_places_of_their_own_share_brackets(void **state) {
    (void)state;
    const char *bench_of_three =
        "spectrometer: {model: usb4000}\noptics: {beam_mm: 20, view_mm: 3}\n"
        "axes:\n"
        "  source: {profile: om-az, link: \"tcp:a:1\", unit: 1, limits_deg: [-70, 140]}\n"
        "  sample: {profile: om-az, link: \"tcp:a:1\", unit: 2, limits_deg: [-90, 90]}\n"
        "holder: {profile: om-az, link: \"tcp:a:1\", unit: 3,\n"
        "         positions: {left: 0, right: 60, reference: 120}}\n";
    make(bench_of_three,
         "  - {name: a, holder: left, size_mm: [60, 40]}\n  - {name: b, holder: right, size_mm: [60, 40]}\n"
         "  - {name: c, holder: left, size_mm: [60, 40]}\n",
         "{theta_i_deg: [20], theta_v_deg: [0, 10, 20, 30]}", "{certificate: ptfe.csv}");
    assert_int_equal(count(STEP_SAMPLE), 3 * 4);
    assert_int_equal(count(STEP_HOLD), 1);
    for (int i = 0; i < bench.plan.n_steps; i++)
        if (bench.plan.step[i].kind == STEP_HOLD)
            assert_string_equal(bench.plan.step[i].text, "mount sample c at holder position left");
    assert_int_equal(bench.plan.n_brackets, 2); /* a with b, then c, and one reading lies between */
    assert_int_equal(count(STEP_REFERENCE), 3);
    plan_bench_close(&bench);
}

static void errors_name_their_place(void **state) {
    (void)state;
    plan_bench_open(&bench, NULL);
    plan_bench_job(&bench, "  - {name: a, holder: sampel, size_mm: [60, 40]}\n", "{pairs: [[40, 0]]}",
                   "{certificate: ptfe.csv, holder: white, geometry: {theta_i_deg: 2, theta_v_deg: 0}}");
    bench.devices.utc_s = 1900000000; /* 2030-03-17, the certificate ended with 2029 */
    assert_int_equal(plan_bench_make(&bench), -ERR_INPUT);
    assert_int_equal(bench.errors.n, 4);
    assert_string_equal(
        bench.errors.item[0].text,
        "the holder has no position 'sampel', did you mean 'sample': it has sample, reference, trap");
    assert_int_equal(bench.errors.item[0].line, 3);
    assert_int_equal(bench.errors.item[1].line, 5);
    assert_true(plan_bench_says(&bench.errors, "the diffuser cannot be read at 2:0: blind zone"));
    assert_true(plan_bench_says(&bench.errors, "valid until 2030-01-01"));
    plan_bench_close(&bench);
}

static void nothing_left_to_measure_is_an_error(void **state) {
    (void)state;
    plan_bench_open(&bench, NULL);
    plan_bench_job(&bench, "  - {name: chip, size_mm: [2, 2]}\n", "{pairs: [[40, 0], [40, -42]]}", FIXED);
    assert_int_equal(plan_bench_make(&bench), -ERR_INPUT);
    assert_true(plan_bench_says(&bench.errors, "no geometry is left for sample chip"));
    assert_true(plan_bench_says(&bench.errors,
                                "refused 40:0: the view, 3.0 x 3.0 mm, is larger than chip, 2 x 2 mm"));
    plan_bench_close(&bench);
}

static void a_bracket_must_hold_one_geometry(void **state) {
    (void)state;
    plan_bench_open(&bench, BY_HAND("manual"));
    plan_bench_job(&bench, NULL, "{pairs: [[40, 10]]}", "{certificate: ptfe.csv, bracket_min: 1}");
    assert_int_equal(plan_bench_make(&bench), -ERR_INPUT);
    assert_true(plan_bench_says(&bench.errors, "a bracket of 1 min is too short"));
    assert_int_equal(bench.errors.item[0].line, 5);
    plan_bench_close(&bench);
}

static void a_certificate_of_another_geometry_is_refused(void **state) {
    (void)state;
    const char *reference = "{certificate: ptfe.csv, geometry: {theta_i_deg: 85, theta_v_deg: 0}%s}";
    char text[120];
    plan_bench_open(&bench, NULL);
    snprintf(text, sizeof text, reference, "");
    plan_bench_job(&bench, NULL, "{pairs: [[40, 0]]}", text);
    assert_int_equal(plan_bench_make(&bench), -ERR_INPUT);
    assert_true(plan_bench_says(&bench.errors, "the diffuser cannot be read at 85:0: the certificate"));
    snprintf(text, sizeof text, reference, ", angular_u_rel: 0.01");
    err_list_free(&bench.errors);
    plan_bench_job(&bench, NULL, "{pairs: [[40, 0]]}", text);
    assert_int_equal(plan_bench_make(&bench), 0);
    bool said = false;
    for (int i = 0; i < bench.plan.n_left_out; i++)
        said = said || strstr(bench.plan.left_out[i], "uncertain by 1 %");
    assert_true(said);
    plan_bench_close(&bench);
}

#define ZONED                                                                                                \
    "spectrometer: {model: usb4000}\noptics: {beam_mm: 20, view_mm: 3}\n"                                    \
    "axes:\n"                                                                                                \
    "  source: {profile: om-az, link: \"tcp:a:1\", unit: 1, limits_deg: [0, 140]}\n"                         \
    "  sample: {profile: om-az, link: \"tcp:a:1\", unit: 2, limits_deg: [-90, 90]}\n"                        \
    "holder: {profile: om-az, link: \"tcp:a:1\", unit: 3, positions: {sample: 0, reference: 90}}\n"          \
    "keep_out:\n"

static void the_way_leads_round_a_keep_out_zone(void **state) {
    (void)state;
    make(ZONED "  - {source_deg: [50, 60], sample_deg: [-20, 30]}\n", NULL,
         "{pairs: [[40, 10], [70, 0], [25, 30]]}", "{certificate: ptfe.csv}");
    assert_true(refused_at(40, 10, "source at 50 and sample at 10 deg is forbidden"));
    int with_stops = 0;
    for (int i = 0; i < bench.plan.n_steps; i++)
        with_stops += bench.plan.step[i].n_via > 0;
    assert_true(with_stops >= 2); /* to 70:0 behind the zone, and back to 45:0 */
    plan_bench_close(&bench);
    make(ZONED "  - {source_deg: [50, 60], sample_deg: [-90, 90]}\n", NULL, "{pairs: [[40, 0], [70, 0]]}",
         "{certificate: ptfe.csv}");
    assert_true(refused_at(70, 0, "no way round"));
    plan_bench_close(&bench);
}

static char *printed(void) {
    char *text;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    plan_print(&bench.plan, &bench.job, out);
    fclose(out);
    return text;
}

static void people_read_what_it_costs(void **state) {
    (void)state;
    plan_bench_open(&bench, NULL);
    plan_bench_job(&bench, NULL, GRID, FIXED);
    bench.devices.utc_s = 1767225600;
    bench.devices.free_bytes = 1e5;
    assert_int_equal(plan_bench_make(&bench), 0);
    char *text = printed();
    assert_non_null(strstr(text, "Job test: "));
    assert_non_null(strstr(text, "Started now it ends about 2026-01-01 "));
    assert_non_null(strstr(text, "THAT MAY NOT BE ENOUGH"));
    assert_non_null(strstr(text, "  sample hg60 at holder position sample\n"));
    assert_non_null(strstr(text, "  1: control 45:0, "));
    assert_non_null(strstr(text, "  10:-10: blind zone"));
    assert_non_null(strstr(text, "holder position trap: not visited"));
    free(text);
    plan_bench_close(&bench);
}

static void the_same_job_gives_the_same_plan(void **state) {
    (void)state;
    char *dump[2];
    for (int k = 0; k < 2; k++) {
        make(NULL, NULL, GRID, "{certificate: ptfe.csv, mode: every_geometry}");
        json_t *json = plan_to_json(&bench.plan, &bench.job);
        assert_non_null(json);
        assert_int_equal(json_array_size(json_object_get(json, "steps")), bench.plan.n_steps);
        dump[k] = json_dumps(json, JSON_SORT_KEYS);
        json_decref(json);
        plan_bench_close(&bench);
    }
    assert_string_equal(dump[0], dump[1]);
    free(dump[0]);
    free(dump[1]);
}

static void travel_is_saved(void **state) {
    (void)state;
    make(NULL, NULL, GRID, "{certificate: ptfe.csv, bracket_min: 600}");
    int64_t travelled = 0, points = 0;
    const struct step *last = NULL;
    for (int i = 0; i < bench.plan.n_steps; i++) {
        const struct step *step = &bench.plan.step[i];
        if (step->kind != STEP_SAMPLE || step->repeat)
            continue;
        if (last) {
            int64_t source = labs((long)step->target.udeg[0] - last->target.udeg[0]);
            int64_t sample = labs((long)step->target.udeg[1] - last->target.udeg[1]);
            travelled += source > sample ? source : sample;
        }
        last = step;
        points++;
    }
    /* 5 deg from one to the next is the grid's own spacing; the rest is for turns and the blind zone. */
    assert_true(travelled < (points - 1) * 6000000);
    plan_bench_close(&bench);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_grid_on_the_built_in_bench),
        cmocka_unit_test(sample_readings_know_their_reference),
        cmocka_unit_test(the_mirror_direction_is_refined_within_the_views),
        cmocka_unit_test(what_cannot_be_measured_is_refused_with_its_reason),
        cmocka_unit_test(the_mirror_image_is_used_where_only_it_can_be_reached),
        cmocka_unit_test(a_sample_turned_by_hand_needs_few_holds),
        cmocka_unit_test(a_holder_worked_by_hand_is_changed_once_a_bracket),
        cmocka_unit_test(reciprocity_extends_a_source_axis_alone),
        cmocka_unit_test(samples_with_places_of_their_own_share_brackets),
        cmocka_unit_test(errors_name_their_place),
        cmocka_unit_test(nothing_left_to_measure_is_an_error),
        cmocka_unit_test(a_bracket_must_hold_one_geometry),
        cmocka_unit_test(a_certificate_of_another_geometry_is_refused),
        cmocka_unit_test(the_way_leads_round_a_keep_out_zone),
        cmocka_unit_test(people_read_what_it_costs),
        cmocka_unit_test(the_same_job_gives_the_same_plan),
        cmocka_unit_test(travel_is_saved),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
