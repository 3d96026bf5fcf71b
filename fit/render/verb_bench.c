#include "fit/render/verbs.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit/bench_place.h"
#include "fit/render/bench.h"
#include "fit/render/embree.h"
#include "fit/render/image.h"

static const char help[] =
    "usage: goniorender bench [-o REPORT.md] [--csv ROWS.csv] [--plot PLOT.svg] [--quick]\n"
    "Measures error against run time on this machine: every scene against a reference of its own, processes "
    "of 1 and 2\n"
    "threads, what each left-out part costs, POV-Ray beside it where it is installed.\n"
    "  -o REPORT.md   default: on stdout\n"
    "  --csv, --plot  the rows of the errors; log-log, drawn by gnuplot\n"
    "  --quick        small pictures: whether it works, not how fast\n";

static const struct bench_size whole = {100, 1000, 40, 64, 9, 32, 32768, 256, 768},
                               quick = {24, 60, 8, 8, 1, 8, 256, 1, 48};

struct bench {
    const char *report, *csv, *plot;
    char folder[64], self[512];
    const struct bench_size *size;
    FILE *out, *rows;
};

static int take_option(int c, void *arg, struct err *e) {
    struct bench *b = arg;
    (void)e;
    switch (c) {
    case 'o':
        b->report = optarg;
        return 0;
    case 'c':
        b->csv = optarg;
        return 0;
    case 'p':
        b->plot = optarg;
        return 0;
    case 'q':
        b->size = &quick;
        return 0;
    default:
        return 0;
    }
}

/* 1: help was asked for and printed. */
static int read_options(int argc, char **argv, struct bench *b, struct err *e) {
    static const struct option known[] = {
        {"output", required_argument, NULL, 'o'}, {"csv", required_argument, NULL, 'c'},
        {"plot", required_argument, NULL, 'p'},   {"quick", no_argument, NULL, 'q'},
        {"help", no_argument, NULL, 'h'},         {NULL, 0, NULL, 0}};
    int status = verb_options(argc, argv, known, help, take_option, b, e);
    if (!status && optind != argc) {
        status = err_set(e, ERR_USAGE, "'%s' is not expected; see goniorender bench --help", argv[optind]);
    }
    return status;
}

static void print_head(const struct bench *b) {
    struct bench_place place;
    double load[3] = {0};
    getloadavg(load, 3);
    bench_place_find(&place);
    fprintf(
        b->out,
        "# Error against run time of goniorender\n\nWritten by `goniorender bench` %s%s.\n\n"
        "- date: %s, commit %s\n"
        "- compiler: %s\n"
        "- libraries: libpng %s; Embree %s in S5\n"
        "- processor: %s, %ld of them; load average when it began: %.2f %.2f %.2f\n"
        "- a load average near 0 is a free machine; on a shared one wall times grow and CPU times stay\n"
        "- scenes: S1, S2 a cylinder in parallel light, orthographic; S3 a panel under a rectangle light; S4 "
        "a fold;\n"
        "  S5 a mesh in an environment; S6 is `goniorender stability`\n\n",
        GONIOD_VERSION, b->size == &quick ? " --quick: the figures below are worth nothing" : "", place.date,
        place.commit, place.system, image_png_version(), embree_version(), place.cpu,
        sysconf(_SC_NPROCESSORS_ONLN), load[0], load[1], load[2]);
}

static void print_errors(const struct bench *b, const char *name, const struct bench_errors *x) {
    for (int i = 0; i < BENCH_GRIDS; i++) {
        const struct bench_error *r = &x->row[i];
        bool at_floor = x->reference_rmse > r->rmse / 10;
        fprintf(b->out,
                "| %s | %d | %.2e%s | %.2e | %.2e | %.2e | %.2e | %.2e | %.3f | %.3f | %.2f | %.1e |\n", name,
                r->samples, r->rmse, at_floor ? " at reference floor" : "", r->edge_rmse, r->inner_rmse,
                r->relmse, r->largest, x->reference_rmse, r->de_mean, r->de_p95, r->de_largest,
                1 / (r->relmse * r->trace_s));
        if (b->rows) {
            fprintf(b->rows, "%s,%d,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g,%.6g\n", name, r->samples,
                    r->rmse, r->edge_rmse, r->inner_rmse, r->relmse, r->largest, r->de_mean, r->de_p95,
                    r->de_largest, r->trace_s, x->reference_rmse);
        }
    }
    if (b->rows) {
        fputs("\n\n", b->rows); /* gnuplot's next block */
    }
}

