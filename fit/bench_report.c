#include "fit/bench_report.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "fit/bench_place.h"
#include "fit/solve.h"
#include "proto/figure.h"

#define EQUAL_COST                                                                                           \
    1e-8 /* of chi-square: 1e-3 u or less; beyond it two fits are not the same, and no ratio is given */

static const struct {
    const char *solver, *kernel;
} rows[] = {
    {"TinySolver", "goniod"},
    {"Solver dense QR", "goniod"},
    {"Solver normal Cholesky", "goniod"},
    {"variable projection", "goniod"},
    {"MINPACK lmder", "goniod"},
    {"MINPACK lmder", "plain"},
    {"GSL multifit", "goniod"},
    {"GSL multifit", "plain"},
    {"scipy lm", "numpy"},
    {"scipy trf", "numpy"},
};
#define ROWS (sizeof rows / sizeof *rows)

static bool equal_cost(const struct bench_record *a, const struct bench_record *b) {
    return a && b && fabs(a->chi2 - b->chi2) <= EQUAL_COST * fabs(b->chi2);
}

static void write_machine(FILE *md, const struct bench_results *r) {
    static const char *const width[] = {"SSE2", "AVX2", "AVX-512"};
    struct bench_place place;
    double load[3] = {0};
    bench_place_find(&place);
    getloadavg(load, 3);
    fprintf(
        md,
        "# Error against run time\n\n"
        "Written by `goniofit bench`; every figure below is of this one run, one thread.\n\n"
        "- date: %s, goniod " GONIOD_VERSION ", commit %s\n"
        "- CPU: %s; kernel as wide as %s; load average at the end %.2f\n"
        "- compiler: %s\n"
        "- libraries: %s; %s\n"
        "- cold: from the start, warm: from the optimum without the last point (TinySolver keeps the "
        "sums of its "
        "last pass, the others have no use for them); medians of %d fits each, "
        "the quietest of %d rounds over all solvers (joint fit: medians of 31; scipy, and the cost against "
        "points and bands: one round), every fit timed by itself, geometry and weights ready (%.1f us for "
        "198 points)\n\n",
        place.date, place.commit, place.cpu, width[reflectance_batch_width()], load[0], place.system,
        solve_name(SOLVE_QR), r->of_fits.versions[0] ? r->of_fits.versions : "no others were found",
        r->repeats, r->rounds, r->geometry_us);
}

struct ratio { /* the least favourable one over the published sets */
    double worst;
    bool found, unequal;
};

static void take_ratio(struct ratio *r, double value, bool equal) {
    r->unequal = r->unequal || !equal;
    r->worst = r->found ? fmin(r->worst, value) : value;
    r->found = true;
}

static struct ratio against(const struct bench_results *r, const char *solver, const char *kernel) {
    struct ratio ratio = {0};
    for (int i = 0; i < r->n_published; i++) {
        const char *of = r->fits[i].name;
        const struct bench_record *tiny = bench_find(&r->of_fits, of, "TinySolver", NULL, BENCH_COLD);
        const struct bench_record *other = bench_find(&r->of_fits, of, solver, kernel, BENCH_COLD);
        if (tiny && other) {
            take_ratio(&ratio, other->t_us / tiny->t_us, equal_cost(tiny, other));
        }
    }
    return ratio;
}

static void write_target(FILE *md, const char *figure, const char *target, const struct ratio *r,
                         double limit, bool at_most) {
    if (!r->found || r->unequal) {
        fprintf(md, "| %s | %s | %s | not met |\n", figure, target,
                r->found ? "final costs differ: no ratio" : "not measured");
        return;
    }
    const bool met = at_most ? r->worst <= limit : r->worst >= limit;
    fprintf(md, "| %s | %s | %.3g | %s |\n", figure, target, r->worst, met ? "met" : "**not met**");
}

static void write_targets(FILE *md, const struct bench_results *r) {
    struct ratio slowest = {0}, warm = {0}, joint = {0};
    for (int i = 0; i < r->n_published; i++) {
        const char *of = r->fits[i].name;
        const struct bench_record *c = bench_find(&r->of_fits, of, "TinySolver", NULL, BENCH_COLD);
        const struct bench_record *w = bench_find(&r->of_fits, of, "TinySolver", NULL, BENCH_WARM);
        if (c && w) {
            slowest = (struct ratio){fmax(slowest.worst, c->t_us), true, slowest.unequal};
            warm =
                (struct ratio){fmax(warm.worst, w->t_us / c->t_us), true, warm.unequal || !equal_cost(c, w)};
        }
    }
    const struct bench_record *all = bench_find(&r->of_bands, "81", "variable projection", NULL, BENCH_COLD);
    const struct bench_record *one = bench_find(&r->of_fits, "60 %", "TinySolver", NULL, BENCH_COLD);
    if (all && one) {
        joint = (struct ratio){all->t_us / one->t_us, true, false};
    }
    struct ratio plain = against(r, "MINPACK lmder", "plain"), kernel = against(r, "MINPACK lmder", "goniod");
    fprintf(
        md,
        "## Figures to reach\n\n198 points, 5 parameters, start 15 %% off; the least favourable of the four "
        "published sets.\n\n| figure | to reach | measured | |\n|---|---|---|---|\n");
    write_target(md, "cold TinySolver against lmder with a plain scalar model, times faster", "at least 5",
                 &plain, 5, false);
    write_target(md, "the same, lmder with goniod's kernel", "at least 3", &kernel, 3, false);
    write_target(md, "cold fit, us", "20 (aim)", &slowest, 20, true);
    write_target(md, "warm refit after one more point, of the cold fit", "at most 0.4", &warm, 0.4, true);
    write_target(md, "joint fit of 81 bands x 198 points, of one band's cold fit", "at most 100", &joint, 100,
                 true);
}

