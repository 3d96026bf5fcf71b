/* A campaign from end to end in virtual time: job in, points against the truth, pause, resume, abort, same bytes. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "proto/units.h"
#include "sim/sim.h"
#include "tests/support/judgement.h"
#include "tests/support/lab.h"

#define INCIDENCES "[20, 40]"
#define VIEWS "{from: -60, to: 60, step: 15}"
#define N_POINTS 17 /* of 18 geometries two have the source in front of the sensor; one is repeated */

static double seconds(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + t.tv_nsec * 1e-9;
}

/* ---- what a session holds against the truth ---- */

static void judge_named(const struct lab *lab, const char *name, struct judgement *j) {
    struct session *s = lab_open_session(lab, name);
    judge_green(s, "acrylic board", 0, j);
    session_close(s, NULL);
}

static char *dump(const struct lab *lab, const char *name, size_t *size) {
    char *text = NULL;
    struct session *s = lab_open_session(lab, name);
    FILE *out = open_memstream(&text, size);
    assert_int_equal(session_dump(s, out, NULL), 0);
    fclose(out);
    session_close(s, NULL);
    return text;
}

static void run_job(struct lab_fixture *f, const char *name, const char *mode) {
    char *text = lab_job_text(name, INCIDENCES, VIEWS, mode);
    lab_job(&f->lab, text);
    free(text);
    lab_run(&f->lab);
}

/* ---- tests ---- */

static void points_agree_with_the_truth(void **state) {
    struct lab_fixture *f = *state;
    struct judgement j;
    char name[192];
    double begun = seconds();
    lab_open(&f->lab, f->dir, &lab_seed1, NULL);
    run_job(f, "small", "every_geometry");
    assert_int_equal(f->lab.ended, CAMPAIGN_DONE);
    assert_true(lab_session(&f->lab, 0, name));
    lab_verify(&f->lab, name);
    judge_named(&f->lab, name, &j);
    print_message(
        "# %s: %d points in %.2f s of this machine, %.0f s of the bench; pulls: mean %.2f, rms %.2f, "
        "worst %.2f\n",
        name, j.n, seconds() - begun, clock_now_us(&f->lab.clock) / 1e6, j.sum / j.n, sqrt(j.sum2 / j.n),
        j.worst);
    assert_int_equal(j.n, N_POINTS);
    assert_int_equal(j.provisional, 0);
    assert_true(j.worst < 5);
    lab_close(&f->lab);
}

static void one_seed_gives_the_same_bytes(void **state) {
    struct lab_fixture *f = *state;
    char *text[2], name[192];
    size_t size[2];
    for (int i = 0; i < 2; i++) {
        char dir[96];
        lab_make_dir(dir);
        lab_open(&f->lab, dir, &lab_seed1, NULL);
        run_job(f, "small", "fixed");
        assert_true(lab_session(&f->lab, 0, name));
        text[i] = dump(&f->lab, name, &size[i]);
        lab_close(&f->lab);
        lab_remove_dir(dir);
    }
    assert_int_equal(size[0], size[1]);
    assert_true(size[0] > 10000);
    assert_memory_equal(text[0], text[1], size[0]);
    free(text[0]);
    free(text[1]);
}

static void reference_modes_agree(void **state) {
    static const char *const mode[] = {"fixed", "per_incidence", "every_geometry", "start_end"};
    struct lab_fixture *f = *state;
    struct judgement j;
    char name[192];
    for (int m = 0; m < 4; m++) {
        lab_open(&f->lab, f->dir, &lab_seed1, NULL);
        run_job(f, mode[m], mode[m]);
        assert_int_equal(f->lab.ended, CAMPAIGN_DONE);
        int at = 0;
        while (lab_session(&f->lab, at, name) && strncmp(name, mode[m], 5) != 0)
            at++;
        judge_named(&f->lab, name, &j);
        print_message("# %s: %d points, pulls: mean %.2f, rms %.2f, worst %.2f\n", mode[m], j.n, j.sum / j.n,
                      sqrt(j.sum2 / j.n), j.worst);
        assert_int_equal(j.n, N_POINTS);
        assert_int_equal(j.provisional, 0);
        assert_true(j.worst < 5);
        lab_close(&f->lab);
    }
}

