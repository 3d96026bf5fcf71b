/*
 * verdict.h — what a settled fit may claim: values with their covariance, limits, gaps, warnings, or a refusal.
 *
 * A parameter at a bound gets a limit; what the others move while it walks to that limit is part of their u
 * (beta' and n trade against each other). A parameter known to worse than a factor e^0.5 is not identifiable, with
 * the geometry that would tell it. Misfit, sigma out of range, negative diffuse term and w > 1 are warnings.
 * Errors     -ERR_FIT, -ERR_NOMEM; a refusal is not an error.
 * Source     measurement.md 8, 10.
 * Checked    tests/unit/test_estimate_limits.c
 */
#ifndef FIT_VERDICT_H
#define FIT_VERDICT_H

#include "fit/bandfit.h"
#include "fit/solve.h"

#ifdef __cplusplus
extern "C" {
#endif

struct settled { /* the end of the passes: p evaluated at value, bands solved with it */
    struct problem p;
    struct bandfit bands;
    struct solve_result best;
    double value[MATERIAL_PARAMETERS];
};

int verdict_fill(struct settled *fit, struct estimate *estimate, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
