/* What goes wrong beside a campaign over real wires: goniod is killed, the bench hangs, dies and comes back. The
 * campaign repeats, waits or is resumed, and never a point is wrong. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>

#include "tests/support/judgement.h"
#include "tests/support/laboratory.h"

#define GEOMETRY "theta_i_deg: [20, 30], theta_v_deg: [-10, 10]"
#define EXPOSURE "target: 0.4, min_ms: 4, max_ms: 64, average: 2"
#define N_POINTS 4
#define DONE_MS 300000 /* far beyond what a busy machine needs */

static struct laboratory lab;

static int open_lab(void **state) {
    (void)state;
    const struct laboratory_choice choice = {0};
    laboratory_open(&lab, &choice);
    laboratory_job(&lab, GEOMETRY, "fixed", EXPOSURE);
    laboratory_goniod_start(&lab);
    return 0;
}

static int close_lab(void **state) {
    (void)state;
    laboratory_close(&lab);
    return 0;
}

static void run_job(void) {
    char job[96];
    snprintf(job, sizeof job, "%s/job.yaml", lab.dir);
    laboratory_expect(&lab, 0, "", NULL, "run", job, NULL);
}

/* The name of the only session. */
static void session_name(char path[256], char name[160]) {
    struct said said;
    laboratory_ctl(&lab, &said, NULL, "status", "--json", NULL);
    const char *at = strstr(said.out, "\"sessions\":[\"");
    assert_non_null(at);
    at += strlen("\"sessions\":[\"");
    snprintf(name, 160, "%.*s", (int)strcspn(at, "\""), at);
    snprintf(path, 256, "%s/%s.gonio", lab.sessions, name);
    said_free(&said);
}

static int settled_before_start(void *arg, const struct exposure *x) {
    (void)arg;
    if (x->kind != EXPOSURE_DARK)
        assert_true(x->settled_us < x->start_us && x->start_us < x->end_us);
    return 0;
}

static void judge(const char *path, const char *name) {
    struct judgement j = {0};
    struct session *s;
    struct err e = {0};
    laboratory_expect(&lab, 0, "", NULL, "verify", name, NULL);
    laboratory_expect(&lab, 0, "\"same\":true", NULL, "reduce", "--json", name, NULL);
    assert_int_equal(sim_paint_find(LABORATORY_SAMPLE_PAINT, LABORATORY_SAMPLE_SUPPORT, 0, &j.surface, NULL),
                     0);
    if (session_open(&s, path, true, &e) < 0)
        fail_msg("%s", e.text);
    judge_session(s, &j);
    assert_int_equal(session_each_exposure(s, settled_before_start, NULL, NULL), 0);
    session_close(s, NULL);
    print_message("# %d points (%d provisional ones left); pulls: mean %.2f, worst %.2f\n", j.n,
                  j.provisional, j.sum / j.n, j.worst);
    assert_int_equal(j.n, N_POINTS);
    assert_true(j.worst < 5);
}

static void goniod_is_killed_and_resumes(void **state) {
    (void)state;
    char path[256], name[160];
    run_job();
    laboratory_await(&lab, "\"points\":{\"done\":2", DONE_MS);
    session_name(path, name);
    laboratory_goniod_stop(&lab, SIGKILL, 128 + SIGKILL);
    laboratory_goniod_start(&lab);
    laboratory_expect(&lab, 0, "", NULL, "resume", name, NULL);
    laboratory_await(&lab, ",\"state\":\"done\",\"now_us\"", DONE_MS);
    judge(path, name);
}

static void the_bench_hangs_for_some_seconds(void **state) {
    (void)state;
    char path[256], name[160];
    run_job();
    laboratory_await(&lab, "\"points\":{\"done\":1", DONE_MS);
    session_name(path, name);
    kill(lab.sim.pid, SIGSTOP);
    real_sleep_ms(SIM_PROCESS_WATCHDOG_MS + 2000);
    kill(lab.sim.pid, SIGCONT);
    laboratory_await(&lab, "alarm 85h", DONE_MS); /* the drives' own watchdogs: a person has to look */
    laboratory_await(&lab, "\"state\":\"held\"", DONE_MS);
    laboratory_expect(&lab, 0, "", NULL, "continue", NULL);
    laboratory_await(&lab, ",\"state\":\"done\",\"now_us\"", DONE_MS);
    judge(path, name);
}

static void the_bench_dies_and_comes_back(void **state) {
    (void)state;
    char path[256], name[160];
    run_job();
    laboratory_await(&lab, "\"points\":{\"done\":1", DONE_MS);
    session_name(path, name);
    sim_process_stop(&lab.sim, SIGKILL);
    real_sleep_ms(1500);
    laboratory_sim_restart(&lab);
    laboratory_await(&lab, ",\"state\":\"done\",\"now_us\"", DONE_MS);
    judge(path, name);
}

#define TEST(name) cmocka_unit_test_setup_teardown(name, open_lab, close_lab)

int main(void) {
    const struct CMUnitTest tests[] = {
        TEST(goniod_is_killed_and_resumes),
        TEST(the_bench_hangs_for_some_seconds),
        TEST(the_bench_dies_and_comes_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
