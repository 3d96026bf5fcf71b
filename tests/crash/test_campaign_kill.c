/* kill -9 in a campaign, then resume: each committed row survives bit for bit, none is doubled, the job is completed. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/support/lab.h"

#define N_POINTS 17 /* of 18 geometries two have the source in front of the sensor; one is repeated */
#define COUNTS_MAX 4096

static const struct simulate_options seed1 = {.seed = 1};

struct rows { /* what a session holds: a checksum of each exposure, the steps of its final points */
    int n_exposures, n_final;
    uint64_t exposure[COUNTS_MAX];
    int step[COUNTS_MAX]; /* of each exposure */
    int final[COUNTS_MAX];
};

static uint64_t hash(uint64_t h, const void *bytes, size_t size) {
    for (size_t i = 0; i < size; i++)
        h = (h ^ ((const uint8_t *)bytes)[i]) * 1099511628211u; /* FNV-1a */
    return h;
}

static int add_exposure(void *arg, const struct exposure *x) {
    struct rows *r = arg;
    uint64_t h = hash(14695981039346656037u, x->counts, sizeof *x->counts * x->n_scans * x->pixels);
    h = hash(h, &x->start_us, sizeof x->start_us);
    assert_int_equal(x->id, r->n_exposures + 1);
    assert_in_range(r->n_exposures, 0, COUNTS_MAX - 1);
    r->step[r->n_exposures] = x->step;
    r->exposure[r->n_exposures++] = hash(h, &x->step, sizeof x->step);
    return 0;
}

static int add_point(void *arg, const struct point *p) {
    struct rows *r = arg;
    if (p->provisional)
        return 0;
    int step = r->step[p->exposure_id - 1];
    for (int i = 0; i < r->n_final; i++)
        assert_int_not_equal(r->final[i], step); /* one final point for each step of the plan */
    r->final[r->n_final++] = step;
    return 0;
}

static void read_rows(const struct lab *lab, const char *name, struct rows *r) {
    struct session *s = lab_open_session(lab, name);
    memset(r, 0, sizeof *r);
    assert_int_equal(session_each_exposure(s, add_exposure, r, NULL), 0);
    assert_int_equal(session_each_point(s, false, add_point, r, NULL), 0);
    session_close(s, NULL);
}

/* A child measures and kills itself once as many steps are done. */
static void measure_until_killed(const char *dir, int steps) {
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        static struct lab lab;
        lab_open(&lab, dir, &seed1, NULL);
        lab_script(&lab, (struct lab_line){.steps = steps, .state = CAMPAIGN_RUNNING, .kill = true});
        char *text = lab_job_text("killed", "[20, 40]", "{from: -60, to: 60, step: 15}", "fixed");
        lab_job(&lab, text);
        free(text);
        lab_run(&lab);
        _exit(0);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL);
}

static void kill_and_resume(int steps) {
    static struct lab lab;
    static struct rows before, after;
    char dir[96], name[192], path[320];
    struct err_list found = {0};
    lab_make_dir(dir);
    measure_until_killed(dir, steps);
    lab_open(&lab, dir, &seed1, NULL);
    assert_true(lab_session(&lab, 0, name));
    read_rows(&lab, name, &before);
    lab_resume(&lab, name);
    lab_run(&lab);
    assert_int_equal(lab.ended, CAMPAIGN_DONE);
    read_rows(&lab, name, &after);
    assert_true(after.n_exposures > before.n_exposures);
    assert_memory_equal(before.exposure, after.exposure, before.n_exposures * sizeof *before.exposure);
    assert_int_equal(after.n_final, N_POINTS);
    snprintf(path, sizeof path, "%s/%s.gonio", dir, name);
    if (session_verify(path, &found, NULL) < 0)
        fail_msg("%s", found.n ? found.item[0].text : "not sound");
    assert_false(lab_session(&lab, 1, name));
    lab_close(&lab);
    lab_remove_dir(dir);
}

static void a_killed_campaign_is_completed(void **state) {
    static const int steps[] = {1, 2, 3, 7, 11, 16, 19};
    (void)state;
    for (size_t i = 0; i < sizeof steps / sizeof *steps; i++)
        kill_and_resume(steps[i]);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_killed_campaign_is_completed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
