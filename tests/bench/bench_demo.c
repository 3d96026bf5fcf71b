/* The demo's four campaigns: wall time, virtual over real time, and what goniod holds in memory at most. */
#include <errno.h>
#include <jansson.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "tests/support/program.h"

#define LIMIT_MS 600000
#define RUNS 5
#define WALL_S 30
#define VIRTUAL_RATIO 1000
#define RESIDENT_MIB 64

static const char *const JOBS[] = {"docs/examples/demo/acrylic-0.yaml", "docs/examples/demo/paper-0.yaml",
                                   "docs/examples/demo/paper-60.yaml", "docs/examples/demo/paper-90.yaml"};

static double resident_mib(pid_t pid) {
    char path[64], line[128];
    long kib = 0;
    snprintf(path, sizeof path, "/proc/%d/status", pid);
    FILE *f = fopen(path, "r");
    while (f && fgets(line, sizeof line, f))
        if (!strncmp(line, "VmHWM:", 6))
            kib = strtol(line + 6, NULL, 10);
    if (f)
        fclose(f);
    return (double)kib / 1024;
}

static double virtual_s(void) {
    const char *const words[] = {"gonioctl", "status", "--json", NULL};
    struct said said;
    program_run(words, NULL, 10000, &said);
    json_t *status = json_loads(said.out, 0, NULL);
    double s = json_number_value(json_object_get(status, "now_us")) * 1e-6;
    json_decref(status);
    said_free(&said);
    return s;
}

static void await_socket(const char *path) {
    for (int i = 0; i < 500 && access(path, F_OK) < 0; i++)
        real_sleep_ms(20);
}

struct outcome {
    double wall_s, bench_s, mib;
};

static bool campaigns(struct outcome *o) {
    char dir[] = "/tmp/goniod-bench-XXXXXX", socket[64], command[96];
    struct program goniod;
    struct said said, last;
    if (!mkdtemp(dir))
        return false;
    snprintf(socket, sizeof socket, "%s/s", dir);
    setenv("GONIOD_SOCKET", socket, 1);
    setenv("GONIOD_SESSIONS", dir, 1);
    const char *const serve[] = {"goniod", "--simulate", "--seed", "1", "--socket",
                                 socket,   "--sessions", dir,      NULL};
    const char *const run[] = {"gonioctl", "run", "--wait", JOBS[0], JOBS[1], JOBS[2], JOBS[3], NULL};
    if (!program_start(&goniod, serve, NULL))
        return false;
    await_socket(socket);
    int64_t begun_us = real_us();
    program_run(run, NULL, LIMIT_MS, &said);
    o->wall_s = (double)(real_us() - begun_us) * 1e-6;
    o->bench_s = virtual_s();
    o->mib = resident_mib(goniod.pid);
    kill(goniod.pid, SIGTERM);
    program_wait(&goniod, 10000, &last);
    bool good = said.status == 0;
    if (!good)
        fprintf(stderr, "%s\n%s\n", said.err, last.err);
    said_free(&said);
    said_free(&last);
    snprintf(command, sizeof command, "rm -rf '%s'", dir);
    return system(command) == 0 && good;
}

static int by_time(const void *a, const void *b) {
    double x = ((const struct outcome *)a)->wall_s, y = ((const struct outcome *)b)->wall_s;
    return (x > y) - (x < y);
}

int main(void) {
    struct outcome run[RUNS] = {{0}};
    double mib = 0;
    bool good = true;
    for (int i = 0; i < RUNS; i++) {
        good = campaigns(&run[i]) && good;
        mib = run[i].mib > mib ? run[i].mib : mib;
    }
    qsort(run, RUNS, sizeof run[0], by_time);
    const struct outcome *middle = &run[RUNS / 2], *quick = &run[0], *slow = &run[RUNS - 1];
    double ratio = middle->bench_s / middle->wall_s;
    printf("| the demo's four campaigns%s | at most %d s | %.1f s (median of %d runs, %.1f..%.1f s) | %s |\n",
           good ? "" : " (FAILED)", WALL_S, middle->wall_s, RUNS, quick->wall_s, slow->wall_s,
           good && middle->wall_s <= WALL_S ? "met" : "missed");
    printf("| virtual over real time | at least %d | %.0f (%.0f..%.0f; %.2f h of the bench) | %s |\n",
           VIRTUAL_RATIO, ratio, slow->bench_s / slow->wall_s, quick->bench_s / quick->wall_s,
           middle->bench_s / 3600, ratio >= VIRTUAL_RATIO ? "met" : "missed");
    printf("| goniod resident, at most | %d MiB | %.1f MiB | %s |\n", RESIDENT_MIB, mib,
           mib <= RESIDENT_MIB ? "met" : "missed");
    return !good;
}
