/*
 * spot.h — how far axis errors move a radiance factor through K, the filling factor of measurement.md 1.
 *
 * A point is divided by K at its readbacks, while light came at the true angles: with the view inside the beam the
 * irradiance went as cos theta_i, with the beam inside the view the viewed area as cos theta_v. So
 * d ln beta / d theta = -tan theta of the sample reading, the opposite of the reference's. A zero is the same in both:
 * it cancels where the reference was read at that angle. Repeatability never cancels; an own reading of the reference
 * adds its own. The zeros' part in a reference at a fixed geometry is one scale, a few 1e-4 beside the certificate's
 * 5e-3, and left out.
 *
 * Slopes     relative, per degree of the source and of the sample axis; mirrored as in fit/estimate.h.
 * Source     measurement.md 1 and 6.
 * Checked    tests/unit/test_estimate_uncertainty.c, tests/scenario/test_pulls.c
 */
#ifndef FIT_SPOT_H
#define FIT_SPOT_H

#include "fit/estimate.h"

#ifdef __cplusplus
extern "C" {
#endif

struct spot {
    double source, sample; /* of the sample reading */
    bool zeros_cancel, own_reference;
};

void spot_at(const struct estimate_input *input, size_t point, struct spot *spot);
/* "view-in-beam" and "beam-in-view"; modes of a job's reference. -ERR_USAGE names what there is. */
int spot_find_filling(const char *name, enum estimate_filling *filling, struct err *e);
int spot_find_reference(const char *mode, enum estimate_reference *reference, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
