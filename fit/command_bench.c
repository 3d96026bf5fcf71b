#include "fit/commands.h"

#include <errno.h>
#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit/bench_report.h"
#include "fit/stopwatch.h"

#define SEED 1 /* fixed before any figure was seen */

static const char help[] =
    "usage: goniofit bench [-o DIR] [--others PROGRAM] [--scipy SCRIPT] [--data DIR] [--quick]\n"
    "Error against run time: goniod's solvers, and those of other libraries where their program is found.\n"
    "  -o DIR            where fit-report.md and fit-report/ are written; default: docs\n"
    "  --others PROGRAM  default: tests/bench/fit_peers beside this program (make bench builds it)\n"
    "  --scipy SCRIPT    default: tests/bench/fit_scipy.py\n"
    "  --data DIR        painted surfaces as .brdf; default: ../shared/data/brdf/painted\n"
    "  --quick           few repeats and small sizes: whether it works, not how fast it is\n"
    "exit status: 0 done, 1 the work failed, 2 bad usage or bad input\n";

struct options {
    const char *dir, *others, *scipy, *data;
    bool quick;
};

/* 1: help was asked for and printed. */
static int read_options(int argc, char **argv, struct options *o, struct err *e) {
    static const struct option known[] = {
        {"others", required_argument, NULL, 'p'}, {"scipy", required_argument, NULL, 's'},
        {"data", required_argument, NULL, 'd'},   {"quick", no_argument, NULL, 'q'},
        {"help", no_argument, NULL, 'h'},         {NULL, 0, NULL, 0}};
    optind = 1;
    for (int c; (c = getopt_long(argc, argv, "o:", known, NULL)) != -1;) {
        switch (c) {
        case 'o':
            o->dir = optarg;
            break;
        case 'p':
            o->others = optarg;
            break;
        case 's':
            o->scipy = optarg;
            break;
        case 'd':
            o->data = optarg;
            break;
        case 'q':
            o->quick = true;
            break;
        case 'h':
            fputs(help, stdout);
            return 1;
        default:
            return err_set(e, ERR_USAGE, "see goniofit bench --help");
        }
    }
    return optind == argc ? 0
                          : err_set(e, ERR_USAGE, "goniofit bench takes no file; see goniofit bench --help");
}

/* tests/bench/fit_peers in the build directory that holds this program. */
static const char *default_others(char *path, size_t size) {
    ssize_t n = readlink("/proc/self/exe", path, size - 1);
    path[n > 0 ? n : 0] = '\0';
    char *slash = strrchr(path, '/');
    size_t at = slash ? (size_t)(slash - path) : 0;
    snprintf(path + at, size - at, "/tests/bench/fit_peers");
    return path;
}

static int run_others(const struct bench_case *c, const struct options *o, int repeats,
                      struct bench_records *records, struct err *e) {
    const char *const program[] = {o->others, NULL}, *const script[] = {"/usr/bin/python3", o->scipy, NULL};
    int status = access(o->others, X_OK) ? 0 : bench_run_others(c, program, repeats, o->dir, records, e);
    struct err missing = {0}; /* scipy may not be installed: its rows are then left out */
    if (!status && !records->again && access(o->scipy, R_OK) == 0) {
        bench_run_others(c, script, o->quick ? 1 : 31, o->dir, records, &missing);
    }
    return status;
}

static int time_geometry(const struct bench_case *c, double *t_us, struct err *e) {
    double all[101];
    int status = 0;
    for (int i = 0; i < 101 && !status; i++) {
        struct problem p;
        const double begun = stopwatch_s();
        status = problem_init(&p, c->p.input, e);
        all[i] = 1e6 * (stopwatch_s() - begun);
        problem_free(&p);
    }
    *t_us = bench_median(all, 101);
    return status;
}

static int run_round(struct bench_results *r, const struct options *o, struct err *e) {
    int status = 0;
    for (int i = 0; i < r->n_fits && !status; i++) {
        if (!(status = bench_run_ours(&r->fits[i], r->repeats, &r->of_fits, e))) {
            status = run_others(&r->fits[i], o, r->repeats, &r->of_fits, e);
        }
        if (!status && i < r->n_published) {
            status = bench_run_joint(&r->fits[i], r->repeats / 10 + 1, &r->of_fits, e);
        }
    }
    return status;
}

