/*
 * points_surface.h — a measured surface (proto/brdf.h) as the points of a fit.
 *
 * The mean is that of the wavelengths within input.mean_low_nm..mean_high_nm. Where all of these lie in 380..780 nm
 * they go into the nearest 5 nm bands (several to a band: their mean), the visible mean is that of the bands, and
 * S(lambda) and q follow as for a session; else the points carry their mean alone and q stays 1. Channels of no
 * stated wavelength: the mean of all of them.
 * Promises   azimuth_settle has been applied; a point lacking one of the wavelengths has no mean and is left out.
 * Errors     -ERR_INPUT no wavelength of the file lies in the range (the sentence lists what there is).
 * Checked    tests/unit/test_points_surface.c
 */
#ifndef FIT_POINTS_SURFACE_H
#define FIT_POINTS_SURFACE_H

#include "fit/points.h"

int points_surface_add(const struct brdf *b, const char *file, struct fitset *data,
                       struct points_report *report, struct err *e);

#endif
