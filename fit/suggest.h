/*
 * suggest.h — which one geometry more would tell the most about a parameter.
 *
 * From the Fisher information of the points there are: of all candidates (incidence 10..60 deg, or as far as
 * measured; viewing -80..80 deg; every 5 deg, with the flanks of the lobe to 0.5 deg; none nearer than 8 deg to the
 * source) the one that takes most off the parameter's variance when measured with the set's own relative uncertainty.
 * Errors     -ERR_FIT an information that is no number; -ERR_NOMEM.
 * Checked    tests/unit/test_estimate_limits.c, tests/unit/test_forecast.c
 */
#ifndef FIT_SUGGEST_H
#define FIT_SUGGEST_H

#include "fit/problem.h"

#ifdef __cplusplus
extern "C" {
#endif

struct suggestion {
    double theta_i_deg, theta_v_deg;
};

/* p evaluated and weighed at value; fisher[k * k] of the coordinates there. */
int suggest_next(const struct problem *p, const double *value, const double *fisher, int column,
                 struct suggestion *next, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
