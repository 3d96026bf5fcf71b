#include <errno.h>
#include <math.h>

#include "fit/render/bench.h"
#include "proto/bands.h"

/* The published sets (paper, Experimental results), and the first with a lobe that a pixel can miss. */
const struct bench_scene bench_scene[] = {
    {"S1 acrylic", "126, upright", .35, .05, 126, 1.40, 0},
    {"S1 acrylic 17", "126, tilted 17 deg", .35, .05, 126, 1.40, 17},
    {"S1 0 % 17", "0 % of water, tilted", .2, .2, 15.7, 1.70, 17},
    {"S1 60 % 17", "60 % of water, tilted", .3, .07, 7.6, 1.70, 17},
    {"S1 90 % 17", "90 % of water, tilted", .5, .08, 1.6, 2.42, 17},
    {"S2 acrylic 17", "gamma 0.01, tilted", .35, .01, 126, 1.40, 17},
};
const int bench_scenes = sizeof bench_scene / sizeof *bench_scene;

/* A green of S 0.05 to 0.3, so that colour differences mean something. */
static int write_spectrum(const char *folder, struct err *e) {
    char path[512];
    snprintf(path, sizeof path, "%s/s.csv", folder);
    FILE *file = fopen(path, "w");
    if (!file) {
        return err_errno(e, ERR_IO, errno, "%s cannot be written", path);
    }
    fputs("lambda_nm,value\n", file);
    for (int k = 0; k < BANDS; k++) {
        double x = (band_nm(k) - 530) / 40.0;
        fprintf(file, "%d,%.6f\n", band_nm(k), 0.05 + 0.25 * exp(-x * x));
    }
    return fclose(file) == 0 ? 0 : err_errno(e, ERR_IO, errno, "%s cannot be written", path);
}

int bench_write_scene(const char *folder, const struct bench_scene *s, int pixels, int grid, char path[512],
                      struct err *e) {
    int status = write_spectrum(folder, e);
    snprintf(path, 512, "%s/scene-%d-%d.yaml", folder, pixels, grid);
    FILE *file = status ? NULL : fopen(path, "w");
    if (!file) {
        return status ? status : err_errno(e, ERR_IO, errno, "%s cannot be written", path);
    }
    fprintf(file,
            "materials: [{name: m, spectrum: s.csv, sigma: %g, gamma: %g, beta_prime: %g, n: %g}]\n"
            "shapes: [cylinder: {material: m, radius_mm: 31, length_mm: 62, turn_deg: [0, 0, %g]}]\n"
            "lights: [beam: {theta_deg: 20, azimuth_deg: 180}]\n"
            "camera: {orthographic: {height_mm: 70}}\n"
            "image: {width: %d, height: %d, grid: %d}\n",
            s->sigma, s->gamma, s->beta_prime, s->n, s->turn_deg, pixels, pixels, grid);
    return fclose(file) == 0 ? 0 : err_errno(e, ERR_IO, errno, "%s cannot be written", path);
}