static void write_cell(FILE *md, const struct bench_record *r, const struct bench_case *c) {
    if (!r) {
        fputs(" - |", md);
        return;
    }
    const double over = (r->chi2 - c->chi2) / c->chi2;
    fprintf(md, " %.4g%s |", r->t_us, fabs(over) <= EQUAL_COST ? "" : " (other cost)");
}

static void write_times(FILE *md, const struct bench_results *r, enum bench_what what, const char *title) {
    fprintf(md, "\n## %s, us\n\n| solver | model |", title);
    for (int i = 0; i < r->n_fits; i++) {
        fprintf(md, " %s |", r->fits[i].name);
    }
    fputs("\n|---|---|", md);
    for (int i = 0; i < r->n_fits; i++) {
        fputs("---|", md);
    }
    fputc('\n', md);
    for (size_t row = 0; row < ROWS; row++) {
        fprintf(md, "| %s | %s |", rows[row].solver, rows[row].kernel);
        for (int i = 0; i < r->n_fits; i++) {
            write_cell(md, bench_find(&r->of_fits, r->fits[i].name, rows[row].solver, rows[row].kernel, what),
                       &r->fits[i]);
        }
        fputc('\n', md);
    }
}

static void write_sizes(FILE *md, const struct bench_records *records, const char *unit) {
    fprintf(md, "\n| %s | solver | model | us | us a %s |\n|---|---|---|---|---|\n", unit, unit);
    for (size_t i = 0; i < records->n; i++) {
        const struct bench_record *x = &records->item[i];
        if (x->what == BENCH_COLD) {
            fprintf(md, "| %s | %s | %s | %.4g | %.3g |\n", x->of, x->solver, x->kernel, x->t_us,
                    x->t_us / atof(x->of));
        }
    }
}

/* Distances of x in units of one u each, by the cost: sqrt(chi2(x) - chi2 min). */
static double from_optimum(const struct bench_record *r, const struct bench_case *c) {
    return sqrt(fmax(r->chi2 - c->chi2, 1e-16 * c->chi2));
}

/* Largest relative error of a parameter (of n - 1, and of A at 45 deg). */
static double from_truth(const struct bench_record *r, const struct bench_case *c) {
    double worst = 0;
    for (int j = 0; j < c->p.k && c->has_truth; j++) {
        worst = fmax(worst, fabs(expm1(r->x[j] - c->truth[j])));
    }
    return worst;
}

static int draw_case(const struct bench_results *r, const struct bench_case *c, int number, const char *dir,
                     struct err *e) {
    struct figure f;
    char name[32];
    snprintf(name, sizeof name, "convergence_%d", number);
    int status = figure_begin(&f, dir, name, "solver,model,t_us,chi2,distance_optimum_u,distance_truth", e);
    if (status) {
        return status;
    }
    figure_panels(&f, 1, c->has_truth ? 2 : 1, c->has_truth ? 1100 : 620, 460);
    char title[ROWS][64];
    int n = 0;
    for (size_t row = 0; row < ROWS; row++) {
        bool any = false;
        for (size_t i = 0; i < r->of_fits.n; i++) {
            const struct bench_record *x = &r->of_fits.item[i];
            if (x->what == BENCH_TRACE && strcmp(x->of, c->name) == 0 &&
                strcmp(x->solver, rows[row].solver) == 0 && strcmp(x->kernel, rows[row].kernel) == 0) {
                fprintf(f.csv, "%s,%s,%.4f,%.17g,%.6g,%.6g\n", x->solver, x->kernel, x->t_us, x->chi2,
                        from_optimum(x, c), from_truth(x, c));
                any = true;
            }
        }
        if (any) {
            snprintf(title[n++], sizeof title[0], "%s (%s model)", rows[row].solver, rows[row].kernel);
            figure_next_block(&f);
        }
    }
    for (int panel = 0; panel < (c->has_truth ? 2 : 1); panel++) {
        fprintf(f.gp,
                "set logscale xy\nset format y \"%%.0e\"\nset title \"%s\"\nset xlabel \"us\"\nset ylabel "
                "\"%s\"\n"
                "set key outside below maxcols 2\nplot ",
                c->name, panel ? "largest relative error against the truth" : "distance to the optimum / u");
        for (int i = 0; i < n; i++) {
            fprintf(f.gp, "%sdata index %d using 3:%d with linespoints pt 7 ps 0.4 title \"%s\"",
                    i ? ", " : "", i, panel ? 6 : 5, title[i]);
        }
        fputs("\nunset logscale\n", f.gp);
    }
    return figure_end(&f, e);
}

