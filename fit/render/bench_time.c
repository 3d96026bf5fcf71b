#include <errno.h>
#include <fcntl.h>
#include <jansson.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include "fit/render/bench.h"
#include "fit/stopwatch.h"

#define ROUNDS_MAX 15
#define FIGURES ((int)(sizeof(struct bench_time) / sizeof(double)))

extern char **environ;

/* What it prints is of no interest here. */
static int run_once(const char *const *words, struct bench_time *time, struct err *e) {
    posix_spawn_file_actions_t files;
    struct rusage used;
    pid_t child;
    int status, failed;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, 1, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_addopen(&files, 2, "/dev/null", O_WRONLY, 0);
    double started = stopwatch_s();
    failed = posix_spawnp(&child, words[0], &files, NULL, (char *const *)words, environ);
    posix_spawn_file_actions_destroy(&files);
    if (failed) {
        return err_errno(e, ERR_IO, failed, "%s cannot be started", words[0]);
    }
    while (wait4(child, &status, 0, &used) < 0 && errno == EINTR) {
    }
    time->wall_s = stopwatch_s() - started;
    time->cpu_s = (double)used.ru_utime.tv_sec + (double)used.ru_stime.tv_sec +
                  1e-6 * (double)(used.ru_utime.tv_usec + used.ru_stime.tv_usec);
    time->rss_mib = (double)used.ru_maxrss / 1024;
    return WIFEXITED(status) && WEXITSTATUS(status) == 0
               ? 0
               : err_set(e, ERR_IO, "%s %s failed", words[0], words[1]);
}

static void take_report(const char *report, struct bench_time *time) {
    json_t *json = report ? json_load_file(report, 0, NULL) : NULL,
           *seconds = json_object_get(json, "seconds");
    time->trace_s = json_number_value(json_object_get(seconds, "trace"));
    time->trace_cpu_s = json_number_value(json_object_get(seconds, "trace_cpu"));
    json_decref(json);
}

static int by_size(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

struct rounds { /* of one program: each figure of every round */
    double value[FIGURES][ROUNDS_MAX];
};

static int run_round(struct bench_program *p, struct rounds *rounds, int round, struct err *e) {
    struct bench_time once = {0};
    struct err missing = {0};
    int status = run_once(p->words, &once, p->optional ? &missing : e);
    if (status) {
        p->missing = p->optional;
        return p->optional ? 0 : status;
    }
    take_report(p->report, &once);
    const double figures[] = {once.wall_s, once.cpu_s, once.trace_s, once.trace_cpu_s, once.rss_mib};
    for (int k = 0; k < FIGURES; k++) {
        rounds->value[k][round] = figures[k];
    }
    return 0;
}

static struct bench_time figures_of(const struct rounds *rounds, int rank) {
    return (struct bench_time){rounds->value[0][rank], rounds->value[1][rank], rounds->value[2][rank],
                               rounds->value[3][rank], rounds->value[4][rank]};
}

int bench_time_rounds(struct bench_program *program, int n, int rounds, struct err *e) {
    struct rounds *kept = calloc((size_t)n, sizeof *kept);
    int status = kept ? 0 : err_set(e, ERR_NOMEM, "no memory for the times of %d programs", n);
    rounds = rounds < ROUNDS_MAX ? rounds : ROUNDS_MAX;
    for (int i = 0; i < rounds * n && !status; i++) {
        if (!program[i % n].missing) {
            status = run_round(&program[i % n], &kept[i % n], i / n, e);
        }
    }
    for (int i = 0; i < n && !status; i++) {
        for (int k = 0; k < FIGURES; k++) {
            qsort(kept[i].value[k], (size_t)rounds, sizeof(double), by_size);
        }
        program[i].median = figures_of(&kept[i], rounds / 2);
        program[i].quietest = figures_of(&kept[i], 0);
    }
    free(kept);
    return status;
}
