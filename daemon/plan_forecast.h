/*
 * plan_forecast.h — what a plan's angles will tell of the published paints, before anything moves (fit/forecast.h).
 *
 * For the points of the job's first sample: standard uncertainty of each parameter, and which ones those angles will not
 * identify. Noise, darks and control readings are those of the job's exposures, brackets and times; no light has been seen
 * yet, so the lamp is taken to give half its peak over the mean's range, a grating to spread 650 nm over the pixels, and
 * a paint's diffuse part to be a third of its brightest band in the mean. Drift and linearity are the figures that the
 * reduction begins with (reduce_setup_stated); axes, zeros, polarisation, filling and certificate are those of config and
 * job. u is relative to the parameter.
 *
 * Left out   what fit/forecast.h leaves out, stray light and the single bands' light above all. Against the estimates of the
 *            four simulated campaigns of the demo, total u: 0.93 to 1.06 of sigma's, 0.76 to 1.05 of gamma's, 0.91 to 1.01
 *            of those of S and beta', 0.56 to 0.94 of n's. Each is to lie within a factor of two.
 * JSON       {"sample", "points", "noise_relative", "certificate_relative", "sets": [{"name", "description", "parameters",
 *            "std", "std_statistical", "std_common", "not_identifiable": [{"parameter", "why", "measure_next": {"theta_i_deg",
 *            "theta_v_deg"}}]}]}; an infinite number is null
 * Errors     NULL with the reason in e.
 * Checked    tests/unit/test_plan_forecast.c; tests/scenario/test_forecast_campaign.py: against simulated campaigns
 */
#ifndef DAEMON_PLAN_FORECAST_H
#define DAEMON_PLAN_FORECAST_H

#include <jansson.h>
#include <stdio.h>

#include "daemon/plan.h"

json_t *plan_forecast(const struct plan *plan, const struct job *job, const struct config *config,
                      const struct plan_devices *devices, struct err *e);
void plan_forecast_print(const json_t *forecast, FILE *out); /* for people */

#endif
