/* What goes wrong in a campaign, and what a person may say in each of its states. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <jansson.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "tests/support/lab.h"

#define VIEWS "{from: -60, to: 60, step: 15}"

static void queue_job(struct lab *lab, const char *name, const char *incidences, const char *views) {
    char *text = lab_job_text(name, incidences, views, "fixed");
    lab_job(lab, text);
    free(text);
}

static json_t *snapshot(const struct lab *lab) {
    const struct desk_snapshot *s = desk_snapshot_get(lab->desk);
    json_t *json = json_loads(s->json, 0, NULL);
    desk_snapshot_put(s);
    assert_non_null(json);
    return json;
}

/* ---- saturation ---- */

struct saturation {
    int step, exposure_us; /* of the saturated set at hand */
    int saturated, answered, points;
};

static int follow(void *arg, const struct exposure *x) {
    struct saturation *s = arg;
    if (x->kind != EXPOSURE_SAMPLE)
        return 0;
    if (x->step == s->step) {
        assert_true(x->exposure_us < s->exposure_us);
        s->answered++;
    }
    s->step = x->saturated_pixels ? x->step : -1;
    s->exposure_us = x->exposure_us;
    s->saturated += x->saturated_pixels > 0;
    return 0;
}

static int no_saturated_point(void *arg, const struct point *p) {
    struct saturation *s = arg;
    assert_false(p->saturated);
    s->points++;
    return 0;
}

/* From dull to the mirror peak in one step: what the dull view suggests is far too long. */
static void a_saturated_set_is_kept_and_taken_again_shorter(void **state) {
    struct lab_fixture *f = *state;
    struct saturation s = {.step = -1};
    char name[192];
    queue_job(&f->lab, "peak", "[60]", "[0, 60]");
    lab_run(&f->lab);
    assert_int_equal(f->lab.ended, CAMPAIGN_DONE);
    assert_true(lab_session(&f->lab, 0, name));
    struct session *session = lab_open_session(&f->lab, name);
    assert_int_equal(session_each_exposure(session, follow, &s, NULL), 0);
    assert_int_equal(session_each_point(session, false, no_saturated_point, &s, NULL), 0);
    session_close(session, NULL);
    assert_true(s.saturated > 0);
    assert_int_equal(s.answered, s.saturated);
    assert_true(s.points >= 2);
}

/* ---- disk and estimator ---- */

static void a_full_disk_ends_it_safely(void **state) {
    struct lab_fixture *f = *state;
    struct rlimit old, small;
    char name[192];
    signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &old);
    small = old;
    small.rlim_cur = 700000;
    setrlimit(RLIMIT_FSIZE, &small);
    queue_job(&f->lab, "full", "[20, 40]", VIEWS);
    lab_run(&f->lab);
    setrlimit(RLIMIT_FSIZE, &old);
    assert_int_equal(f->lab.ended, CAMPAIGN_FAILED);
    json_t *s = snapshot(&f->lab);
    assert_true(json_is_false(json_object_get(s, "lamp")));
    json_t *ended = json_array_get(json_object_get(s, "jobs_ended"), 0);
    assert_true(strlen(json_string_value(json_object_get(ended, "why"))) > 20);
    json_decref(s);
    assert_true(lab_session(&f->lab, 0, name));
    lab_verify(&f->lab, name);
}

static void without_an_estimator_the_points_are_measured_all_the_same(void **state) {
    struct lab_fixture *f = *state;
    const char *kept = getenv("GONIOFIT");
    char before[512];
    snprintf(before, sizeof before, "%s", kept ? kept : "");
    lab_close(&f->lab);
    setenv("GONIOFIT", "/nowhere/goniofit", 1);
    lab_open(&f->lab, f->dir, &lab_seed1, NULL);
    queue_job(&f->lab, "unfitted", "[20]", VIEWS);
    lab_run(&f->lab);
    setenv("GONIOFIT", before, 1);
    assert_int_equal(f->lab.ended, CAMPAIGN_DONE);
    json_t *s = snapshot(&f->lab);
    assert_non_null(strstr(json_string_value(json_object_get(s, "warning")), "/nowhere/goniofit"));
    json_decref(s);
}

/* ---- several jobs, several samples ---- */

static void jobs_queue(void **state) {
    struct lab_fixture *f = *state;
    char name[192];
    queue_job(&f->lab, "first", "[20]", "[0, 30]");
    queue_job(&f->lab, "second", "[20]", "[0, 30]");
    f->lab.jobs = 2;
    lab_run(&f->lab);
    assert_int_equal(f->lab.ended, CAMPAIGN_DONE);
    assert_true(lab_session(&f->lab, 1, name));
    assert_int_equal(strncmp(name, "second_", 7), 0);
    json_t *s = snapshot(&f->lab);
    assert_int_equal(json_array_size(json_object_get(s, "jobs_ended")), 2);
    json_decref(s);
}