static const char *const columns = "| scene | samples | RMSE | at edges | inside | relMSE | max | floor | "
                                   "DE2000 mean | 95 % | max | 1/(relMSE s) |\n"
                                   "|---|---|---|---|---|---|---|---|---|---|---|---|\n";

static int bench_errors_of_all(const struct bench *b, struct err *e) {
    struct bench_errors x[16];
    double apart = 0;
    int status = 0;
    fprintf(b->out,
            "## Errors\n\n%d x %d pixels, linear X, Y, Z of the object's pixels; reference %d jittered "
            "samples a pixel in two\n"
            "halves, everything kept, summed by wavelengths. RMSE and max over the mean Y; relMSE with 1e-4 "
            "of the mean\n"
            "squared. 'floor' is half the distance of the reference's halves.\n\n"
            "%s",
            b->size->error_pixels, b->size->error_pixels, b->size->reference_grid * b->size->reference_grid,
            columns);
    if (b->rows) {
        fputs("scene,samples,rmse,edge_rmse,inner_rmse,relmse,max,de_mean,de_p95,de_max,trace_s,floor\n",
              b->rows);
    }
    for (int i = 0; i < bench_scenes && !status; i++) {
        fprintf(stderr, "errors of %s ...\n", bench_scene[i].name);
        status = bench_error_run(b->folder, &bench_scene[i], b->size, &x[i], e);
        if (!status) {
            print_errors(b, bench_scene[i].name, &x[i]);
            apart = x[i].model_apart > apart ? x[i].model_apart : apart;
        }
    }
    fputs("\nSlope of log RMSE over log samples:", b->out);
    for (int i = 0; i < bench_scenes && !status; i++) {
        fprintf(b->out, "%s %s %.2f", i ? "," : "", bench_scene[i].name, x[i].slope);
    }
    fprintf(b->out,
            ".\n\nOne sample a pixel against `fit/reflectance.h`, which works with angles and is judged "
            "against MPFR:\n"
            "a, b and c (c relative to 1 + c) at most %.1e apart.\n\n",
            apart);
    return status;
}

static int bench_panels_of_all(const struct bench *b, struct err *e) {
    struct bench_panel_errors x[16];
    int status = 0;
    fprintf(
        b->out,
        "## A panel under a rectangle light (S3)\n\n%d x %d points of a panel, at pixel centres, that "
        "mirrors a "
        "light\nof 60 x 60 mm 89 mm away; random samples of the light alone, and of light and facets with "
        "the\n"
        "weight of both. Reference %d jittered samples of either kind in two halves, with its own code for\n"
        "light and lobe, the model by `fit/reflectance.h`, summed by wavelengths.\n\n%s",
        b->size->panel_pixels, b->size->panel_pixels, b->size->reference_grid * b->size->reference_grid,
        columns);
    for (int i = 0; i < bench_panels && !status; i++) {
        fprintf(stderr, "errors of the panel %s ...\n", bench_panel[i].name);
        status = bench_panel_run(b->folder, &bench_panel[i], b->size, &x[i], e);
        for (int k = 0; k < 2 && !status; k++) {
            char name[64];
            snprintf(name, sizeof name, "S3 %s %s%s", bench_panel[i].name, k ? "facets" : "light",
                     x[i].chosen == k ? " (chosen)" : "");
            print_errors(b, name, &x[i].by[k]);
        }
    }
    fputs("\nSlope of log RMSE over log samples, chosen:", b->out);
    for (int i = 0; i < bench_panels && !status; i++) {
        fprintf(b->out, "%s %s %.2f", i ? "," : "", bench_panel[i].name, x[i].by[x[i].chosen].slope);
    }
    fputs("; -0.5 is what independent samples give.\n\n", b->out);
    return status;
}

