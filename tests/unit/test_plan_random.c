/* Random jobs on random benches. PLAN_SEED=N repeats one seed; PLAN_RUNS=N tries more of them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/plan.h"
#include "proto/units.h"
#include "tests/support/plan_bench.h"

static struct plan_bench bench;
static uint64_t random_state;

static uint32_t draw(uint32_t below) { /* xorshift64 */
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return (uint32_t)(random_state >> 33) % below;
}

static bool chance(int percent) {
    return (int)draw(100) < percent;
}

static void write_config(FILE *out) {
    fprintf(out, "spectrometer: {model: %s}\nlamp: {warm_up_min: %u}\n",
            chance(50) ? "usb4000" : "usb2000plus", draw(30));
    fprintf(out, "optics: {beam_mm: %u, view_mm: %u, filling: %s}\n", chance(70) ? 20 : 3, 4, "view-in-beam");
    fprintf(out,
            "axes:\n  source: {profile: om-az, link: \"tcp:a:1\", unit: 1, limits_deg: [%d, %d], blind_deg: "
            "%u}\n",
            -(int)draw(160), 60 + (int)draw(90), draw(12));
    if (chance(25))
        fprintf(out, "  sample: manual\n");
    else if (chance(20))
        fprintf(out, "  sample: {fixed_deg: %d}\n", (int)draw(10) * 10 - 40);
    else
        fprintf(out, "  sample: {profile: om-az, link: \"tcp:a:1\", unit: 2, limits_deg: [%d, %d]}\n",
                -20 - (int)draw(70), 20 + (int)draw(70));
    if (chance(70))
        fprintf(out, "holder: {profile: om-az, link: \"tcp:a:1\", unit: 3, positions: {sample: 0, other: 50, "
                     "reference: 90}}\n");
    for (uint32_t i = 0, n = chance(30) ? 1 + draw(2) : 0; i < n; i++) {
        int source = (int)draw(160) - 60, sample = (int)draw(140) - 80;
        fprintf(out, "%s  - {source_deg: [%d, %d], sample_deg: [%d, %d]}\n", i ? "" : "keep_out:\n", source,
                source + 5 + (int)draw(20), sample, sample + 5 + (int)draw(40));
    }
}

static void write_geometry(FILE *out) {
    if (chance(30)) {
        fprintf(out, "{pairs: [[%u, %d]", draw(80), (int)draw(160) - 80);
        for (uint32_t i = 0, n = draw(40); i < n; i++)
            fprintf(out, ", [%u, %d]", draw(80), (int)draw(160) - 80);
        fprintf(out, "]");
    } else {
        fprintf(out, "{theta_i_deg: {from: %u, to: %u, step: %u}, theta_v_deg: {from: -%u, to: %u, step: %u}",
                draw(20), 20 + draw(50), 5 + draw(20), draw(85), draw(85), 3 + draw(10));
        if (chance(50))
            fprintf(out, ", mirror_step_deg: %g, mirror_half_width_deg: %u", 0.5 + draw(6) / 2.0,
                    1 + draw(10));
    }
    fprintf(out, "%s}", chance(50) ? ", reciprocity: true" : "");
}

static char *text_of(void (*write)(FILE *)) {
    char *text;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    write(out);
    fclose(out);
    return text;
}

static void write_samples(FILE *out) {
    fprintf(out, "  - {name: a, size_mm: [%u, 40]}\n", 5 + draw(60));
    if (chance(40))
        fprintf(out, "  - {name: b, holder: %s, size_mm: [%u, 40]}\n", chance(50) ? "other" : "sample",
                5 + draw(60));
    if (chance(20))
        fprintf(out, "  - {name: c, size_mm: [60, 3]}\n");
}

static void write_reference(FILE *out) {
    static const char *const modes[] = {"fixed", "per_incidence", "every_geometry", "start_end"};
    uint32_t mode = draw(4);
    fprintf(out, "{certificate: ptfe.csv, mode: %s, bracket_min: %u, geometry: {", modes[mode], 2 + draw(20));
    if (mode != 1)
        fprintf(out, "theta_i_deg: %u, ", draw(70));
    fprintf(out, "theta_v_deg: %d}}", (int)draw(9) * 10 - 40);
}

/* The list of geometries, made here once more from the job and nothing else. */
struct asked {
    int32_t i, v;
};

static int by_angles(const void *a, const void *b) {
    const struct asked *x = a, *y = b;
    return x->i != y->i ? (x->i > y->i) - (x->i < y->i) : (x->v > y->v) - (x->v < y->v);
}

