/*
 * truth_check.h — final points of a session against a known truth, each with the whole of its uncertainty.
 *
 * variance = u_ind^2 + named common parts + drift of the bracket (measurement.md 3, 8) + angular part: the truth's
 * slopes along both axes times u_source_deg and u_sample_deg (measurement.md 6). A point is reduced at its readbacks
 * while light came at the true angles: of the surface, and through K of measurement.md 1, which is 1 whatever the axes
 * where the reference is read at the same geometry.
 *
 * Band       of proto/bands.h; TRUTH_MEAN: mean of 400 to 700 nm.
 * Slopes     one-sided, the steeper side counts: at a node of a measured surface the slope jumps.
 * Checked    tests/scenario/test_reference_modes.c, tests/scenario/test_measured_surface.c
 */
#ifndef TESTS_SUPPORT_TRUTH_CHECK_H
#define TESTS_SUPPORT_TRUTH_CHECK_H

#include <stdbool.h>

#include "proto/session.h"
#include "sim/sim.h"

#define TRUTH_MEAN (-1)
#define TRUTH_FIRST 4 /* band at 400 nm */
#define TRUTH_LAST 64 /* band at 700 nm */
#define TRUTH_BRACKETS 128
#define TRUTH_POINTS 512

struct truth_check {
    const struct sim_surface *truth;
    bool beam_in_view, own_reference;
    bool nominal; /* the bench drew no certificate: that part does not count */
    double u_source_deg, u_sample_deg;
    /* filled by truth_check_load */
    int n_brackets, n_points;
    struct bracket bracket[TRUTH_BRACKETS];
    struct point point[TRUTH_POINTS];
};

/* Final points only; fails the test where a provisional one is left. */
void truth_check_load(struct truth_check *c, struct session *s);
double truth_check_true(const struct truth_check *c, const struct point *p, int band);
double truth_check_variance(const struct truth_check *c, const struct point *p, int band);
double truth_check_pull(const struct truth_check *c, const struct point *p, int band);

#endif