static int bench_parts(const struct bench *b, struct err *e) {
    struct bench_recolour recolour;
    struct bench_ablation x;
    int status = bench_recolour(b->folder, b->size, &recolour, e);
    if (status) {
        return status;
    }
    fprintf(b->out,
            "| recolour, planes in memory, 1 thread | 3 ms | %.2f ms to linear colour, %.2f ms with 8-bit "
            "codes | %s |\n\n",
            1e3 * recolour.rgb_s, 1e3 * recolour.codes_s, bench_met(recolour.rgb_s <= 3e-3));
    status = bench_ablation(b->folder, b->size, &x, e);
    fprintf(b->out,
            "## What each left-out part would cost\n\nCPU of tracing and colouring, %d x %d pixels, 1 "
            "sample, one thread; bound "
            "printed by the program: %.1e.\n\n| kept although not needed | time | largest change of X, Y, Z "
            "|\n|---|---|---|\n",
            b->size->time_pixels / 2, b->size->time_pixels / 2, x.bound);
    for (int i = 0; i <= FEATURES && !status; i++) {
        if (x.left_out[i]) {
            fprintf(b->out, "| %s | %.2f x | %.1e |\n",
                    i < FEATURES ? feature_name((enum feature)i) : "all of them", x.kept_s[i] / x.lean_s,
                    x.apart[i]);
        }
    }
    return status;
}

static void bench_grids(const struct bench *b) {
    static const struct bench_grid grids[] = {
        {"10 nm", 0, 80, 2}, {"20 nm", 0, 80, 4}, {"400-700 nm at 5 nm", 4, 64, 1}};
    fputs("\n## Wavelengths\n\nLargest change of X, Y, Z of a green over its Y, against 380-780 nm at 5 "
          "nm.\n\n| grid |",
          b->out);
    for (int j = 0; j < CIE_ILLUMINANTS; j++) {
        fprintf(b->out, " %s |", cie_illuminant[j].name);
    }
    fputs("\n|---|---|---|---|---|---|---|\n", b->out);
    for (size_t i = 0; i < sizeof grids / sizeof *grids; i++) {
        fprintf(b->out, "| %s |", grids[i].name);
        for (int j = 0; j < CIE_ILLUMINANTS; j++) {
            fprintf(b->out, " %.1e |", bench_grid_error(&cie_illuminant[j], &grids[i]));
        }
        fputc('\n', b->out);
    }
}

/* Blocks first .. first + n - 1 of the rows; gnuplot takes the words of one string as titles. */
static void draw_blocks(const struct bench *b, FILE *gnuplot, int first, int n, const char *(*name)(int)) {
    const char *head = first == 0 ? "(i==0)" : "0"; /* the first block begins with the names of the columns */
    fprintf(gnuplot, "plot for [i=0:%d] '%s' every ::%s index i+%d using 11:3 with linespoints title word('",
            n - 1, b->csv, head, first);
    for (int i = 0; i < n; i++) {
        for (const char *c = name(i); *c; c++) {
            fputc(*c == ' ' ? '_' : *c, gnuplot);
        }
        fputc(' ', gnuplot);
    }
    fputs("', i+1) noenhanced\n", gnuplot);
}

static const char *cylinder_name(int i) {
    return bench_scene[i].name;
}

static const char *panel_name(int i) {
    static char name[64];
    snprintf(name, sizeof name, "%s %s", bench_panel[i / 2].name, i % 2 ? "facets" : "light");
    return name;
}

