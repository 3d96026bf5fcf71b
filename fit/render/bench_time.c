#include <errno.h>
#include <fcntl.h>
#include <jansson.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include "fit/render/bench.h"
#include "fit/stopwatch.h"

#define REPEATS_MAX 15

extern char **environ;

/* What it prints is of no interest here. */
static int run_once(char *const *words, struct bench_time *time, struct err *e) {
    posix_spawn_file_actions_t files;
    struct rusage used;
    pid_t child;
    int status, failed;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, 1, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_addopen(&files, 2, "/dev/null", O_WRONLY, 0);
    double started = stopwatch_s();
    failed = posix_spawnp(&child, words[0], &files, NULL, words, environ);
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

int bench_time_run(char *const *words, const char *report, int repeats, struct bench_time *time,
                   struct err *e) {
    double value[5][REPEATS_MAX];
    repeats = repeats < REPEATS_MAX ? repeats : REPEATS_MAX;
    for (int i = 0; i < repeats; i++) {
        struct bench_time once = {0};
        int status = run_once(words, &once, e);
        if (status) {
            return status;
        }
        take_report(report, &once);
        value[0][i] = once.wall_s;
        value[1][i] = once.cpu_s;
        value[2][i] = once.trace_s;
        value[3][i] = once.trace_cpu_s;
        value[4][i] = once.rss_mib;
    }
    double *const medians[5] = {&time->wall_s, &time->cpu_s, &time->trace_s, &time->trace_cpu_s,
                                &time->rss_mib};
    for (int k = 0; k < 5; k++) {
        qsort(value[k], (size_t)repeats, sizeof(double), by_size);
        *medians[k] = value[k][repeats / 2];
    }
    return 0;
}
