/*
 * measured.h — a measured surface as truth: an in-plane interpolant that passes through every node.
 *
 * Nodes of one incidence form a curve over theta_v, linear between them and constant beyond its ends. Between two
 * incidences both curves are read at the same distance from the mirror direction, theta_v - theta_i, and mixed
 * linearly, so that a glossy lobe moves instead of fading over. At a node's own incidence only its own curve
 * counts. Wavelengths are interpolated linearly onto the bands, constant beyond the measured range.
 *
 * Angles     theta_i_deg >= 0, theta_v_deg > 0 on the mirror side.
 * Values     radiance factor (pi * BRDF); only geometries in the plane of incidence are used.
 * Promises   no allocation in measured_at; any thread.
 * Errors     -ERR_INPUT no value in the plane.
 * Checked    tests/unit/test_sim_measured.c
 */
#ifndef SIM_MEASURED_H
#define SIM_MEASURED_H

#include "proto/bands.h"
#include "proto/brdf.h"
#include "proto/err.h"

struct measured;

int measured_new(struct measured **m, const struct brdf *brdf, struct err *e);
void measured_free(struct measured *m);
void measured_at(const struct measured *m, double theta_i_deg, double theta_v_deg, double beta[BANDS]);

#endif
