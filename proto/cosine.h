/*
 * cosine.h — the cosine of an angle in whole microdegrees, the same bits on every x86-64.
 *
 * Only + - * / of doubles, in a fixed order: the reduction must not depend on the version of a mathematics library
 * (design 3). The angle is folded to 0..45 deg in integers, turned to radians in two parts, then a fixed polynomial
 * is used: cos x, or sin x of the complement.
 *
 * Domain     any int32_t.
 * Promises   within 1 ulp of the true value; exact at multiples of 90 deg; cosine(-a) == cosine(a).
 * Checked    tests/unit/test_cosine.c, against MPFR
 */
#ifndef PROTO_COSINE_H
#define PROTO_COSINE_H

#include <stdint.h>

double cosine_udeg(int32_t angle_udeg);

#endif
