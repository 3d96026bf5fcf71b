/* The demo's four campaigns over many seeds of the bench, from job file to estimate: the pulls against the truth
 * obey measurement.md 11.
 *
 *   SEEDS=200 FIRST=1 build/tests/scenario/test_pulls     (make pulls SEEDS=200)
 *
 * Seeds run from FIRST on, none left out; five from 1 by default. Each draws noise, drift, certificate, axis zeros
 * and repeatability anew. MODE=fixed (or another) reads the reference in that mode instead of the jobs' own;
 * FILLING=beam-in-view turns the spots round. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/file.h"
#include "tests/support/lab.h"
#include "tests/support/pulls.h"

#define FOLDER "docs/examples/demo/"
#define SEEDS_DEFAULT 5 /* with four samples: 20 campaigns */

static const char *const JOBS[PULLS_SAMPLES] = {"acrylic-0", "paper-0", "paper-60", "paper-90"};

static int number_of(const char *name, int otherwise) {
    const char *text = getenv(name);
    return text ? atoi(text) : otherwise;
}

/* A new text with `part`, where it stands in `text`, exchanged; NULL: a copy. */
static char *exchanged(const char *text, const char *part, const char *by) {
    char *new, *at = by ? strstr(text, part) : NULL;
    if (!at)
        return strdup(text);
    assert_true(asprintf(&new, "%.*s%s%s", (int)(at - text), text, by, at + strlen(part)) > 0);
    return new;
}

static char *bench_text(void) {
    const char *filling = getenv("FILLING");
    bool turned = filling && !strcmp(filling, "beam-in-view");
    return exchanged(config_builtin_text(), "beam_mm: 20, view_mm: 3, filling: view-in-beam",
                     turned ? "beam_mm: 3, view_mm: 20, filling: beam-in-view" : NULL);
}

static void queue_jobs(struct lab *lab) {
    for (int i = 0; i < PULLS_SAMPLES; i++) {
        const char *mode = getenv("MODE");
        char path[128], by[64], *text;
        size_t size;
        snprintf(by, sizeof by, "mode: %s", mode ? mode : "");
        snprintf(path, sizeof path, FOLDER "%s.yaml", JOBS[i]);
        assert_int_equal(file_read(path, 1 << 16, &text, &size, NULL), 0);
        char *job = exchanged(text, "mode: every_geometry", mode ? by : NULL);
        lab_job(lab, job);
        free(job);
        free(text);
    }
}

static void take_pulls(const struct lab *lab, struct pulls *p, int at) {
    for (int i = 0; i < PULLS_SAMPLES; i++) {
        static struct dataset d;
        struct err e = {0};
        char name[192], path[320];
        assert_true(lab_session(lab, i, name));
        assert_non_null(strstr(name, JOBS[i]));
        snprintf(path, sizeof path, "%s/%s.gonio", lab->dir, name);
        if (dataset_load(&d, path, &e) < 0)
            fail_msg("%s", e.text);
        strcpy(p->sample[i], JOBS[i]);
        pulls_of(&d, &p->pull[at][i]);
        dataset_free(&d);
    }
}

static void print_seed(const struct pulls *p, int at, int seed) {
    print_message("# seed %d (again: FIRST=%d SEEDS=1 build/tests/scenario/test_pulls):", seed, seed);
    for (int i = 0; i < PULLS_SAMPLES; i++) {
        const struct pull *x = &p->pull[at][i];
        print_message(" %s %.1f/%.1f/%.1f/%.1f/%.1f d2 %.1f;", JOBS[i], x->of[0], x->of[1], x->of[2],
                      x->of[3], x->of[4], x->distance2);
    }
    print_message("\n");
}

static void run_seed(struct pulls *p, int at, int seed) {
    static struct lab lab;
    char dir[96], *config = bench_text();
    lab_make_dir(dir);
    lab_open(&lab, dir, &(struct simulate_options){.seed = (uint64_t)seed}, config);
    queue_jobs(&lab);
    lab_run(&lab);
    assert_int_equal(lab.ended, CAMPAIGN_DONE);
    lab_close(&lab);
    free(config);
    take_pulls(&lab, p, at);
    lab_remove_dir(dir);
    print_seed(p, at, seed);
}

static void estimates_pull_as_their_uncertainties_say(void **state) {
    (void)state;
    static struct pulls p;
    int first = number_of("FIRST", 1), n = number_of("SEEDS", SEEDS_DEFAULT);
    assert_in_range(n, 1, PULLS_SEEDS);
    p.n_samples = PULLS_SAMPLES;
    for (; p.n_seeds < n; p.n_seeds++)
        run_seed(&p, p.n_seeds, first + p.n_seeds);
    assert_int_equal(pulls_judge(&p), 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(estimates_pull_as_their_uncertainties_say),
    };
    return cmocka_run_group_tests_name("pulls", tests, NULL, NULL);
}
