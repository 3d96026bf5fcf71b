#include "fit/bench_place.h"

#include <stdio.h>
#include <string.h>
#include <sys/utsname.h>

#include "proto/process.h"

/* One line of a program's output; "unknown" where there is none. */
static void first_line(const char *const *argv, char *text, size_t size) {
    struct err e = {0};
    FILE *out = tmpfile();
    snprintf(text, size, "unknown");
    if (out && process_run(argv, fileno(out), &e) == 0) {
        rewind(out);
        if (fgets(text, (int)size, out)) {
            text[strcspn(text, "\n")] = '\0';
        }
    }
    if (out) {
        fclose(out);
    }
}

static void processor(char *text, size_t size) {
    char line[256];
    FILE *f = fopen("/proc/cpuinfo", "r");
    snprintf(text, size, "unknown");
    while (f && fgets(line, sizeof line, f)) {
        char *colon = strchr(line, ':');
        if (strncmp(line, "model name", 10) == 0 && colon) {
            line[strcspn(line, "\n")] = '\0';
            snprintf(text, size, "%s", colon + 2);
            break;
        }
    }
    if (f) {
        fclose(f);
    }
}

void bench_place_find(struct bench_place *place) {
    static const char *const git[] = {"git", "rev-parse", "--short", "HEAD", NULL};
    static const char *const day[] = {"date", "-u", "+%Y-%m-%dT%H:%MZ", NULL};
    struct utsname system = {.release = "unknown"};
    first_line(day, place->date, sizeof place->date);
    first_line(git, place->commit, sizeof place->commit);
    processor(place->cpu, sizeof place->cpu);
    uname(&system);
    snprintf(place->system, sizeof place->system, "gcc " __VERSION__ ", -O2, kernels -O3; Linux %s",
             system.release);
}
