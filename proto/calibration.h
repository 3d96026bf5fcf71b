/*
 * calibration.h — what a spectrometer says of itself, and the scale from its raw counts to light.
 *
 * lambda(p) = c0 + c1 p + c2 p^2 + c3 p^3 nm, p = 0-based index in the stream including dark pixels.
 * scaled = raw * 65535 / saturation; S' = scaled - mean of the dark pixels of the same scan;
 * linear = S' / P(S'), P = sum of nonlinearity[k] S'^k (spectrometer-ocean.md 5). With an unprogrammed or absurd
 * polynomial (not finite, P(0) outside 0.5..1.5, P <= 0 in range) nonlinearity_used is false and P is 1. Stored in
 * the session, so that a reduction needs no device.
 * Checked    tests/unit/test_calibration.c
 */
#ifndef PROTO_CALIBRATION_H
#define PROTO_CALIBRATION_H

#include <stdbool.h>

struct calibration {
    char model[24];
    char serial[24];
    int pixels;
    int dark_first, dark_last, active_first, active_last; /* 0-based, inclusive */
    double wavelength[4];
    double nonlinearity[8];
    int nonlinearity_order;
    bool nonlinearity_used;
    int saturation;                                /* raw counts; 65535 where the slot is not programmed */
    double read_noise_counts, electrons_per_count; /* of the model, for the count-noise model */
};

double calibration_lambda_nm(const struct calibration *c, int pixel);
/* Looks at the polynomial and sets nonlinearity_used. */
void calibration_judge_nonlinearity(struct calibration *c);

#endif