static void pause_and_resume_lose_nothing(void **state) {
    struct lab_fixture *f = *state;
    struct judgement j;
    char name[192];
    lab_open(&f->lab, f->dir, &lab_seed1, NULL);
    lab_script(&f->lab, (struct lab_line){.steps = 6, .state = CAMPAIGN_RUNNING, .command = COMMAND_PAUSE});
    lab_script(&f->lab, (struct lab_line){.state = CAMPAIGN_PAUSED, .command = COMMAND_RESUME});
    lab_script(&f->lab,
               (struct lab_line){.steps = 10, .state = CAMPAIGN_RUNNING, .command = COMMAND_PAUSE_NOW});
    lab_script(&f->lab, (struct lab_line){.state = CAMPAIGN_PAUSED, .command = COMMAND_RESUME});
    lab_script(&f->lab, (struct lab_line){.steps = 14, .state = CAMPAIGN_RUNNING, .command = COMMAND_STOP});
    lab_script(&f->lab, (struct lab_line){.state = CAMPAIGN_PAUSED, .command = COMMAND_RESUME});
    run_job(f, "paused", "fixed");
    assert_int_equal(f->lab.ended, CAMPAIGN_DONE);
    assert_true(lab_session(&f->lab, 0, name));
    lab_verify(&f->lab, name);
    judge_named(&f->lab, name, &j);
    assert_int_equal(j.n, N_POINTS);
    assert_int_equal(j.provisional, 0);
    assert_true(j.worst < 5);
    lab_close(&f->lab);
}

static int find_end(void *arg, int64_t us, const char *kind, const char *json) {
    (void)us;
    if (!strcmp(kind, "end"))
        snprintf(arg, 256, "%s", json);
    return 0;
}

static void cannot_be_resumed(struct lab_fixture *f, const char *dir, const char *name) {
    lab_open(&f->lab, dir, &lab_seed1, NULL);
    lab_resume(&f->lab, name);
    lab_run_refused(&f->lab, ERR_STATE, "aborted by a person");
    lab_close(&f->lab);
}

static void abort_ends_it_in_any_state(void **state) {
    static const struct lab_line way[][2] = {
        {{.steps = 0, .state = CAMPAIGN_PREPARING, .command = COMMAND_ABORT}, {.steps = -1}},
        {{.steps = 5, .state = CAMPAIGN_RUNNING, .command = COMMAND_ABORT}, {.steps = -1}},
        {{.steps = 5, .state = CAMPAIGN_RUNNING, .command = COMMAND_PAUSE},
         {.state = CAMPAIGN_PAUSING, .command = COMMAND_ABORT}},
        {{.steps = 5, .state = CAMPAIGN_RUNNING, .command = COMMAND_PAUSE},
         {.state = CAMPAIGN_PAUSED, .command = COMMAND_ABORT}},
    };
    struct lab_fixture *f = *state;
    for (size_t w = 0; w < sizeof way / sizeof *way; w++) {
        char name[192], end[256] = "", dir[96];
        lab_make_dir(dir);
        lab_open(&f->lab, dir, &lab_seed1, NULL);
        for (int i = 0; i < 2 && way[w][i].steps >= 0; i++)
            lab_script(&f->lab, way[w][i]);
        run_job(f, "aborted", "fixed");
        assert_int_equal(f->lab.ended, CAMPAIGN_ABORTED);
        bool begun = lab_session(&f->lab, 0, name);
        if (begun) {
            lab_verify(&f->lab, name);
            struct session *s = lab_open_session(&f->lab, name);
            assert_int_equal(session_each_event(s, find_end, end, NULL), 0);
            session_close(s, NULL);
            assert_non_null(strstr(end, "\"aborted\""));
        }
        lab_close(&f->lab);
        if (begun)
            cannot_be_resumed(f, dir, name);
        lab_remove_dir(dir);
    }
}

static void an_interrupted_session_goes_on(void **state) {
    struct lab_fixture *f = *state;
    struct judgement j;
    char name[192];
    lab_open(&f->lab, f->dir, &lab_seed1, NULL);
    lab_script(&f->lab,
               (struct lab_line){.steps = 9, .state = CAMPAIGN_RUNNING, .command = COMMAND_INTERRUPT});
    run_job(f, "interrupted", "every_geometry");
    lab_close(&f->lab);
    lab_open(&f->lab, f->dir, &lab_seed1, NULL);
    assert_true(lab_session(&f->lab, 0, name));
    lab_resume(&f->lab, name);
    lab_run(&f->lab);
    assert_int_equal(f->lab.ended, CAMPAIGN_DONE);
    assert_false(lab_session(&f->lab, 1, name));
    assert_true(lab_session(&f->lab, 0, name));
    lab_verify(&f->lab, name);
    judge_named(&f->lab, name, &j);
    assert_int_equal(j.n, N_POINTS);
    assert_true(j.worst < 5);
    lab_close(&f->lab);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(points_agree_with_the_truth, lab_set_up, lab_tear_down),
        cmocka_unit_test_setup_teardown(one_seed_gives_the_same_bytes, lab_set_up, lab_tear_down),
        cmocka_unit_test_setup_teardown(reference_modes_agree, lab_set_up, lab_tear_down),
        cmocka_unit_test_setup_teardown(pause_and_resume_lose_nothing, lab_set_up, lab_tear_down),
        cmocka_unit_test_setup_teardown(abort_ends_it_in_any_state, lab_set_up, lab_tear_down),
        cmocka_unit_test_setup_teardown(an_interrupted_session_goes_on, lab_set_up, lab_tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
