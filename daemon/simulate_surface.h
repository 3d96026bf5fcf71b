/*
 * simulate_surface.h — a modelled surface that can stand on the simulated bench: the composite model and its spectrum.
 *
 * beta_k = S_k L1(sigma) + S_k^2 L2(sigma) + specular(gamma, beta', n), kappa = 1, band by band (proto/bands.h).
 * It comes from the truth of a simulated session (text "truth"), or from a fitted estimate.
 *
 * Truth      JSON {"S","sigma","gamma","beta_prime","n","kappa":1,"q","mean_nm":[lo,hi],"s_lambda":[81 numbers]}:
 *            S and q are those of the mean over mean_nm (measurement.md 5).
 * Estimate   models composite, eq1, oren-nayar and lambert; bands that were not measured take the nearest measured.
 * Errors     -ERR_INPUT names the key that is missing; an estimate that is none, of another model, or in the paper's
 *            convention (kappa is not 1).
 * Checked    tests/replay/test_replay_physics.c, tests/unit/test_simulate_surface.c
 */
#ifndef DAEMON_SIMULATE_SURFACE_H
#define DAEMON_SIMULATE_SURFACE_H

#include <jansson.h>

#include "fit/aperture.h"
#include "proto/bands.h"
#include "proto/material.h"

struct simulate_surface {
    double sigma, gamma, beta_prime, n;
    double s_lambda[BANDS];
};

json_t *simulate_surface_to_json(const struct simulate_surface *surface, const int mean_nm[2]);
int simulate_surface_from_json(const json_t *json, struct simulate_surface *surface, struct err *e);
int simulate_surface_from_estimate(const struct estimate *m, struct simulate_surface *surface, struct err *e);
/* Mean over the bands of mean_nm as source and sensor see it, unpolarised; theta_i_deg may be negative (the mirrored
 * side). NaN where the model says nothing. */
double simulate_surface_mean(const struct simulate_surface *surface, const struct aperture_form *form,
                             double theta_i_deg, double theta_v_deg, const int mean_nm[2]);

#endif
