#include "fit/bench_run.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/joint_solve.h"
#include "fit/solve.h"
#include "fit/stopwatch.h"
#include "proto/process.h"

#define REPEATS_MAX 2001

static const struct {
    enum solve_method method;
    const char *name;
} ours[] = {
    {SOLVE_TINY, "TinySolver"}, {SOLVE_QR, "Solver dense QR"}, {SOLVE_CHOLESKY, "Solver normal Cholesky"}};

static int ascending(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double bench_median(double *value, int n) {
    qsort(value, (size_t)n, sizeof *value, ascending);
    return value[n / 2];
}

/* The machine has quiet and busy moments, longer than a median takes: of several rounds the quietest counts. */
static int add(struct bench_records *r, const struct bench_record *record, struct err *e) {
    const struct bench_record *before = NULL;
    if (r->again) {
        before = bench_find(r, record->of, record->solver, record->kernel, record->what);
    }
    if (before) {
        struct bench_record *kept = &r->item[before - r->item];
        kept->t_us = record->what == BENCH_TRACE ? kept->t_us : fmin(kept->t_us, record->t_us);
        return 0;
    }
    if (r->n == r->capacity) {
        size_t capacity = r->capacity ? 2 * r->capacity : 64;
        struct bench_record *item = realloc(r->item, capacity * sizeof *item);
        if (!item) {
            return err_set(e, ERR_NOMEM, "no memory for %zu figures", capacity);
        }
        r->item = item;
        r->capacity = capacity;
    }
    r->item[r->n++] = *record;
    return 0;
}

static struct bench_record begin(const struct bench_case *c, const char *solver, enum bench_what what) {
    struct bench_record record = {.what = what};
    snprintf(record.of, sizeof record.of, "%s", c->name);
    snprintf(record.solver, sizeof record.solver, "%s", solver);
    snprintf(record.kernel, sizeof record.kernel, "goniod");
    return record;
}

/* Cold from the start; warm from the optimum without the last point, and TinySolver from what that fit left. */
static int fit_once(const struct bench_case *c, enum solve_method method, enum bench_what what,
                    struct solve_result *result, struct err *e) {
    if (what == BENCH_WARM && method == SOLVE_TINY) {
        memcpy(result->x, c->warm, sizeof result->x);
        return solve_more(&c->p, &c->left, result, e);
    }
    return solve_by(method, &c->p, what == BENCH_WARM ? c->warm : c->start, NULL, result, NULL, e);
}

static int time_one(const struct bench_case *c, size_t of, enum bench_what what, int repeats,
                    struct bench_records *records, struct err *e) {
    double t_us[REPEATS_MAX];
    struct solve_result result = {0};
    for (int i = -1; i < repeats; i++) { /* one more to warm up */
        const double begun = stopwatch_s();
        int status = fit_once(c, ours[of].method, what, &result, e);
        if (status) {
            return status;
        }
        t_us[i < 0 ? 0 : i] = 1e6 * (stopwatch_s() - begun);
    }
    struct bench_record record = begin(c, ours[of].name, what);
    record.t_us = bench_median(t_us, repeats);
    record.chi2 = result.chi2;
    record.evaluations = result.iterations;
    memcpy(record.x, result.x, sizeof record.x);
    return add(records, &record, e);
}

static int trace_one(const struct bench_case *c, size_t of, struct bench_records *records, struct err *e) {
    struct estimate_trace trace = {0};
    struct solve_result result;
    int status = solve_by(ours[of].method, &c->p, c->start, NULL, &result, &trace, e);
    for (size_t i = 0; i < trace.n && !status; i++) {
        struct bench_record record = begin(c, ours[of].name, BENCH_TRACE);
        record.t_us = trace.step[i].t_us;
        record.chi2 = 2 * trace.step[i].cost;
        record.evaluations = (int)i + 1;
        memcpy(record.x, trace.step[i].x, sizeof record.x);
        status = add(records, &record, e);
    }
    return status;
}

int bench_run_ours(const struct bench_case *c, int repeats, struct bench_records *records, struct err *e) {
    int status = 0;
    repeats = repeats < REPEATS_MAX ? repeats : REPEATS_MAX;
    for (size_t i = 0; i < sizeof ours / sizeof *ours && !status; i++) {
        if (!(status = time_one(c, i, BENCH_COLD, repeats, records, e)) &&
            !(status = time_one(c, i, BENCH_WARM, repeats, records, e))) {
            status = trace_one(c, i, records, e);
        }
    }
    return status;
}

static int time_joint(const struct bench_case *c, const struct joint_data *data, const double *start,
                      enum bench_what what, int repeats, struct bench_records *records, struct err *e) {
    double t_us[REPEATS_MAX];
    struct joint_solution found = {0};
    for (int i = 0; i < repeats; i++) {
        const double begun = stopwatch_s();
        int status = joint_solve(data, start, false, &found, NULL, e);
        if (status) {
            return status;
        }
        t_us[i] = 1e6 * (stopwatch_s() - begun);
    }
    struct bench_record record = begin(c, "variable projection", what);
    record.t_us = bench_median(t_us, repeats);
    record.chi2 = found.chi2;
    record.evaluations = found.evaluations;
    memcpy(record.x, found.x, sizeof record.x);
    return add(records, &record, e);
}

int bench_run_joint(const struct bench_case *c, int repeats, struct bench_records *records, struct err *e) {
    double value[MATERIAL_PARAMETERS];
    struct joint_data data;
    struct problem p = c->p; /* evaluated: its arrays are the case's, its points the same */
    coordinates_to_value(p.model, c->start, value);
    int status = problem_evaluate(&p, value, e);
    if (status || (status = joint_data_init(&data, &p, e))) {
        return status;
    }
    status = time_joint(c, &data, c->start, BENCH_COLD, repeats, records, e);
    status = status ? status : time_joint(c, &data, c->warm, BENCH_WARM, repeats, records, e);
    joint_data_free(&data);
    return status;
}

static void write_numbers(FILE *f, const char *name, const double *x, int k) {
    fprintf(f, "# %s", name);
    for (int j = 0; j < k; j++) {
        fprintf(f, " %.17g", x[j]);
    }
    fputc('\n', f);
}

static int write_case(const struct bench_case *c, const char *path, struct err *e) {
    FILE *f = fopen(path, "w");
    if (!f) {
        return err_errno(e, ERR_IO, errno, "cannot write %s", path);
    }
    write_numbers(f, "start", c->start, c->p.k);
    write_numbers(f, "warm", c->warm, c->p.k);
    fputs("theta_i_deg,theta_v_deg,beta,u\n", f);
    for (size_t i = 0; i < c->p.n; i++) {
        const struct estimate_input *in = c->p.input;
        fprintf(f, "%.17g,%.17g,%.17g,%.17g\n", in->theta_i_deg[i], in->theta_v_deg[i], in->beta[i],
                c->p.u[i]);
    }
    return fclose(f) ? err_errno(e, ERR_IO, errno, "cannot write %s", path) : 0;
}

static int take_record(const struct bench_case *c, char *line, struct bench_records *records, struct err *e) {
    static const char *const whats[] = {"cold", "warm", "trace"};
    struct bench_record record = begin(c, "", BENCH_COLD);
    char what[8] = "";
    int used = 0, got = sscanf(line, "%39[^,],%11[^,],%7[^,],%lf,%lf,%d%n", record.solver, record.kernel,
                               what, &record.t_us, &record.chi2, &record.evaluations, &used);
    int kind = 0;
    while (kind < 3 && strcmp(what, whats[kind]) != 0) {
        kind++;
    }
    if (got != 6 || kind == 3) {
        return err_set(e, ERR_INPUT, "the others' program printed '%.80s', which is no record", line);
    }
    record.what = (enum bench_what)kind;
    char *at = line + used;
    for (int j = 0; j < c->p.k && *at == ','; j++) {
        record.x[j] = strtod(at + 1, &at);
    }
    return add(records, &record, e);
}

int bench_run_others(const struct bench_case *c, const char *const *command, int repeats, const char *dir,
                     struct bench_records *records, struct err *e) {
    char path[400], count[16], line[512];
    const char *argv[8] = {0};
    size_t n = 0;
    snprintf(path, sizeof path, "%s/.goniofit-bench-case.csv", dir);
    snprintf(count, sizeof count, "%d", repeats);
    int status = write_case(c, path, e);
    for (; command[n] && n < 4; n++) {
        argv[n] = command[n];
    }
    argv[n++] = path;
    argv[n] = count;
    FILE *out = tmpfile();
    if (!out) {
        status = err_errno(e, ERR_IO, errno, "cannot make a temporary file");
    }
    status = status ? status : process_run(argv, fileno(out), e);
    if (!status) {
        rewind(out);
    }
    while (!status && fgets(line, sizeof line, out)) {
        line[strcspn(line, "\n")] = '\0';
        if (strncmp(line, "# ", 2) == 0) {
            if (!strstr(records->versions, line + 2)) {
                size_t used = strlen(records->versions);
                snprintf(records->versions + used, sizeof records->versions - used, "%s%s", used ? ", " : "",
                         line + 2);
            }
            continue;
        }
        status = take_record(c, line, records, e);
    }
    if (out) {
        fclose(out);
    }
    remove(path);
    return status;
}

const struct bench_record *bench_find(const struct bench_records *records, const char *of, const char *solver,
                                      const char *kernel, enum bench_what what) {
    for (size_t i = 0; i < records->n; i++) {
        const struct bench_record *r = &records->item[i];
        if (r->what == what && strcmp(r->of, of) == 0 && strcmp(r->solver, solver) == 0 &&
            (!kernel || strcmp(r->kernel, kernel) == 0)) {
            return r;
        }
    }
    return NULL;
}

void bench_records_free(struct bench_records *records) {
    free(records->item);
    *records = (struct bench_records){0};
}
