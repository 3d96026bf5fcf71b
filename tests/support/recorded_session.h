/*
 * recorded_session.h — a small campaign on the synthetic bench, stored as goniod stores one.
 *
 * Three brackets, the second cut off by a pause, a saturated set, a dark for each exposure time, Modbus exchanges, an
 * estimate, the texts that a reduction needs; 6 final points.
 */
#ifndef TESTS_SUPPORT_RECORDED_SESSION_H
#define TESTS_SUPPORT_RECORDED_SESSION_H

#define RECORDED_POINTS 6 /* that stand as final */

void recorded_session_make(const char *path);

#endif
