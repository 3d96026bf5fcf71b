/*
 * features.h — what a scene does not need is left out: one pass that decides, says why, and bounds the error.
 *
 * Each rule is a predicate over the scene; where it holds, its part is dropped, with a bound on the change of any
 * radiance (in units of the perfect diffuser). --all-features leaves nothing out.
 * Checked    tests/unit/test_render.c, test_trace_area.c, test_path.c: rules left out against all features, within the
 *            printed bound; test_mesh_shape.c: Embree
 */
#ifndef FIT_RENDER_FEATURES_H
#define FIT_RENDER_FEATURES_H

#include <stdbool.h>
#include <stdio.h>

#include "fit/render/scene.h"

#define FEATURES_HITS_MAX (1ull << 30) /* bytes of hits that are kept for a series */
#define FEATURES_TOLERANCE 1e-6        /* of the radiance, below which a part may be left out */

enum feature {
    FEATURE_LIGHTS,         /* lights without power */
    FEATURE_SPECULAR,       /* lobe, Fresnel, plane c */
    FEATURE_LOBE_TAIL,      /* the lobe beyond the angle where it falls under the tolerance */
    FEATURE_RELATIVES,      /* heavy tail, second lobe, transmission */
    FEATURE_SIGMA,          /* Oren-Nayar's direct terms, interreflection, plane b */
    FEATURE_EACH_DIRECTION, /* half vector and Fresnel of each sample instead of once */
    FEATURE_SHADOW_RAYS,
    FEATURE_WAVELENGTHS,     /* 81 sums for each pixel instead of a 3x3 matrix */
    FEATURE_INTERREFLECTION, /* paths over several surfaces, and the spectra they carry */
    FEATURE_RANDOM,          /* random samples of light and of paths, and the plane of their noise */
    FEATURE_FACETS,          /* directions drawn by the lobe, beside those to the light */
    FEATURE_MESHES,          /* Embree and its trees; loaded by the first mesh, never by --all-features */
    FEATURE_EACH_PICTURE,    /* rays of the camera in every picture of a series of lights */
    FEATURES
};

struct feature_line {
    bool kept;
    double bound; /* of leaving it out; 0 = none */
    char reason[128];
};

struct features {
    struct feature_line line[FEATURES];
};

/* Of one paint in one light. The full width at half maximum of what the lobe reflects is 4 gamma times the distance (facets
 * lean by gamma to either side, and mirror by twice that): where it is at least the light's size the lobe is smooth over
 * the light, and the light alone errs less (docs/render-report.md, S3). */
struct features_facets {
    bool drawn;                                   /* by the lobe's facets too: width_mm < size_mm */
    double gamma, distance_mm, width_mm, size_mm; /* of the narrower lobe; where the light comes nearest */
};

void features_find(const struct scene *scene, bool all, struct features *features);
/* n.h below which the lobe of this paint under this light is left out; -INFINITY: nowhere, INFINITY: everywhere. */
double features_lobe_cut(const struct scene *scene, const struct paint *paint, const struct light *light);
struct features_facets features_facets(const struct scene *scene, int paint, int light);
/* One line for each paint in each light with extent: how its gloss is drawn, and why. */
void features_print_facets(const struct scene *scene, FILE *out);
const char *feature_name(enum feature feature);
double features_bound(const struct features *features); /* the sum over what is left out */
/* `left out: NAME (reason), ...` and `kept: NAME (reason), ...` */
void features_print(const struct features *features, FILE *out);

#endif
