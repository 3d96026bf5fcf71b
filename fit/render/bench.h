/*
 * bench.h — error against run time of the renderer, by one protocol for every scene; internal to `goniorender bench`.
 *
 * Errors are of linear X, Y, Z over the pixels that show an object, against a reference of 4,096 jittered samples a
 * pixel in two halves of other seeds, with nothing left out and summed by wavelengths. Times are of whole processes.
 * Checked    tests/unit/test_goniorender.py runs it at small size
 */
#ifndef FIT_RENDER_BENCH_H
#define FIT_RENDER_BENCH_H

#include <stdio.h>

#include "fit/render/cie.h"
#include "fit/render/render.h"

#define BENCH_GRIDS 4 /* 1, 2, 4, 8: 1 to 64 samples a pixel */

struct bench_scene {
    const char *name, *about;
    double sigma, gamma, beta_prime, n, turn_deg;
};

extern const struct bench_scene bench_scene[];
extern const int bench_scenes;

struct bench_panel { /* a panel under a rectangle light: S3 */
    const char *name;
    double sigma, gamma, beta_prime, n;
};

extern const struct bench_panel bench_panel[];
extern const int bench_panels;

struct bench_size {
    int error_pixels, time_pixels; /* side of the pictures for errors and for times */
    int panel_pixels;              /* of the panel, each seen at its centre */
    int reference_grid;            /* its samples a pixel: grid squared, in two halves */
    int repeats;                   /* rounds of whatever is timed */
    int fold_pixels, fold_samples; /* of the fold: side of the picture; paths a pixel of its reference */
    int mesh_jitters, mesh_rings;  /* of the mesh: directions in a texel of half its reference; finest body */
};

struct bench_error { /* of one sampling of one scene */
    int samples;
    double rmse, relmse, largest;       /* over the object; rmse and largest over the mean Y */
    double edge_rmse, inner_rmse;       /* pixels at an edge of what is seen, and the others */
    double de_mean, de_p95, de_largest; /* CIEDE2000, white = the perfect diffuser */
    double trace_s;                     /* CPU */
};

struct bench_reference { /* X, Y, Z of each pixel from each half of the samples */
    int n;
    double *half[2];      /* [3 * n] each */
    unsigned char *shown; /* [n] bit 0: an object in some sample; bit 1: at an edge of what is seen or lit */
};

struct bench_errors {
    struct bench_error row[BENCH_GRIDS];
    double reference_rmse; /* half the distance of the two halves, over the mean Y: the floor */
    double slope;          /* of log rmse over log samples */
    double model_apart;    /* largest difference to fit/reflectance.h, at one sample a pixel */
};

struct bench_panel_errors {
    struct bench_errors by[2]; /* by the light alone; by light and facets */
    bool chosen;               /* which of them a picture takes */
};

struct bench_time { /* of a whole process */
    double wall_s, cpu_s, trace_s, trace_cpu_s, rss_mib;
};

#define BENCH_PROGRAM_WORDS 12

struct bench_program {
    const char *words[BENCH_PROGRAM_WORDS]; /* it and its arguments, NULL at the end */
    const char *report;                     /* R.json that it writes, or NULL */
    bool optional, missing;                 /* it may be missing; it is */
    struct bench_time median, quietest;     /* of each figure by itself */
};

struct bench_recolour { /* best of several, in this process */
    double rgb_s;       /* planes in memory through a new matrix */
    double codes_s;     /* and on to the codes of a picture */
};

struct bench_ablation {   /* [FEATURES]: all of them kept */
    double lean_s, bound; /* CPU of tracing and colouring with all left out that may be */
    bool left_out[FEATURES + 1];
    double kept_s[FEATURES + 1], apart[FEATURES + 1]; /* with this one kept; largest change of X, Y, Z */
};

struct bench_grid {
    const char *name;
    int first, last, step; /* bands */
};

/* folder: a scratch folder, where the scene's files are written. */
int bench_write_scene(const char *folder, const struct bench_scene *s, int pixels, int grid, char path[512],
                      struct err *e);
/* Of the scene's size; to be freed also where it failed. */
int bench_reference_make(struct bench_reference *r, const struct scene *scene, struct err *e);
void bench_reference_free(struct bench_reference *r);
/* Fills all of *out but samples and trace_s. */
int bench_compare(const struct bench_reference *r, const double *xyz, const double white[3],
                  struct bench_error *out, struct err *e);
double bench_floor(const struct bench_reference *r); /* half the distance of the halves, over the mean Y */
/* Of log rmse over log samples. */
double bench_slope(const struct bench_error *row, int n);
int bench_error_run(const char *folder, const struct bench_scene *s, const struct bench_size *size,
                    struct bench_errors *errors, struct err *e);
/* Reference: samples of its own over the light's area and over the lobe's facets, the model from angles. */
int bench_panel_run(const char *folder, const struct bench_panel *s, const struct bench_size *size,
                    struct bench_panel_errors *out, struct err *e);
/* Rounds in which each runs once, so that busy moments of the machine are shared. */
int bench_time_rounds(struct bench_program *program, int n, int rounds, struct err *e);
const char *bench_met(bool good); /* a figure that was to be reached */
/* Whole processes of one and two threads, POV-Ray beside them; self: the program that is timed. */
int bench_process_report(const char *self, const char *folder, const struct bench_size *size, FILE *out,
                         struct err *e);

/* S4: a fold of one strongly coloured paint, 5 bounces, at the centres of pixels; its section of the report. */
int bench_fold_report(const char *folder, const struct bench_size *size, FILE *out, FILE *rows,
                      struct err *e);
#define BENCH_FOLDS 9 /* blocks of rows, if not NULL: each paint with each way to carry */
const char *bench_fold_name(int block);
/* S5: a mesh in an environment, and what finer meshes cost. */
int bench_mesh_report(const char *folder, const struct bench_size *size, FILE *out, struct err *e);

int bench_recolour(const char *folder, const struct bench_size *size, struct bench_recolour *out,
                   struct err *e);
int bench_ablation(const char *folder, const struct bench_size *size, struct bench_ablation *out,
                   struct err *e);
/* Largest change of X, Y, Z over Y of a green, against 380..780 nm at 5 nm. */
double bench_grid_error(const struct cie_illuminant *light, const struct bench_grid *grid);

#endif
