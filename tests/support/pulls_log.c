#include "tests/support/pulls_log.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define K DATASET_PARAMETERS

static const char *const PARTS[PULLS_PARTS] = {"with", "without"};

struct row {
    int seed;
    char parts[16], sample[64];
    struct pull pull;
};

static void append(const char *path, const char *text) {
    int fd = open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    if (fd < 0 || write(fd, text, strlen(text)) != (ssize_t)strlen(text) || close(fd) != 0)
        fail_msg("%s cannot be written", path);
}

static FILE *open_rows(const char *path, char *bench, int size) {
    FILE *in = fopen(path, "re");
    if (in && !fgets(bench, size, in))
        bench[0] = 0;
    return in;
}

static bool read_row(FILE *in, struct row *r) {
    return fscanf(in, "%d,%15[^,],%63[^,],%lf,%lf,%lf,%lf,%lf,%lf", &r->seed, r->parts, r->sample,
                  &r->pull.of[0], &r->pull.of[1], &r->pull.of[2], &r->pull.of[3], &r->pull.of[4],
                  &r->pull.distance2) == 9;
}

void pulls_log_open(const char *path, const char *bench) {
    char line[128], expected[128];
    FILE *in = open_rows(path, line, sizeof line);
    snprintf(expected, sizeof expected, "# %s\n", bench);
    if (!in) {
        append(path, expected);
        return;
    }
    fclose(in);
    if (strcmp(line, expected) != 0)
        fail_msg("%s begins with \"%s\", not with \"%s\": it is of another bench", path, line, expected);
}

void pulls_log_add(const char *path, int seed, enum pulls_parts parts, const char *const *sample,
                   const struct pull *pull, int n_samples) {
    char *text = NULL;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    for (int i = 0; i < n_samples; i++) {
        fprintf(out, "%d,%s,%s", seed, PARTS[parts], sample[i]);
        for (int k = 0; k < K; k++)
            fprintf(out, ",%.6g", pull[i].of[k]);
        fprintf(out, ",%.6g\n", pull[i].distance2);
    }
    fclose(out);
    append(path, text);
    free(text);
}

bool pulls_log_has(const char *path, int seed, enum pulls_parts parts) {
    char line[128];
    struct row r;
    bool found = false;
    FILE *in = open_rows(path, line, sizeof line);
    assert_non_null(in);
    while (!found && read_row(in, &r))
        found = r.seed == seed && !strcmp(r.parts, PARTS[parts]);
    fclose(in);
    return found;
}

static int sample_of(struct pulls *p, const char *name) {
    for (int i = 0; i < p->n_samples; i++)
        if (!strcmp(p->sample[i], name))
            return i;
    assert_in_range(p->n_samples, 0, PULLS_SAMPLES - 1);
    strcpy(p->sample[p->n_samples], name);
    return p->n_samples++;
}

void pulls_log_read(const char *path, int first, int n, struct pulls *p) {
    static int at[PULLS_SEEDS];
    char line[128];
    struct row r;
    FILE *in = open_rows(path, line, sizeof line);
    assert_non_null(in);
    assert_in_range(n, 1, PULLS_SEEDS);
    memset(at, -1, sizeof at);
    while (read_row(in, &r)) {
        const int place = r.seed - first;
        if (strcmp(r.parts, PARTS[p->parts]) != 0 || place < 0 || place >= n)
            continue;
        if (at[place] < 0)
            at[place] = p->n_seeds++;
        p->pull[at[place]][sample_of(p, r.sample)] = r.pull;
    }
    fclose(in);
}
