/*
 * joint_shape.h — the functions of angle that one set of shared parameters makes, which all bands have in common.
 *
 * A band is S L1 + S^2 L2 + t P, L2 with its kappa, P the whole specular part, t = 1 unless beta' is free per band. Its
 * slope along shared coordinate j is S dL1_j + S^2 dL2_j + t dP_j. So every sum over the points of a band is a sum over
 * products of two of these functions, and the points are gone through once for all bands.
 *
 * Shapes     f[functions * n], function by function: L1, L2, P, then the slopes; l1[j], l2[j], p[j] index them, -1 = zero.
 *            column[k]: the shared coordinates among those of coordinates.h (S, and what is held, are not among them).
 * Errors     -ERR_RANGE outside the model's domain; -ERR_NOMEM.
 * Checked    tests/unit/test_joint.c
 */
#ifndef FIT_JOINT_SHAPE_H
#define FIT_JOINT_SHAPE_H

#include "fit/problem.h"

#ifdef __cplusplus
extern "C" {
#endif

#define JOINT_FUNCTIONS (3 + 2 * COORDINATES_MAX)

enum joint_function { JOINT_L1, JOINT_L2, JOINT_P };

struct joint_shape {
    struct problem *p;
    size_t n, room;
    int k, functions;
    int column[COORDINATES_MAX], l1[COORDINATES_MAX], l2[COORDINATES_MAX], specular[COORDINATES_MAX];
    double *f;
    double *columns; /* work: of two evaluations of the model */
};

/* What the parameter of a column moves: the roughness, and the index of a transmitted diffuse part, move the diffuse
 * part; all others the lobe. */
bool joint_shape_is_diffuse(const struct problem *p, int column);
/* held[] by the model's columns; S is always left out. */
int joint_shape_init(struct joint_shape *s, struct problem *p, const bool *held, struct err *e);
void joint_shape_free(struct joint_shape *s);
/* x: all coordinates of the model, that of S ignored. */
int joint_shape_at(struct joint_shape *s, const double *x, struct err *e);

#ifdef __cplusplus
}
#endif

#endif
