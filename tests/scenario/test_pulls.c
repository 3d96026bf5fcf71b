/* The demo's four campaigns over many seeds of the bench, from job file to estimate: the pulls against the truth
 * obey measurement.md 11, with the common parts and without.
 *
 *   SEEDS=500 WORKERS=2 LOG=pulls.csv build/tests/scenario/test_pulls     (make pulls SEEDS=500 LOG=pulls.csv)
 *
 * Seeds run from FIRST on, none left out; two from 1 by default. Each draws noise, drift and repeatability anew, and
 * once also certificate, axis zeros and P (COMMON=with); once those are as stated and known to be (COMMON=without; by
 * default both). MODE=fixed (or another) reads the reference in that mode instead of
 * the jobs' own; FILLING=beam-in-view turns the spots round. With LOG=FILE a run that was cut goes on where it stood.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "proto/file.h"
#include "tests/support/lab.h"
#include "tests/support/pulls_log.h"

#define FOLDER "docs/examples/demo/"
#define SEEDS_DEFAULT 2 /* with four samples, with and without common parts: 16 campaigns */

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

static void take_pulls(const struct lab *lab, enum pulls_parts parts, struct pull *pull) {
    for (int i = 0; i < PULLS_SAMPLES; i++) {
        static struct dataset d;
        struct err e = {0};
        char name[192], path[320];
        assert_true(lab_session(lab, i, name));
        assert_non_null(strstr(name, JOBS[i]));
        snprintf(path, sizeof path, "%s/%s.gonio", lab->dir, name);
        if (dataset_load(&d, path, &e) < 0)
            fail_msg("%s", e.text);
        if (parts == PULLS_WITHOUT)
            pulls_refit(&d, path);
        pulls_of(&d, &pull[i]);
        dataset_free(&d);
    }
}

static void print_seed(int seed, enum pulls_parts parts, const struct pull *pull) {
    const char *common = parts == PULLS_WITH ? "with" : "without";
    print_message("# again: COMMON=%s FIRST=%d SEEDS=1 build/tests/scenario/test_pulls:", common, seed);
    for (int i = 0; i < PULLS_SAMPLES; i++) {
        const struct pull *x = &pull[i];
        print_message(" %s %.1f/%.1f/%.1f/%.1f/%.1f d2 %.1f;", JOBS[i], x->of[0], x->of[1], x->of[2],
                      x->of[3], x->of[4], x->distance2);
    }
    print_message("\n");
}

/* A bench file: no light astray; the rest is the config's. */
static struct simulate_bench *dark_bench(const char *dir) {
    struct simulate_bench *bench;
    struct err_list errors = {0};
    char path[128];
    snprintf(path, sizeof path, "%s/bench.yaml", dir);
    FILE *out = fopen(path, "we");
    assert_non_null(out);
    fputs("optics: {stray_light: 0}\n", out);
    assert_int_equal(fclose(out), 0);
    if (simulate_bench_read(&bench, path, &errors) < 0)
        fail_msg("%s", errors.item[0].text);
    return bench;
}

static void run_seed(const char *log, int seed, enum pulls_parts parts) {
    static struct lab lab;
    struct pull pull[PULLS_SAMPLES];
    struct simulate_bench *bench = NULL;
    char dir[96], *config = bench_text();
    lab_make_dir(dir);
    if (parts == PULLS_WITHOUT)
        bench = dark_bench(dir);
    lab_open(
        &lab, dir,
        &(struct simulate_options){.file = bench, .seed = (uint64_t)seed, .nominal = parts == PULLS_WITHOUT},
        config);
    queue_jobs(&lab);
    lab_run(&lab);
    assert_int_equal(lab.ended, CAMPAIGN_DONE);
    lab_close(&lab);
    simulate_bench_free(bench);
    free(config);
    take_pulls(&lab, parts, pull);
    lab_remove_dir(dir);
    pulls_log_add(log, seed, parts, JOBS, pull, PULLS_SAMPLES);
    print_seed(seed, parts, pull);
}

/* ---- many seeds, each in a process of its own ---- */

struct work {
    char log[128];
    int first, n, workers, running, lost;
    bool wanted[PULLS_PARTS];
};

static void take_work(struct work *w) {
    const char *common = getenv("COMMON"), *log = getenv("LOG"), *mode = getenv("MODE"),
               *filling = getenv("FILLING");
    char bench[64];
    *w = (struct work){.first = number_of("FIRST", 1), .workers = number_of("WORKERS", 1)};
    w->n = number_of("SEEDS", SEEDS_DEFAULT);
    w->wanted[PULLS_WITH] = !common || strcmp(common, "without") != 0;
    w->wanted[PULLS_WITHOUT] = !common || strcmp(common, "with") != 0;
    assert_in_range(w->n, 1, PULLS_SEEDS);
    snprintf(w->log, sizeof w->log, "%s", log ? log : "/tmp/goniod-pulls-XXXXXX");
    if (!log) {
        close(mkstemp(w->log));
        unlink(w->log);
    }
    snprintf(bench, sizeof bench, "%s %s", mode ? mode : "every_geometry",
             filling ? filling : "view-in-beam");
    pulls_log_open(w->log, bench);
}

static void await_one(struct work *w) {
    int status;
    assert_true(wait(&status) > 0);
    w->running--;
    w->lost += status != 0; /* the others run on: what one seed breaks is told at the end */
}

static void start_one(struct work *w, int seed, enum pulls_parts parts) {
    while (w->running >= w->workers)
        await_one(w);
    fflush(stdout);
    pid_t pid = fork();
    assert_true(pid >= 0);
    if (pid == 0) { /* where a test fails in it, the child ends with the status of the whole program */
        run_seed(w->log, seed, parts);
        fflush(stdout);
        _exit(0);
    }
    w->running++;
}

static int judge(const struct work *w, enum pulls_parts parts) {
    static struct pulls p;
    p = (struct pulls){.parts = parts};
    pulls_log_read(w->log, w->first, w->n, &p);
    return p.n_seeds > 0 ? pulls_judge(&p) : 1;
}

static void estimates_pull_as_their_uncertainties_say(void **state) {
    (void)state;
    struct work w;
    int broken = 0;
    take_work(&w);
    for (int i = 0; i < w.n; i++)
        for (int parts = 0; parts < PULLS_PARTS; parts++)
            if (w.wanted[parts] && !pulls_log_has(w.log, w.first + i, parts))
                start_one(&w, w.first + i, parts);
    while (w.running > 0)
        await_one(&w);
    for (int parts = 0; parts < PULLS_PARTS; parts++)
        broken += w.wanted[parts] ? judge(&w, parts) : 0;
    if (!getenv("LOG"))
        unlink(w.log);
    if (w.lost > 0)
        fail_msg("%d seeds gave no estimate with its uncertainties: see above", w.lost);
    assert_int_equal(broken, 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(estimates_pull_as_their_uncertainties_say),
    };
    return cmocka_run_group_tests_name("pulls", tests, NULL, NULL);
}