static int draw_sizes(const struct bench_records *records, const char *name, const char *unit,
                      const char *dir, struct err *e) {
    struct figure f;
    char title[ROWS][64];
    int n = 0, status = figure_begin(&f, dir, name, "solver,model,size,t_us,chi2", e);
    if (status) {
        return status;
    }
    figure_panels(&f, 1, 1, 700, 480);
    for (size_t row = 0; row < ROWS; row++) {
        bool any = false;
        for (size_t i = 0; i < records->n; i++) {
            const struct bench_record *x = &records->item[i];
            if (x->what == BENCH_COLD && strcmp(x->solver, rows[row].solver) == 0 &&
                strcmp(x->kernel, rows[row].kernel) == 0) {
                fprintf(f.csv, "%s,%s,%s,%.4f,%.17g\n", x->solver, x->kernel, x->of, x->t_us, x->chi2);
                any = true;
            }
        }
        if (any) {
            snprintf(title[n++], sizeof title[0], "%s (%s model)", rows[row].solver, rows[row].kernel);
            figure_next_block(&f);
        }
    }
    fprintf(f.gp, "set logscale xy\nset xlabel \"%s\"\nset ylabel \"cold fit / us\"\nset key top left\nplot ",
            unit);
    for (int i = 0; i < n; i++) {
        fprintf(f.gp, "%sdata index %d using 3:4 with linespoints pt 7 ps 0.5 title \"%s\"", i ? ", " : "", i,
                title[i]);
    }
    fputs("\nunset logscale\n", f.gp);
    return figure_end(&f, e);
}

static int draw_all(const struct bench_results *r, const char *dir, struct err *e) {
    int status = 0;
    for (int i = 0; i < r->n_fits && !status; i++) {
        status = draw_case(r, &r->fits[i], i, dir, e);
    }
    if (!status && !(status = draw_sizes(&r->of_points, "points", "points", dir, e)) && r->of_bands.n) {
        status = draw_sizes(&r->of_bands, "bands", "bands", dir, e);
    }
    return status;
}

static void write_body(FILE *md, const struct bench_results *r, const struct err *drawing) {
    write_machine(md, r);
    write_targets(md, r);
    write_times(md, r, BENCH_COLD, "Cold fit");
    write_times(md, r, BENCH_WARM, "Warm refit after one more point");
    fputs("\nModel: goniod is the kernel of fit/reflectance_batch.h; plain, the same formulas one point "
          "after the other "
          "(tests/bench/fit_peers.c); numpy, array by array. All fit the same "
          "coordinates, from the same start, with the same weights. Measured surfaces start where an "
          "estimation does and "
          "have no truth. \"other cost\": the fit ended elsewhere, by more "
          "than 1e-8 of "
          "chi-square.\n",
          md);
    fputs("\n## Distance against time\n\n", md);
    for (int i = 0; i < r->n_fits; i++) {
        fprintf(md, "![%s](fit-report/convergence_%d.svg)\n\n", r->fits[i].name, i);
    }
    fputs("Left: distance to the optimum, sqrt(chi-square - its minimum), which is in units of u; its floor, "
          "1e-8 of the root of chi-square, is the "
          "rounding of the cost. Right: largest relative error of a parameter against the truth; noise keeps "
          "it up.\n"
          "\n## Cost against points\n\n![points](fit-report/points.svg)\n",
          md);
    write_sizes(md, &r->of_points, "points");
    if (r->of_bands.n) {
        fputs("\n## Cost against bands\n\nJoint fit of 198 points by variable projection: sigma, gamma, "
              "beta', n shared, "
              "one S a band.\n\n![bands](fit-report/bands.svg)\n",
              md);
        write_sizes(md, &r->of_bands, "bands");
    }
    if (drawing->code) {
        fprintf(md, "\nThe plots could not be drawn: %s\n", drawing->text);
    }
}

int bench_report_write(const struct bench_results *r, const char *dir, struct err *e) {
    char path[300];
    struct err drawing = {0};
    snprintf(path, sizeof path, "%s/fit-report", dir);
    if (mkdir(path, 0777) != 0 && errno != EEXIST) {
        return err_errno(e, ERR_IO, errno, "cannot make the directory %s", path);
    }
    draw_all(r, path, &drawing);
    snprintf(path, sizeof path, "%s/fit-report.md", dir);
    FILE *md = fopen(path, "w");
    if (!md) {
        return err_errno(e, ERR_IO, errno, "cannot write %s", path);
    }
    write_body(md, r, &drawing);
    return fclose(md) ? err_errno(e, ERR_IO, errno, "cannot write %s", path) : 0;
}
