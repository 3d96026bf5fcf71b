/*
 * mask.h — which geometries of a file enter a fit, and how many each rule left out.
 *
 * Instruments fall off towards grazing and are blind near the source; a rule is off while its number is 0. The
 * first rule that objects counts the point; a limit itself is let in. Geometries beyond MASK_GRAZING_DEG are left out always: the model is
 * not bounded there (reflection-model.md 1.2).
 * Geometry   theta_i_deg >= 0, theta_r_deg >= 0, delta_phi_deg 0 (the side of the source) .. 180 (mirror side).
 * Checked    tests/unit/test_points.c, tests/unit/test_points_surface.c
 */
#ifndef FIT_MASK_H
#define FIT_MASK_H

#include <stdbool.h>
#include <stddef.h>

#define MASK_GRAZING_DEG 88

enum mask_rule {
    MASK_NO_VALUE, /* no radiance factor of the mean; counted by the reader */
    MASK_GRAZING,
    MASK_THETA_I,
    MASK_THETA_V,
    MASK_BLIND,
    MASK_OUT_OF_PLANE,
    MASK_RULES
};

struct mask {
    double max_theta_i_deg, max_theta_v_deg;
    double blind_deg; /* angle between the directions to source and sensor */
    bool in_plane;
    size_t left_out[MASK_RULES];
};

bool mask_admits(struct mask *m, double theta_i_deg, double theta_r_deg, double delta_phi_deg);
const char *mask_key(enum mask_rule rule);   /* "theta_i", for JSON */
const char *mask_words(enum mask_rule rule); /* "of an incidence beyond --max-theta-i" */

#endif
