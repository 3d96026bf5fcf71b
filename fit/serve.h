/*
 * serve.h — `goniofit --serve`: estimations for a parent process, one answer to each question.
 *
 * Framing    uint32 little-endian byte count, then that many bytes of JSON; both ways. Ends at end of file.
 * Request    one object; every key but points has a default.
 *     id                    any value, given back (null)
 *     points                list of {theta_i_deg, theta_v_deg, beta, u_ind, mirrored (false), provisional
 *                           (false), bands: [81], bands_u: [81], bands_cov_next: [81] (covariance of each band's
 *                           independent part with the next band's)}; angles in degrees, theta_v_deg > 0 on the
 *                           mirror side; beta the visible mean, null = it has none (the point is left out);
 *                           a missing band is null; without u_ind in all points the fit is unweighted
 *     common                list of {name, mean: [..], points: [indices], bands: [[81], ..]}: signed change
 *                           of beta for one standard uncertainty of the cause; without points, of all points
 *                           in order; without bands, every band changes in proportion to the mean
 *     drift                 list of {bracket_points: [indices], tau_us: [..], tau_r_us: [..] (0), T_us (null or
 *                           0 = not closed), rate}: one a bracket, relative variance per second
 *     model                 any of reflectance_name ("composite"), or all: composite, and at the end all of them
 *     loss                  any of material_loss_name ("ml")
 *     mean_nm               [400, 700]
 *     kappa                 1
 *     q_is_one, unweighted  false
 *     filling, reference    view-in-beam | beam-in-view; fixed | per_incidence | every_geometry | start_end (fixed):
 *                           how axis errors act through K (fit/spot.h); without filling they do not
 *     source_width_deg, sensor_width_deg   0: angular, full (fit/aperture.h)
 *     polarisation          unknown | depolarised | {value, u} ("unknown")
 *     hold_offset           false: the mirror direction is fitted with its prior from both zeros (fit/nuisance.h)
 *     u_repeat_source_deg, u_repeat_sample_deg, u_zero_source_deg, u_zero_sample_deg   0
 *     final                 false; true adds axis_slopes and, where there are bands, joint to the reply
 * Reply      {"id", "estimate": as estimate_to_json of proto/material.h, "axis_slopes": {"source": [n],
 *            "sample": [n]} (d beta / d axis per degree, null where a point was left out), "joint": as joint_to_json of
 *            proto/joint.h, "models": of all, the recommended first, which is the estimate: [{"recommended", "why",
 *            "estimate"}]} or {"id", "error": "sentence"}. Too few angles are an estimate with converged false and refusal, not an error.
 * Errors     a frame that is not JSON, or not of this form, is answered with an error; the next frame is read. A frame
 *            beyond SERVE_FRAME_MAX is read over and refused. -ERR_IO: the pipe broke inside a frame.
 * Checked    tests/unit/test_serve.c
 */
#ifndef FIT_SERVE_H
#define FIT_SERVE_H

#include <stddef.h>

#include "proto/err.h"

#define SERVE_FRAME_MAX (256u << 20)

int serve_run(int in_fd, int out_fd, struct err *e);
/* One request to one reply, both as JSON text; the reply is malloc'd, NULL only out of memory. */
char *serve_answer(const char *request, size_t size);

#endif
