/*
 * units.h — conversions at the edges, so that no number changes its unit silently.
 *
 * Stage positions are integer microdegrees (udeg), times are integer microseconds (us), wavelengths
 * nanometres, angles degrees at every edge and radians inside fit and render. udeg_from_deg rounds to
 * nearest, half away from zero.
 * Domain     |deg| < 2,000 (fits int32 with room).
 * Checked    tests/unit/test_units.c
 */
#ifndef PROTO_UNITS_H
#define PROTO_UNITS_H

#include <math.h>
#include <stdint.h>

#define UDEG_PER_DEG 1000000
#define US_PER_MS 1000LL
#define US_PER_S 1000000LL
#define US_PER_MIN (60 * US_PER_S)

static inline int32_t udeg_from_deg(double deg) {
    return (int32_t)lround(deg * UDEG_PER_DEG);
}

static inline double deg_from_udeg(int32_t udeg) {
    return udeg / (double)UDEG_PER_DEG;
}

static inline double rad_from_deg(double deg) {
    return deg * 0.017453292519943295769;
}

static inline double deg_from_rad(double rad) {
    return rad * 57.295779513082320877;
}

#endif
