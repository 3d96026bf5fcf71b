/* Campaigns on benches other than the built-in one: other spectrometer, filling, shutter, axes and holders, people in
 * the place of motors. Every one ends with points that agree with the truth. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/support/judgement.h"
#include "tests/support/lab.h"

#define SOURCE                                                                                               \
    "{profile: om-az, link: sim:modbus, unit: 1, limits_deg: [-70, 140], blind_deg: 8, u_zero_deg: 0.01}"
#define SAMPLE "{profile: om-az, link: sim:modbus, unit: 2, limits_deg: [-90, 90], u_zero_deg: 0.01}"
#define HOLDER                                                                                               \
    "{profile: om-az, link: sim:modbus, unit: 3, limits_deg: [-10, 190], positions: "                        \
    "{sample: 0, second: 45, reference: 90, trap: 180}}"
#define VIEW_IN_BEAM "{beam_mm: 20, view_mm: 3, filling: view-in-beam}"
#define BEAM_IN_VIEW "{beam_mm: 3, view_mm: 20, filling: beam-in-view}"
#define ONE                                                                                                  \
    "  - {name: dry, holder: sample, paint: Hooker's Green, support: acrylic board, size_mm: [150, 150]}\n"
#define SECOND(place)                                                                                        \
    "  - {name: wet, holder: " place                                                                         \
    ", paint: Hooker's Green, support: drawing paper, size_mm: [150, 150], water_percent: 60}\n"
#define GRID "{theta_i_deg: [20, 40], theta_v_deg: [-45, 0, 30, 60]}"

struct variant {
    const char *name;
    const char *model, *shutter, *optics, *source, *sample, *holder,
        *more;                                         /* of the bench; NULL = as built in */
    const char *samples, *geometry, *mode, *reference; /* of the job */
    double dark_every_min, bracket_min;                /* 0 = 10, 15 */
    int sessions, points;                              /* wanted; points: of each session, at least */
    int holds;                                         /* at least */
    const char *asks;                                  /* one of the holds says this */
};

static const char * or (const char *given, const char *built_in) {
    return given ? given : built_in;
}

static char *bench_text(const struct variant *v) {
    char *text = NULL;
    assert_true(asprintf(&text,
                         "spectrometer: {model: %s, link: sim:usb}\n"
                         "shutter: %s\n"
                         "lamp: {warm_up_min: 5}\n"
                         "optics: %s\n"
                         "axes:\n"
                         "  source: %s\n"
                         "  sample: %s\n"
                         "holder: %s\n"
                         "%s",
                         or (v->model, "usb2000plus"), or (v->shutter, "lamp-line"),
                         or (v->optics, VIEW_IN_BEAM), or (v->source, SOURCE), or (v->sample, SAMPLE),
                         or (v->holder, HOLDER), or (v->more, "")) > 0);
    return text;
}

static char *job_text(const struct variant *v) {
    char *text = NULL;
    const char *mode = or (v->mode, "fixed");
    assert_true(asprintf(&text,
                         "name: %s\n"
                         "samples:\n%s"
                         "geometry: %s\n"
                         "mean_nm: [400, 700]\n"
                         "exposure: {target: 0.8, min_ms: 4, max_ms: 5000, average: 2, dark_every_min: %g}\n"
                         "reference: {mode: %s, geometry: {%s}, holder: reference,\n"
                         "            certificate: ptfe.csv, bracket_min: %g}\n"
                         "fit: {model: composite}\n",
                         v->name, or (v->samples, ONE), or (v->geometry, GRID),
                         v->dark_every_min ? v->dark_every_min : 10, mode,
                         v->reference                    ? v->reference
                         : strcmp(mode, "per_incidence") ? "theta_i_deg: 45, theta_v_deg: 0"
                                                         : "theta_v_deg: 0",
                         v->bracket_min ? v->bracket_min : 15) > 0);
    return text;
}

static void judge(const struct lab *lab, const struct variant *v, int n) {
    struct judgement j = {0};
    char name[192];
    bool wet = n == 1;
    assert_true(lab_session(lab, n, name));
    lab_verify(lab, name);
    struct session *s = lab_open_session(lab, name);
    judge_green(s, wet ? "drawing paper" : "acrylic board", wet ? 60 : 0, &j);
    session_close(s, NULL);
    print_message("# %s: %d points in %.0f s, %d holds; pulls: mean %.2f, rms %.2f, worst %.2f\n", name, j.n,
                  clock_now_us(&lab->clock) / 1e6, lab->n_holds, j.sum / j.n, sqrt(j.sum2 / j.n), j.worst);
    assert_true(j.n >= v->points);
    assert_int_equal(j.provisional, 0);
    assert_true(j.worst < 5);
}

static bool was_asked(const struct lab *lab, const char *part) {
    for (int i = 0; i < lab->n_holds && i < LAB_HOLDS; i++)
        if (strstr(lab->hold[i], part))
            return true;
    return false;
}

static void campaign_on(void **state) {
    static struct lab lab;
    const struct variant *v = *state;
    char dir[96], *bench = bench_text(v), *job = job_text(v);
    lab_make_dir(dir);
    lab_open(&lab, dir, &lab_seed1, bench);
    lab.helpful = true;
    lab_job(&lab, job);
    lab_run(&lab);
    for (int i = 0; i < lab.n_holds && i < LAB_HOLDS; i++)
        print_message("#   asked: %s\n", lab.hold[i]);
    if (lab.ended != CAMPAIGN_DONE) {
        const struct desk_snapshot *s = desk_snapshot_get(lab.desk);
        fail_msg("ended %s: %s", campaign_state_name(lab.ended), s->json);
    }
    for (int n = 0; n < v->sessions; n++)
        judge(&lab, v, n);
    assert_true(lab.n_holds >= v->holds);
    if (v->asks && !was_asked(&lab, v->asks))
        fail_msg("no hold asked: %s", v->asks);
    lab_close(&lab);
    lab_remove_dir(dir);
    free(bench);
    free(job);
}

