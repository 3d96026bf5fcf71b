#include <errno.h>
#include <stdio.h>

#include "fit/render/bench.h"

enum { ONE, ONE_BY_TWO, SIXTEEN, SIXTEEN_BY_TWO, POVRAY, PROGRAMS };

struct processes { /* what is timed, with the room for their words */
    char scene[2][512], picture[128], report[128];
    char pov_scene[160], pov_picture[128], pov_width[16], pov_height[16];
    struct bench_program program[PROGRAMS];
};

const char *bench_met(bool good) {
    return good ? "met" : "not met";
}

/* The same cylinder and light. */
static int write_povray(const char *path, struct err *e) {
    FILE *file = fopen(path, "w");
    if (!file) {
        return err_errno(e, ERR_IO, errno, "%s cannot be written", path);
    }
    fputs("camera { orthographic location <0,0,-100> right x*70 up y*70 direction z look_at 0 }\n"
          "light_source { <-34202,0,-93969> rgb 1 parallel point_at 0 }\n"
          "cylinder { <0,-31,0>, <0,31,0>, 31 rotate z*17 pigment { rgb <.1,.5,.2> }\n"
          "  finish { ambient 0 diffuse 1 specular .5 roughness .01 } }\n",
          file);
    return fclose(file) == 0 ? 0 : err_errno(e, ERR_IO, errno, "%s cannot be written", path);
}

static int prepare_povray(struct processes *p, const char *folder, const struct bench_size *size,
                          struct err *e) {
    snprintf(p->pov_scene, sizeof p->pov_scene, "+I%s/c.pov", folder);
    snprintf(p->pov_picture, sizeof p->pov_picture, "+O%s/pov.png", folder);
    snprintf(p->pov_width, sizeof p->pov_width, "+W%d", size->time_pixels);
    snprintf(p->pov_height, sizeof p->pov_height, "+H%d", size->time_pixels);
    p->program[POVRAY] = (struct bench_program){.words = {"povray", p->pov_scene, p->pov_width, p->pov_height,
                                                          "+WT1", "-D", "-A", p->pov_picture, "+FN8", NULL},
                                                .optional = true};
    return write_povray(p->pov_scene + 2, e);
}

static int prepare(struct processes *p, const char *self, const char *folder, const struct bench_size *size,
                   struct err *e) {
    int status = 0;
    snprintf(p->picture, sizeof p->picture, "%s/p.png", folder);
    snprintf(p->report, sizeof p->report, "%s/r.json", folder);
    for (int i = 0; i < 2 && !status; i++) {
        status = bench_write_scene(folder, &bench_scene[1], size->time_pixels, i ? 4 : 1, p->scene[i], e);
    }
    for (int i = ONE; i <= SIXTEEN_BY_TWO; i++) {
        bool two = i == ONE_BY_TWO || i == SIXTEEN_BY_TWO;
        p->program[i] =
            (struct bench_program){.words = {self, "render", p->scene[i >= SIXTEEN], "-o", p->picture,
                                             "--threads", two ? "2" : "1", "--report", p->report, NULL},
                                   .report = p->report};
    }
    return status ? status : prepare_povray(p, folder, size, e);
}

static void print_times(const struct processes *p, const struct bench_size *size, FILE *out) {
    fprintf(out,
            "## Times\n\nThe cylinder tilted by 17 deg, full model, 81 wavelengths, %d x %d pixels; whole "
            "processes with 8-bit\n"
            "PNG, medians of %d rounds in which each ran once.\n\n"
            "| samples | threads | wall s | CPU s | trace wall s | trace CPU s | peak RSS MiB "
            "|\n|---|---|---|---|---|---|---|\n",
            size->time_pixels, size->time_pixels, size->repeats);
    for (int i = ONE; i <= SIXTEEN_BY_TWO; i++) {
        const struct bench_time *t = &p->program[i].median;
        fprintf(out, "| %d | %d | %.3f | %.3f | %.3f | %.3f | %.1f |\n", i < SIXTEEN ? 1 : 16, 1 + i % 2,
                t->wall_s, t->cpu_s, t->trace_s, t->trace_cpu_s, t->rss_mib);
    }
}

/* A busy moment doubles a wall time, and hits two threads twice as often as one: only quiet rounds tell of the code. */
static void print_figures(const struct processes *p, FILE *out) {
    const struct bench_time *one = &p->program[ONE].median;
    double threads = p->program[SIXTEEN].quietest.trace_s / p->program[SIXTEEN_BY_TWO].quietest.trace_s;
    fprintf(
        out,
        "\n| figure | to reach | measured | |\n|---|---|---|---|\n"
        "| trace, 1 thread, 1 sample | 0.12 s is the aim | %.3f s wall, %.3f s CPU | %s by wall, %s "
        "by CPU |\n"
        "| two threads over one, trace, 16 samples, the quietest round of each | 1.85 by wall | %.2f | %s "
        "|\n",
        one->trace_s, one->trace_cpu_s, bench_met(one->trace_s <= 0.12), bench_met(one->trace_cpu_s <= 0.12),
        threads, bench_met(threads >= 1.85));
    if (p->program[POVRAY].missing) {
        fprintf(out, "| POV-Ray, RGB, without antialiasing | whole process at most 1/6 of it | not "
                     "installed here |\n");
        return;
    }
    const struct bench_time *pov = &p->program[POVRAY].median;
    fprintf(
        out,
        "| whole process, 1 thread, over POV-Ray's of RGB without antialiasing in the same rounds | 1/6 by "
        "wall | 1/%.1f by wall (%.3f s of POV-Ray), 1/%.1f by CPU | %s |\n",
        pov->wall_s / one->wall_s, pov->wall_s, pov->cpu_s / one->cpu_s,
        bench_met(pov->wall_s >= 6 * one->wall_s));
}

int bench_process_report(const char *self, const char *folder, const struct bench_size *size, FILE *out,
                         struct err *e) {
    struct processes p = {0};
    fprintf(stderr, "times of 1 and 16 samples, 1 and 2 threads, and of POV-Ray ...\n");
    int status = prepare(&p, self, folder, size, e);
    status = status ? status : bench_time_rounds(p.program, PROGRAMS, size->repeats, e);
    if (!status) {
        print_times(&p, size, out);
        print_figures(&p, out);
    }
    return status;
}
