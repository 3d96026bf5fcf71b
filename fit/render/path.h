/*
 * path.h — one way of light over several surfaces, found backwards from what the camera sees, and the spectrum it carries.
 *
 * No direction depends on a wavelength, so a path is geometry alone: at each step a direction is drawn at the surface
 * behind it, and the direct light of the next surface is taken from every light. Then all 81 bands are carried at once:
 *     r(k) = sum over steps i of prod over m <= i of (a_m S(k) + b_m S(k)^2 + c_m)  *  (a S(k) + b S(k)^2 + c)_i
 * a_m, b_m, c_m: scattered over the density of its direction, S of the paint it was scattered by; the last bracket: the
 * direct light of the surface reached, S of its paint.
 *
 * Directions in one of five ways, with the exact density of all together: as the lobe's facets reflect (facet.h), as
 *            often as energy.h says; else where flat surfaces mirror a light (glint.h), at other surfaces (aim.h), and
 *            by the cosine to the normal. From what the camera sees, which all paths of a camera ray share, also where
 *            both lobes mirror a light (gleam.h), each way mostly as often as it is estimated to be worth there.
 * Length     scene->image.bounces surfaces, the first included. Beyond PATH_SURE steps a path goes on by chance
 *            (probability at most PATH_GOES_ON), weighted for those that did not.
 * Promises   the mean over samples of r is that of all paths: no bias. Negative diffuse terms are set to 0 and counted.
 *            Light between parts of one relief is not followed (relief.h: it only turns normals and shades).
 * Checked    tests/unit/test_path.c
 */
#ifndef FIT_RENDER_PATH_H
#define FIT_RENDER_PATH_H

#include "fit/render/energy.h"
#include "fit/render/gleam.h"
#include "fit/render/sampler.h"
#include "fit/render/trace.h"

#define PATH_STEPS 31
#define PATH_SURE 3
#define PATH_GOES_ON 0.95
/* Half vectors are those of each direction. */
#define PATH_FEATURES (SHADE_SIGMA | SHADE_SPECULAR | SHADE_RELATIVES)

struct path_place { /* a surface seen along v, and how often directions are drawn there in which way */
    struct hit hit;
    struct vec3 v;
    struct aim_view seen;
    struct glint_view glints;
    struct gleam_view gleams;
    double by_gleams, by_facets, by_glints, by_aim, by_cosine; /* together 1 */
};

struct path_step {
    int from, to;                        /* paints */
    struct shade_abc scatter;            /* by `from`, over the density */
    struct shade_abc light[PLANES_SETS]; /* direct, of `to`, in each set */
};

struct path {
    int n;
    struct path_step step[PATH_STEPS];
};

/* Once for all paths from a hit that is seen along v; t: beyond the first bounce, with energies. */
void path_begin(const struct trace *t, const struct hit *hit, struct vec3 v, struct path_place *place);
void path_find(const struct trace *t, const struct path_place *first, struct sampler *sampler,
               struct path *path, struct render_counts *counts);
/* Adds part r(k) in each set to spectrum[set][k]. */
void path_carry(const struct path *path, const struct scene *scene, double part, double (*spectrum)[BANDS]);

#endif
