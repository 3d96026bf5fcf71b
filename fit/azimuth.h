/*
 * azimuth.h — on which side of the normal a file of measured reflections has its mirror direction.
 *
 * Files count the azimuth from different sides: delta phi is 180 deg towards the mirror in most, 0 in some
 * (reflection-model.md 1.4). Surfaces shine forward: at each incidence of AZIMUTH_FROM_DEG and more the strongest
 * in-plane reflection of one side is set against that of the other, over the viewing angles both sides have; the
 * median ratio over the incidences tells, if it is beyond AZIMUTH_RATIO.
 * Checked    tests/unit/test_points_surface.c
 */
#ifndef FIT_AZIMUTH_H
#define FIT_AZIMUTH_H

#include "proto/brdf.h"

#define AZIMUTH_FROM_DEG 25
#define AZIMUTH_RATIO 1.1

enum azimuth { AZIMUTH_DETECT, AZIMUTH_FORWARD_ZERO, AZIMUTH_FORWARD_PI };

/* Turns the surface where it counts from the mirror side, so that 180 is forward. wanted: as given by the person,
 * or AZIMUTH_DETECT. words: what was found and why, of size bytes. -ERR_NOMEM. */
int azimuth_settle(struct brdf *b, enum azimuth wanted, char *words, size_t size, struct err *e);

#endif