static int run_fits(struct bench_results *r, const struct options *o, struct err *e) {
    static const char *const painted[] = {"garnet_red.brdf", "krylon_blue.brdf"};
    int status = 0;
    for (int i = 0; i < PUBLISHED_SETS && !status; i++) {
        status = bench_case_make(&r->fits[r->n_fits++], &published[i], 0, 1, SEED + (uint64_t)i, e);
    }
    r->n_published = r->n_fits;
    for (size_t i = 0; i < 2 && !status; i++) {
        char path[400];
        snprintf(path, sizeof path, "%s/%s", o->data, painted[i]);
        if (access(path, R_OK) == 0) {
            status = bench_case_read(&r->fits[r->n_fits++], path, e);
        }
    }
    for (int i = 0; i < r->n_fits && !status; i++) {
        status = bench_case_settle(&r->fits[i], e);
    }
    for (int round = 0; round < r->rounds && !status; round++) {
        fprintf(stderr, "round %d of %d ...\n", round + 1, r->rounds);
        r->of_fits.again = round > 0;
        status = run_round(r, o, e);
    }
    return status ? status : time_geometry(&r->fits[0], &r->geometry_us, e);
}

static int run_points(struct bench_results *r, const struct options *o, struct err *e) {
    static const size_t sizes[] = {10, 30, 100, 300, 1000, 10000, 100000, 1000000};
    int status = 0;
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes && !status && sizes[i] <= (o->quick ? 100 : 1000000);
         i++) {
        struct bench_case c;
        const int repeats = (int)fmax(3, fmin(r->repeats, 1e5 / (double)sizes[i]));
        status = bench_case_make(&c, &published[2], sizes[i], 0, SEED, e);
        snprintf(c.name, sizeof c.name, "%zu", sizes[i]);
        fprintf(stderr, "%s points ...\n", c.name);
        if (!status && !(status = bench_case_settle(&c, e)) &&
            !(status = bench_run_ours(&c, repeats, &r->of_points, e)) && sizes[i] <= 10000) {
            status = run_others(&c, o, repeats, &r->of_points, e);
        }
        bench_case_free(&c);
    }
    return status;
}

static int run_bands(struct bench_results *r, const struct options *o, struct err *e) {
    static const int bands[] = {1, 3, 9, 27, 81};
    int status = 0;
    for (size_t i = 0; i < sizeof bands / sizeof *bands && !status; i++) {
        struct bench_case c;
        status = bench_case_make(&c, &published[2], 0, bands[i], SEED, e);
        snprintf(c.name, sizeof c.name, "%d", bands[i]);
        fprintf(stderr, "%s bands ...\n", c.name);
        if (!status && !(status = bench_case_settle(&c, e))) {
            status = bench_run_joint(&c, o->quick ? 2 : 31, &r->of_bands, e);
        }
        bench_case_free(&c);
    }
    return status;
}

int command_bench(int argc, char **argv) {
    char beside[400];
    struct options o = {.dir = "docs",
                        .others = default_others(beside, sizeof beside),
                        .scipy = "tests/bench/fit_scipy.py",
                        .data = "../shared/data/brdf/painted"};
    struct bench_results r = {0};
    struct err e = {0};
    int status = read_options(argc, argv, &o, &e);
    if (status) {
        return status > 0 ? 0 : command_complain("bench", &e);
    }
    if (access(o.dir, W_OK) != 0) {
        err_errno(&e, ERR_IO, errno, "cannot write in %s", o.dir);
        return command_complain("bench", &e);
    }
    r.repeats = o.quick ? 3 : 301;
    r.rounds = o.quick ? 1 : 9;
    r.fits = calloc(BENCH_CASES_MAX, sizeof *r.fits);
    status = r.fits ? run_fits(&r, &o, &e) : err_set(&e, ERR_NOMEM, "no memory for the cases");
    if (!status && !(status = run_points(&r, &o, &e)) && !(status = run_bands(&r, &o, &e))) {
        status = bench_report_write(&r, o.dir, &e);
    }
    for (int i = 0; r.fits && i < r.n_fits; i++) {
        bench_case_free(&r.fits[i]);
    }
    free(r.fits);
    bench_records_free(&r.of_fits);
    bench_records_free(&r.of_points);
    bench_records_free(&r.of_bands);
    return status ? command_complain("bench", &e) : 0;
}