static int list_asked(struct asked *list) {
    const struct job_geometry *g = &bench.job.geometry;
    int n = 0, kept = 0;
    for (int k = 0; k < g->n_pairs; k++)
        list[n++] = (struct asked){udeg_from_deg(g->pair_deg[k][0]), udeg_from_deg(g->pair_deg[k][1])};
    for (int i = 0; i < g->n_theta_i; i++) {
        for (int v = 0; v < g->n_theta_v; v++)
            list[n++] = (struct asked){udeg_from_deg(g->theta_i_deg[i]), udeg_from_deg(g->theta_v_deg[v])};
        for (int k = -40; k <= 40 && g->mirror_step_deg > 0; k++) {
            double v = g->theta_i_deg[i] + k * g->mirror_step_deg;
            bool within = g->n_theta_v > 1 ? v >= g->theta_v_deg[0] && v <= g->theta_v_deg[g->n_theta_v - 1]
                                           : fabs(v) <= 89;
            if (fabs(k * g->mirror_step_deg) <= g->mirror_half_width_deg && within)
                list[n++] = (struct asked){udeg_from_deg(g->theta_i_deg[i]), udeg_from_deg(v)};
        }
    }
    qsort(list, (size_t)n, sizeof *list, by_angles);
    for (int k = 0; k < n; k++)
        if (kept == 0 || by_angles(&list[kept - 1], &list[k]) != 0)
            list[kept++] = list[k];
    return kept;
}

static int times_refused(int sample, struct asked a) {
    int n = 0;
    for (int i = 0; i < bench.plan.n_refusals; i++) {
        const struct refusal *r = &bench.plan.refusal[i];
        n += (r->sample < 0 || r->sample == sample) && udeg_from_deg(r->theta_i_deg) == a.i &&
             udeg_from_deg(r->theta_v_deg) == a.v && r->why[0];
    }
    return n;
}

static int times_measured(int sample, struct asked a) {
    int n = 0;
    struct asked swapped = {abs(a.v), a.v < 0 ? -a.i : a.i};
    for (int i = 0; i < bench.plan.n_steps; i++) {
        const struct step *s = &bench.plan.step[i];
        if (s->kind != STEP_SAMPLE || s->sample != sample || s->repeat)
            continue;
        n += s->theta_i_udeg == a.i && s->theta_v_udeg == a.v;
        bool also_itself = swapped.i == a.i && swapped.v == a.v;
        n += bench.job.geometry.reciprocity && !also_itself &&
             bench.config.sample.kind == CONFIG_AXIS_FIXED && s->theta_i_udeg == swapped.i &&
             s->theta_v_udeg == swapped.v &&
             (abs(a.v) != abs(udeg_from_deg(bench.config.sample.fixed_deg)) || s->reciprocal);
    }
    return n;
}

static void each_geometry_is_a_step_or_a_refusal(void) {
    static struct asked list[40000];
    int n = list_asked(list);
    for (int s = 0; s < bench.job.n_samples; s++)
        for (int k = 0; k < n; k++) {
            int measured = times_measured(s, list[k]), refused = times_refused(s, list[k]);
            /* With theta_i = 0 both exchanges fall on one angle: twice the same reading is one. */
            if (measured + refused != 1 && !(list[k].i == 0 && bench.job.geometry.reciprocity))
                fail_msg("%g:%g on sample %d: measured %d times, refused %d times", list[k].i / 1e6,
                         list[k].v / 1e6, s, measured, refused);
        }
}

static bool in_zone(int32_t source_low, int32_t source_high, int32_t sample_low, int32_t sample_high) {
    for (int i = 0; i < bench.config.n_keep_out; i++) {
        const struct config_zone *z = &bench.config.keep_out[i];
        if (source_high >= udeg_from_deg(z->source_deg[0]) && source_low <= udeg_from_deg(z->source_deg[1]) &&
            sample_high >= udeg_from_deg(z->sample_deg[0]) && sample_low <= udeg_from_deg(z->sample_deg[1]))
            return true;
    }
    return false;
}

static void check_leg(const struct stage_target *from, const struct stage_target *to) {
    int32_t s0 = from->udeg[0], s1 = to->udeg[0], n0 = from->udeg[1], n1 = to->udeg[1];
    if (bench.config.sample.kind != CONFIG_AXIS_MOTOR)
        n0 = n1; /* turned by hand beforehand */
    assert_false(in_zone(s0 < s1 ? s0 : s1, s0 < s1 ? s1 : s0, n0 < n1 ? n0 : n1, n0 < n1 ? n1 : n0));
    assert_in_range(s1 + 400000000, udeg_from_deg(bench.config.source.limits_deg[0]) + 400000000,
                    udeg_from_deg(bench.config.source.limits_deg[1]) + 400000000);
    if (bench.config.sample.kind == CONFIG_AXIS_MOTOR)
        assert_in_range(n1 + 400000000, udeg_from_deg(bench.config.sample.limits_deg[0]) + 400000000,
                        udeg_from_deg(bench.config.sample.limits_deg[1]) + 400000000);
}

