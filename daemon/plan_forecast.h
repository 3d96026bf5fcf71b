/*
 * plan_forecast.h — what a plan's angles will tell of the published paints, before anything moves (fit/forecast.h).
 *
 * For the points of the job's first sample: standard uncertainty of each parameter, and which ones those angles will not
 * identify. Noise is the counting noise of the visible mean at the job's exposures; no light has been seen yet, so the lamp is
 * taken to give half its peak over the mean's range, and a grating to spread 650 nm over the pixels. Axes, zeros,
 * polarisation, filling and certificate are those of config and job. u is relative to the parameter.
 * JSON       {"sample", "points", "noise_relative", "certificate_relative", "sets": [{"name", "description", "parameters",
 *            "std", "std_statistical", "std_common", "not_identifiable": [{"parameter", "why", "measure_next": {"theta_i_deg",
 *            "theta_v_deg"}}]}]}; an infinite number is null
 * Errors     NULL with the reason in e.
 * Checked    tests/unit/test_plan_forecast.c
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
