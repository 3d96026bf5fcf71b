/*
 * paint.h — a material of a scene: the estimate of a session, or parameters with a spectrum, ready for shading.
 *
 * S(lambda) stands on all 81 bands. Where it was not measured the nearest measured band is held (between two
 * measured bands: the straight line), and `held` marks it; paint_held_share says how much of X, Y and Z under an
 * illuminant rests on such bands.
 *
 * Models     all of fit/reflectance.h, seen without polariser; sigma 0 is Lambert, beta' 0 has no lobe.
 * Domain     S >= 0, sigma >= 0, beta' >= 0, gamma >= 1e-9, n >= 1, n_d >= 1, tail 0 .. 2, finite and at most 1e50: wider than the fit's, so that a picture can leave a part out by its parameter.
 * Errors     -ERR_RANGE a parameter or S outside the domain; -ERR_STATE a session without a converged estimate or
 *            without S(lambda).
 * Checked    tests/unit/test_render_paint.c
 */
#ifndef FIT_RENDER_PAINT_H
#define FIT_RENDER_PAINT_H

#include "fit/render/shade.h"
#include "proto/bands.h"
#include "proto/err.h"
#include "proto/material.h"

#define PAINT_HELD_WARNING 0.005 /* share of X, Y or Z above which held bands are warned of */

struct paint {
    char name[64];
    char source[256];         /* the session's path, or "parameters" */
    char sha256[65];          /* of the session file; empty for parameters */
    struct estimate estimate; /* model, parameters, kappa; s_lambda as measured */
    double s[BANDS];
    bool held[BANDS];
    struct shade_paint shade; /* made by paint_prepare */
    struct shade_paint
        drawn; /* by whose lobe facets are drawn: as shade, unless a parameter was moved a little */
};

/* From paint->estimate: s, held and shade. To be called again after a parameter or s_lambda was changed. */
int paint_prepare(struct paint *paint, struct err *e);
int paint_from_session(struct paint *paint, const char *path, struct err *e);
/* The largest of the shares of X, Y and Z of a Lambert surface of this S that rest on held bands. */
double paint_held_share(const struct paint *paint, const double power[BANDS], const double cmf[BANDS][3]);

#endif