/* Whoever resumes is asked for what has to stand in the holder now. */
static void a_session_goes_on_with_a_holder_worked_by_hand(void **state) {
    static struct lab lab;
    const struct variant v = {.name = "by-hand", .holder = "manual", .sessions = 1, .points = 7};
    char dir[96], name[192], *text = bench_text(&v), *job = job_text(&v);
    (void)state;
    lab_make_dir(dir);
    lab_open(&lab, dir, &lab_seed1, text);
    lab.helpful = true;
    lab_script(&lab, (struct lab_line){.steps = 6, .state = CAMPAIGN_RUNNING, .command = COMMAND_INTERRUPT});
    lab_job(&lab, job);
    lab_run(&lab);
    lab_close(&lab);
    lab_open(&lab, dir, &lab_seed1, text);
    lab.helpful = true;
    assert_true(lab_session(&lab, 0, name));
    lab_resume(&lab, name);
    lab_run(&lab);
    assert_int_equal(lab.ended, CAMPAIGN_DONE);
    assert_true(was_asked(&lab, "put the reference diffuser into the holder"));
    assert_true(was_asked(&lab, "put sample dry into the holder"));
    struct judgement j = {0};
    struct session *s = lab_open_session(&lab, name);
    judge_green(s, "acrylic board", 0, &j);
    session_close(s, NULL);
    assert_int_equal(j.n, 7);
    assert_true(j.worst < 5);
    lab_close(&lab);
    lab_remove_dir(dir);
    free(text);
    free(job);
}

static const struct variant variants[] = {
    {.name = "usb4000", .model = "usb4000", .sessions = 1, .points = 7},
    {.name = "beam-in-view", .optics = BEAM_IN_VIEW, .sessions = 1, .points = 7},
    {.name = "manual-holder",
     .holder = "manual",
     .sessions = 1,
     .points = 7,
     .holds = 3,
     .asks = "put sample dry into the holder"},
    {.name = "manual-holder-every",
     .holder = "manual",
     .mode = "every_geometry",
     .bracket_min = 40,
     .geometry = "{theta_i_deg: [20], theta_v_deg: [-45, 0, 30, 60]}",
     .sessions = 1,
     .points = 4,
     .holds = 3,
     .asks = "put the reference diffuser into the holder"},
    {.name = "manual-sample-axis",
     .sample = "manual",
     .bracket_min = 40,
     .sessions = 1,
     .points = 7,
     .holds = 3,
     .asks = "urn the sample axis to 30"},
    {.name = "manual-both",
     .sample = "manual",
     .holder = "manual",
     .bracket_min = 60,
     .geometry = "{theta_i_deg: [20, 40], theta_v_deg: [0, 30]}",
     .sessions = 1,
     .points = 4,
     .holds = 4,
     .asks = "put sample dry into the holder"},
    {.name = "fixed-sample-axis",
     .sample = "{fixed_deg: 45}",
     .sessions = 1,
     .points = 2,
     .geometry = "{theta_i_deg: [20, 30, 40], theta_v_deg: [-45, 45, 20], reciprocity: true}",
     .mode = "every_geometry",
     .reference = "theta_i_deg: 10, theta_v_deg: 45"},
    {.name = "no-shutter", .shutter = "none", .sessions = 1, .points = 7},
    {.name = "manual-shutter",
     .shutter = "manual",
     .dark_every_min = 600,
     .sessions = 1,
     .points = 7,
     .holds = 2,
     .asks = "hut the shutter"},
    {.name = "two-positions", .samples = ONE SECOND("second"), .sessions = 2, .points = 7},
    {.name = "two-mounted",
     .samples = ONE SECOND("sample"),
     .sessions = 2,
     .points = 7,
     .holds = 1,
     .asks = "mount sample wet at holder position sample"},
    {.name = "two-by-hand",
     .samples = ONE SECOND("sample"),
     .holder = "manual",
     .sessions = 2,
     .points = 7,
     .holds = 5,
     .asks = "put sample wet into the holder"},
    {.name = "keep-out",
     .more = "keep_out:\n  - {source_deg: [25, 35], sample_deg: [10, 25]}\n",
     .geometry = "{theta_i_deg: [20, 40], theta_v_deg: [-45, 0, 5, 30, 60]}",
     .sessions = 1,
     .points = 8,
     .bracket_min = 2},
    {.name = "pairs",
     .geometry = "{pairs: [[40, 38.5], [40, -20], [10, 60], [55, 55]]}",
     .sessions = 1,
     .points = 4},
};

#define N_VARIANTS (sizeof variants / sizeof *variants)

int main(void) {
    struct CMUnitTest tests[N_VARIANTS + 1];
    for (size_t i = 0; i < N_VARIANTS; i++)
        tests[i] = (struct CMUnitTest){
            .name = variants[i].name, .test_func = campaign_on, .initial_state = (void *)&variants[i]};
    tests[N_VARIANTS] = (struct CMUnitTest)cmocka_unit_test(a_session_goes_on_with_a_holder_worked_by_hand);
    return _cmocka_run_group_tests("benches", tests, N_VARIANTS + 1, NULL, NULL);
}