static const char two_samples[] =
    "name: two\n"
    "samples:\n"
    "  - {name: dry, holder: sample, paint: Hooker's Green, support: acrylic board, size_mm: [120, 80]}\n"
    "  - {name: wet, holder: sample, paint: Hooker's Green, support: drawing paper, size_mm: [120, 80],\n"
    "     water_percent: 60}\n"
    "geometry: {theta_i_deg: [20], theta_v_deg: [0, 30, 60]}\n"
    "mean_nm: [400, 700]\n"
    "exposure: {target: 0.8, min_ms: 4, max_ms: 5000, average: 2, dark_every_min: 10}\n"
    "reference: {mode: fixed, geometry: {theta_i_deg: 45, theta_v_deg: 0}, holder: reference,\n"
    "            certificate: ptfe.csv, bracket_min: 15}\n"
    "fit: {model: composite}\n";

struct points_of {
    int n;
    double mean[32];
};

static int keep_mean(void *arg, const struct point *p) {
    struct points_of *o = arg;
    if (!p->provisional && o->n < 32)
        o->mean[o->n++] = p->mean;
    return 0;
}

static void a_hold_waits_for_the_person_who_changes_the_sample(void **state) {
    struct lab_fixture *f = *state;
    struct points_of of[2] = {0};
    char name[192];
    lab_job(&f->lab, two_samples);
    lab_script(&f->lab, (struct lab_line){.state = CAMPAIGN_HELD, .command = COMMAND_CONTINUE});
    lab_run(&f->lab);
    assert_int_equal(f->lab.ended, CAMPAIGN_DONE);
    for (int i = 0; i < 2; i++) {
        assert_true(lab_session(&f->lab, i, name));
        struct session *s = lab_open_session(&f->lab, name);
        assert_int_equal(session_each_point(s, false, keep_mean, &of[i], NULL), 0);
        session_close(s, NULL);
        assert_true(of[i].n >= 3);
    }
    assert_true(of[0].mean[0] / of[1].mean[0] > 1.05 || of[1].mean[0] / of[0].mean[0] > 1.05);
}

/* ---- every command in every state that can be reached from outside ---- */

static const struct lab_line way_to[][2] = {
    [CAMPAIGN_PREPARING] = {{.state = CAMPAIGN_PREPARING, .command = COMMANDS}},
    [CAMPAIGN_RUNNING] = {{.steps = 3, .state = CAMPAIGN_RUNNING, .command = COMMANDS}},
    [CAMPAIGN_PAUSING] = {{.steps = 3, .state = CAMPAIGN_RUNNING, .command = COMMAND_PAUSE},
                          {.state = CAMPAIGN_PAUSING, .command = COMMANDS}},
    [CAMPAIGN_PAUSED] = {{.steps = 3, .state = CAMPAIGN_RUNNING, .command = COMMAND_PAUSE},
                         {.state = CAMPAIGN_PAUSED, .command = COMMANDS}},
    [CAMPAIGN_HELD] = {{.state = CAMPAIGN_HELD, .command = COMMANDS}},
};

/* The command in the state does what the table says; after that an abort still ends the campaign. */
static void try_command(enum campaign_state at, enum campaign_command command) {
    static struct lab lab;
    char dir[96];
    const struct campaign_rule *rule = &campaign_table[at][command];
    lab_make_dir(dir);
    lab_open(&lab, dir, &lab_seed1, NULL);
    for (int i = 0; i < 2; i++) {
        struct lab_line line = way_to[at][i];
        bool last = line.command == COMMANDS;
        if (last)
            line.command = command;
        lab_script(&lab, line);
        if (last)
            break;
    }
    if (rule->allowed && command != COMMAND_ABORT && command != COMMAND_INTERRUPT)
        lab_script(&lab, (struct lab_line){.state = CAMPAIGN_STATES, .command = COMMAND_ABORT});
    if (at == CAMPAIGN_HELD)
        lab_job(&lab, two_samples);
    else
        queue_job(&lab, "told", "[20]", "[0, 15, 30, 45]");
    if (rule->allowed) {
        lab_run(&lab);
        if (command != COMMAND_INTERRUPT)
            assert_int_equal(lab.ended, CAMPAIGN_ABORTED);
    } else {
        lab_run_refused(&lab, ERR_STATE, rule->why);
    }
    lab_close(&lab);
    lab_remove_dir(dir);
}

static void every_command_in_every_state(void **state) {
    static const enum campaign_command command[] = {COMMAND_PAUSE,          COMMAND_PAUSE_NOW, COMMAND_RESUME,
                                                    COMMAND_RESUME_SESSION, COMMAND_CONTINUE,  COMMAND_ABORT,
                                                    COMMAND_INTERRUPT,      COMMAND_MANUAL,    COMMAND_STOP};
    (void)state;
    for (int at = CAMPAIGN_PREPARING; at <= CAMPAIGN_HELD; at++)
        for (size_t c = 0; c < sizeof command / sizeof *command; c++)
            try_command(at, command[c]);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_saturated_set_is_kept_and_taken_again_shorter, lab_set_up_opened,
                                        lab_tear_down),
        cmocka_unit_test_setup_teardown(a_full_disk_ends_it_safely, lab_set_up_opened, lab_tear_down),
        cmocka_unit_test_setup_teardown(without_an_estimator_the_points_are_measured_all_the_same,
                                        lab_set_up_opened, lab_tear_down),
        cmocka_unit_test_setup_teardown(jobs_queue, lab_set_up_opened, lab_tear_down),
        cmocka_unit_test_setup_teardown(a_hold_waits_for_the_person_who_changes_the_sample, lab_set_up_opened,
                                        lab_tear_down),
        cmocka_unit_test(every_command_in_every_state),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
