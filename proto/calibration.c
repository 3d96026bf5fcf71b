#include "proto/calibration.h"

#include <math.h>

#define FULL_SCALE 65535

static double polynomial(const double *coefficient, int order, double x) {
    double sum = coefficient[order];
    for (int k = order - 1; k >= 0; k--)
        sum = sum * x + coefficient[k];
    return sum;
}

double calibration_lambda_nm(const struct calibration *c, int pixel) {
    return polynomial(c->wavelength, 3, pixel);
}

void calibration_judge_nonlinearity(struct calibration *c) {
    c->nonlinearity_used = false;
    if (c->nonlinearity_order < 0 || c->nonlinearity_order > 7)
        return;
    for (int k = 0; k <= c->nonlinearity_order; k++)
        if (!isfinite(c->nonlinearity[k]))
            return;
    if (c->nonlinearity[0] < 0.5 || c->nonlinearity[0] > 1.5)
        return;
    for (int s = 0; s <= FULL_SCALE; s++)
        if (!(polynomial(c->nonlinearity, c->nonlinearity_order, s) > 0))
            return;
    c->nonlinearity_used = true;
}