static void no_way_leads_where_it_must_not(void) {
    const struct stage_target *at = NULL;
    for (int i = 0; i < bench.plan.n_steps; i++) {
        const struct step *s = &bench.plan.step[i];
        if (s->kind != STEP_SAMPLE && s->kind != STEP_REFERENCE)
            continue;
        const struct stage_target *last = at;
        for (int k = 0; last && k < s->n_via; k++) {
            check_leg(last, &s->via[k]);
            last = &s->via[k];
        }
        check_leg(last ? last : &s->target, &s->target);
        assert_true(abs(s->target.udeg[0]) >= udeg_from_deg(bench.config.source.blind_deg));
        int sign = s->mirrored ? -1 : 1;
        assert_int_equal(s->target.udeg[0], sign * (s->theta_i_udeg + s->theta_v_udeg));
        assert_int_equal(s->target.udeg[1], sign * s->theta_v_udeg);
        at = &s->target;
    }
}

/* From reading to reading by the plan's own clock; a bracket holds one control geometry at both ends. */
static void brackets_are_short_enough_and_whole(void) {
    int64_t now_us = 0, open_us = 0;
    const struct step *opened = NULL;
    for (int i = 0; i < bench.plan.n_steps; i++) {
        const struct step *s = &bench.plan.step[i];
        now_us += s->estimate_us;
        if (s->kind == STEP_SAMPLE) {
            assert_non_null(opened);
            assert_int_equal(s->bracket, opened->opens);
        }
        if (!s->control)
            continue;
        if (opened) {
            assert_int_equal(s->bracket, opened->opens);
            assert_int_equal(s->theta_i_udeg, opened->theta_i_udeg);
            assert_int_equal(s->theta_v_udeg, opened->theta_v_udeg);
            if (bench.job.reference.mode != REFERENCE_START_END)
                assert_true(now_us - open_us <= bench.job.reference.bracket_min * US_PER_MIN);
        }
        opened = s->opens ? s : NULL;
        open_us = now_us;
    }
    assert_null(opened);
    assert_true(bench.plan.estimate_us >= now_us);
    assert_true(bench.plan.estimate_low_us <= bench.plan.estimate_us);
    assert_true(bench.plan.estimate_high_us >= bench.plan.estimate_us);
}

/* Each reading takes at least its slowest move and its scans with what the model throws away. */
static void an_estimate_covers_its_parts(void) {
    const struct spectrometer_model *model = bench.devices.spectrometer;
    double exposure_us = sqrt(bench.job.exposure.min_ms * 1000 * bench.job.exposure.max_ms * 1000);
    const struct step *last = NULL;
    for (int i = 0; i < bench.plan.n_steps; i++) {
        const struct step *s = &bench.plan.step[i];
        if (s->kind != STEP_SAMPLE && s->kind != STEP_REFERENCE)
            continue;
        int64_t slowest_us = 0;
        for (int axis = 0; last && axis < STAGE_AXES; axis++)
            if (bench.devices.profile[axis]) {
                int64_t us =
                    axis_move_time_us(&bench.profile, s->target.udeg[axis] - last->target.udeg[axis]);
                slowest_us = us > slowest_us ? us : slowest_us;
            }
        double least = (bench.job.exposure.average + model->discards) * exposure_us;
        assert_true((double)s->estimate_us >= least + (s->n_via ? 0 : (double)slowest_us) - 1);
        last = s;
    }
}

static bool one_seed(uint64_t seed) {
    random_state = seed * 0x9e3779b97f4a7c15u + 1;
    char *config = text_of(write_config), *samples = text_of(write_samples);
    char *geometry = text_of(write_geometry), *reference = text_of(write_reference);
    struct err_list errors = {0};
    struct config read;
    bool good = config_read_text("c", config, strlen(config), &read, &errors) == 0;
    bool made = false;
    if (good) {
        plan_bench_open(&bench, config);
        plan_bench_job(&bench, samples, geometry, reference);
        made = plan_bench_make(&bench) == 0;
        assert_true(made || bench.errors.n > 0);
        if (made) {
            each_geometry_is_a_step_or_a_refusal();
            no_way_leads_where_it_must_not();
            brackets_are_short_enough_and_whole();
            an_estimate_covers_its_parts();
        }
        plan_bench_close(&bench);
    }
    err_list_free(&errors);
    free(config);
    free(samples);
    free(geometry);
    free(reference);
    return made;
}

static void random_jobs_keep_the_promises(void **state) {
    (void)state;
    const char *one = getenv("PLAN_SEED"), *runs = getenv("PLAN_RUNS");
    int n = one ? 1 : runs ? atoi(runs) : 150, made = 0;
    for (int k = 0; k < n; k++) {
        uint64_t seed = one ? strtoull(one, NULL, 10) : (uint64_t)k + 1;
        fprintf(stderr, "# seed %llu; repeat: PLAN_SEED=%llu build/tests/unit/test_plan_random\r",
                (unsigned long long)seed, (unsigned long long)seed);
        made += one_seed(seed);
    }
    fprintf(stderr, "\n# %d of %d jobs gave a plan\n", made, n);
    assert_true(one || made * 3 > n);
}

int main(void) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(random_jobs_keep_the_promises)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
