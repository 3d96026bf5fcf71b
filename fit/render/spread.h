/*
 * spread.h — how far the colours of a picture may be off: by what is known of its paints, and by its own sampling.
 *
 * From the joint covariance of each paint's shared parameters and S(lambda), common parts included:
 *     cov_xyz, cov_lab   covariance of X, Y, Z and of L*, a*, b* in each pixel, to first order
 *     median, p95        of CIEDE2000 between the picture and SPREAD_DRAWS pictures of drawn paints: S(lambda) as
 *                        drawn, a, b, c to first order in the shared parameters; the same draws for all pixels; what comes
 *                        over other surfaces to first order in all of them (spread_path.h)
 *     sampling           CIEDE2000 between the picture and itself with one sample more each way in a pixel
 *     noise              variance of Y by what was drawn at random: lights with extent, several bounces; 0 without both
 * Paints are independent of each other; a paint without a covariance counts as exactly known. Light, camera and
 * shapes are taken as given.
 *
 * Shapes     planes by rows from the top; covariances as XX, XY, XZ, YY, YZ, ZZ of each pixel; NaN: nothing is shown.
 * Units      X, Y, Z: 1 for the perfect diffuser's Y. CIELAB under the scene's own white.
 * Errors     those of render_planes and spread_paint_make; -ERR_CANCELLED.
 * Checked    tests/unit/test_render_noise.c; test_render_spread.c: each draw rendered anew, the Jacobian by rendering;
 *            test_spread_path.c: the same of several bounces
 */
#ifndef FIT_RENDER_SPREAD_H
#define FIT_RENDER_SPREAD_H

#include "fit/render/render.h"
#include "fit/render/spread_paint.h"

enum spread_plane {
    SPREAD_XYZ,
    SPREAD_COV_XYZ = 3,
    SPREAD_LAB = 9,
    SPREAD_COV_LAB = 12,
    SPREAD_MEDIAN = 18,
    SPREAD_P95,
    SPREAD_SAMPLING,
    SPREAD_NOISE,
    SPREAD_PLANES
};

struct spread {
    int width, height;
    int renderings;              /* of all paths, for their slopes; 0: of one bounce, or nothing moves */
    float *plane[SPREAD_PLANES]; /* [pixels] each */
    uint64_t n;                  /* pixels that show something */
    double typical_median, typical_p95, typical_sampling; /* medians over these */
    double worst_p95, worst_sampling;                     /* exceeded by 5 % of them */
    double typical_noise, worst_noise;                    /* standard deviations of Y, alike */
};

/* joint[paint]: borrowed; NULL where none is known. */
int spread_make(const struct scene *scene, const struct joint *const joint[SCENE_PAINTS], uint64_t seed,
                const struct render_options *options, struct spread *spread, struct err *e);
void spread_free(struct spread *spread);
/* EXR: X.., covXYZ.XX.., Lab.L.., covLab.LL.., dE00.median, dE00.p95, dE00.sampling, noise.varY; "goniod": the origin. */
int spread_save(const char *path, const struct spread *spread, const char *origin_json, struct err *e);

#endif
