/*
 * render.h — what a fitted material looks like: a scene of painted shapes to a picture, by wavelengths.
 *
 * struct scene (with struct estimate in its paints) --render_planes--> struct planes (a, b, c by pixel)
 *              --render_picture--> struct picture (codes of an RGB space, with their origin).
 * render_planes traces; render_picture only colours, and may be called again for another illuminant, observer or S.
 *
 * Threads    rows are handed out in tiles; the same bits for any number of threads.
 * Cancel     *options->cancel != 0 ends the work after the tiles under way; rows_done says how much there is.
 * Errors     -ERR_NOMEM; -ERR_RANGE a light that no eye sees; -ERR_CANCELLED nothing was done at all.
 * Checked    tests/unit/test_render.c
 */
#ifndef FIT_RENDER_RENDER_H
#define FIT_RENDER_RENDER_H

#include <signal.h>
#include <stdint.h>

#include "fit/render/features.h"
#include "fit/render/planes.h"
#include "fit/render/scene.h"

struct render_hits { /* what the camera's rays met, for other lights or paints; {0} before the first */
    struct hit *hit; /* [pixel][ray of the pixel] */
    size_t n;
    bool known;
};

struct render_options {
    int threads;                         /* 0: as many as there are processors */
    bool all_features;                   /* nothing is left out */
    unsigned keep;                       /* bit 1 << enum feature: this one is not left out */
    bool progress;                       /* a bar on stderr */
    struct render_hits *hits;            /* to be kept and used; or NULL */
    const struct scene *steady;          /* whose paints say how paths go, none ended by chance; or NULL */
    const volatile sig_atomic_t *cancel; /* or NULL */
};

#define RENDER_FIREFLY                                                                                       \
    100 /* times the mean of the 8 x 8 pixels around, and brighter than the perfect diffuser */

struct render_counts {
    uint64_t camera_rays, hits, shadow_rays, negative_diffuse; /* a < 0, set to 0 */
    uint64_t indirect_rays, indirect_hits;                     /* beyond the first bounce */
    uint64_t drawn;                                            /* random samples */
    uint64_t fireflies; /* pixels with one so bright that more samples would not confirm it: RENDER_FIREFLY */
    int rows_done;
};

struct render_report {
    struct features features;
    struct render_counts counts;
    int samples;    /* drawn in each pixel, of each light; 0: none */
    double noise_y; /* root mean square over what is shown, of the standard deviation of Y by them */
    double trace_s, trace_cpu_s; /* cpu: of the whole process meanwhile */
    int threads;
};

struct picture { /* rgb[3 * height * width] by rows from the top: codes of 8 or 16 bits, each in a uint16_t */
    int width, height, bits;
    enum colour_space space;
    uint16_t *rgb;
    uint64_t clipped, out_of_gamut; /* pixels with a channel above 1; below 0 */
    double max_y;                   /* before exposure */
    double white[3];                /* XYZ of the perfect diffuser under the scene's lights, Y = 1 */
};

int render_planes(const struct scene *scene, const struct render_options *options, struct planes *planes,
                  struct render_report *report, struct err *e);
/* All rows or nothing: -ERR_CANCELLED also where some are done. */
int render_whole(const struct scene *scene, const struct render_options *options, struct planes *planes,
                 struct render_report *report, struct err *e);
/* by_wavelength: 81 sums for each pixel instead of the matrices, which hold the same (colour.h). */
int render_picture(const struct scene *scene, const struct planes *planes, bool by_wavelength,
                   struct picture *picture, struct err *e);
/* XYZ of every pixel, [3 * height * width], before exposure and adaptation. */
int render_xyz(const struct scene *scene, const struct planes *planes, bool by_wavelength, double *xyz,
               struct err *e);
void render_hits_free(struct render_hits *hits);
void picture_free(struct picture *picture);

#endif
