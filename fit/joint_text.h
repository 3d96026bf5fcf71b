/*
 * joint_text.h — a joint fit in words on stdout: shared parameters, what was found of the bench, and each band.
 *
 * A line a row: name, value and total standard uncertainty; "-" and the reason where a parameter has none. Degrees;
 * the rest without unit. The fit has converged.
 * Checked    tests/unit/test_goniofit.py
 */
#ifndef FIT_JOINT_TEXT_H
#define FIT_JOINT_TEXT_H

#include "proto/joint.h"

void joint_text_print(const struct joint *joint);

#endif
