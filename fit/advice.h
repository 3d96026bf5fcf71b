/*
 * advice.h — which one geometry more would tell the most about a parameter.
 *
 * From the Fisher information of the points there are: of all candidates (incidence 10..60 deg, or as far as
 * measured; viewing -80..80 deg; every 5 deg, with the flanks of the lobe to 0.5 deg; none nearer than 8 deg to the
 * source) the one that takes most off the parameter's variance when measured with the set's own relative uncertainty.
 * Checked    tests/unit/test_estimate_limits.c
 */
#ifndef FIT_ADVICE_H
#define FIT_ADVICE_H

#include "fit/uncertainty.h"

#ifdef __cplusplus
extern "C" {
#endif

struct advice {
    double theta_i_deg, theta_v_deg;
};

int advice_next(const struct problem *p, const double *value, const struct uncertainty *u, int column,
                struct advice *next, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