/* Without gnuplot there is no plot, and the report says nothing of one. */
static void draw(const struct bench *b) {
    FILE *gnuplot = b->plot && b->csv ? popen("gnuplot 2>/dev/null", "w") : NULL;
    if (!gnuplot) {
        return;
    }
    fprintf(
        gnuplot,
        "set terminal svg size 1700,480 background rgb 'white'\nset output '%s'\nset datafile separator ','\n"
        "set logscale xy\nset xlabel 'CPU time of tracing, s'\nset ylabel 'RMSE over the mean Y'\nset "
        "grid\nset key outside\n"
        "set multiplot layout 1,3\nset title 'cylinder under a beam'\n",
        b->plot);
    draw_blocks(b, gnuplot, 0, bench_scenes, cylinder_name);
    fputs("set title 'panel under a rectangle light (S3)'\n", gnuplot);
    draw_blocks(b, gnuplot, bench_scenes, 2 * bench_panels, panel_name);
    fputs("set title 'fold, 5 bounces (S4)'\n", gnuplot);
    draw_blocks(b, gnuplot, bench_scenes + 2 * bench_panels, BENCH_FOLDS, bench_fold_name);
    if (pclose(gnuplot) == 0) {
        const char *slash = strrchr(b->plot, '/');
        fprintf(b->out,
                "![RMSE against the CPU time of tracing, log-log: 1 to 64 samples, 4 to 256 of the "
                "panel, 4 to 64 of the fold](images/%s)\n\n",
                slash ? slash + 1 : b->plot);
    }
}

static int run_all(struct bench *b, struct err *e) {
    print_head(b);
    int status =
        bench_process_report(b->self, b->folder, b->size, b->out,
                             e); /* first: a child begins with its parent's memory, which counts as its own */
    status = status ? status : bench_parts(b, e);
    status = status ? status : bench_errors_of_all(b, e);
    status = status ? status : bench_panels_of_all(b, e);
    status = status ? status : bench_fold_report(b->folder, b->size, b->out, b->rows, e);
    if (b->rows) {
        fclose(b->rows);
        b->rows = NULL;
    }
    draw(b);
    status = status ? status : bench_mesh_report(b->folder, b->size, b->out, e);
    bench_grids(b);
    return status;
}

static int check_outputs(const struct bench *b, struct err *e) {
    int status = verb_output(b->report, e);
    status = status ? status : verb_output(b->csv, e);
    return status ? status : verb_output(b->plot, e);
}

static int open_files(struct bench *b, struct err *e) {
    ssize_t n = readlink("/proc/self/exe", b->self, sizeof b->self - 1);
    snprintf(b->folder, sizeof b->folder, "/tmp/goniorender-bench-XXXXXX");
    if (n < 0 || !mkdtemp(b->folder)) {
        return err_errno(e, ERR_IO, errno, "no scratch folder in /tmp");
    }
    b->out = b->report ? fopen(b->report, "w") : stdout;
    b->rows = b->csv ? fopen(b->csv, "w") : NULL;
    return b->out && (!b->csv || b->rows) ? 0 : err_errno(e, ERR_IO, errno, "the report cannot be written");
}

static void remove_folder(const char *folder) {
    static const char *const names[] = {"s.csv",    "p.png",     "r.json",     "c.pov",    "pov.png",
                                        "fold.csv", "fold.yaml", "panel.yaml", "body.ply", "sky.exr"};
    char path[512];
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        unlink(path);
    }
    for (int i = 0; i < 4; i++) {
        const struct bench_size *size = i < 2 ? &whole : &quick;
        int pixels[] = {size->error_pixels, size->time_pixels, size->time_pixels / 2};
        for (int k = 0; k < 3; k++) {
            snprintf(path, sizeof path, "%s/scene-%d-%d.yaml", folder, pixels[k], i % 2 ? 4 : 1);
            unlink(path);
        }
    }
    rmdir(folder);
}

int verb_bench(int argc, char **argv) {
    struct bench b = {.size = &whole};
    struct err e = {0};
    int status = read_options(argc, argv, &b, &e);
    status = status ? status : check_outputs(&b, &e);
    if (status) {
        return status > 0 ? 0 : verb_complain("bench", &e);
    }
    status = open_files(&b, &e);
    status = status ? status : run_all(&b, &e);
    if (b.report && b.out && fclose(b.out) != 0 && !status) {
        status = err_errno(&e, ERR_IO, errno, "%s cannot be written", b.report);
    }
    remove_folder(b.folder);
    return status ? verb_complain("bench", &e) : 0;
}
