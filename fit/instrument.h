/*
 * instrument.h — what an estimate says of the instrument that its points came from: mirror offset and polarisation.
 *
 * Offset and P as fitted, with their u; a warning where one lies so far from its prior that the prior must be wrong.
 * Where P is not known (measurement.md 7) the estimate takes P = 0 and states the span of n and beta' over
 * |P| <= INSTRUMENT_P_LIMIT, by a fit at each end: from 0 to either end both move one way.
 * Errors     those of fit/solve.h.
 * Checked    tests/unit/test_nuisance.c, tests/unit/test_polarisation.c
 */
#ifndef FIT_INSTRUMENT_H
#define FIT_INSTRUMENT_H

#include "fit/solve.h"
#include "fit/uncertainty.h"

#ifdef __cplusplus
extern "C" {
#endif

#define INSTRUMENT_P_LIMIT 0.1

void instrument_report(const struct problem *p, const struct uncertainty *u, struct estimate *estimate);
/* best: the fit at P = 0, which *p still holds afterwards. */
int instrument_span(struct problem *p, const struct solve_result *best, struct estimate *estimate,
                    struct err *e);

#ifdef __cplusplus
}
#endif

#endif
