/*
 * gap.h — the words for a parameter that the points do not tell: why, and which geometry would tell it.
 *
 * Why, the first that holds: no lobe shows it; every value within its bounds fits; fewer than two points lie on the
 * flank of its lobe; it trades with another parameter (correlation beyond 0.9); it is known to so many per cent only.
 * The geometry is that of fit/suggest.h. Both into estimate->gap, and as a warning.
 * Errors     -ERR_NOMEM.
 * Checked    tests/unit/test_identifiability.c
 */
#ifndef FIT_GAP_H
#define FIT_GAP_H

#include "fit/uncertainty.h"

#ifdef __cplusplus
extern "C" {
#endif

struct gap {
    int column;
    bool is_free;      /* neither at a bound nor hanging on a lobe that is not there */
    double relative_u; /* u over the size of the value */
};

/* p evaluated at value; the covariances of estimate are filled. */
int gap_explain(const struct gap *gap, const struct problem *p, const double *value,
                const struct uncertainty *u, struct estimate *estimate, struct err *e);
/* Points with D between a thousandth and nine tenths of its top: those that tell the width of a lobe. Farther out the
 * noise of a point passes for a lobe just wide enough to reach it. */
size_t gap_flank_points(const struct problem *p, double gamma);
/* Of the point nearest to the mirror direction. */
double gap_nearest_phi(const struct problem *p);

#ifdef __cplusplus
}
#endif

#endif
