#include "fit/cholesky.h"

#include <math.h>

#include "fit/coordinates.h"

#define ROUNDING 4e-16 /* a pivot this small beside its diagonal is what cancellation left */

bool cholesky_factor(int k, const double *a, double *l) {
    for (int i = 0; i < k; i++) {
        for (int j = 0; j <= i; j++) {
            double sum = a[i * k + j];
            for (int m = 0; m < j; m++) {
                sum -= l[i * k + m] * l[j * k + m];
            }
            if (i > j) {
                l[i * k + j] = sum / l[j * k + j];
            } else if (sum > ROUNDING * a[i * k + i] && isfinite(sum)) {
                l[i * k + i] = sqrt(sum);
            } else {
                return false;
            }
        }
    }
    return true;
}

void cholesky_lower(int k, const double *l, const double *b, double *y) {
    for (int i = 0; i < k; i++) {
        double sum = b[i];
        for (int m = 0; m < i; m++) {
            sum -= l[i * k + m] * y[m];
        }
        y[i] = sum / l[i * k + i];
    }
}

void cholesky_solve(int k, const double *l, const double *b, double *x) {
    cholesky_lower(k, l, b, x);
    for (int i = k - 1; i >= 0; i--) {
        double sum = x[i];
        for (int m = i + 1; m < k; m++) {
            sum -= l[m * k + i] * x[m];
        }
        x[i] = sum / l[i * k + i];
    }
}

static double row_sum(int k, const double *row) {
    double sum = 0;
    for (int j = 0; j < k; j++) {
        sum += fabs(row[j]);
    }
    return sum;
}

double cholesky_condition(int k, const double *a) {
    double scaled[COORDINATES_MAX * COORDINATES_MAX] = {0}, l[COORDINATES_MAX * COORDINATES_MAX];
    double norm = 0, inverse_norm = 0;
    for (int i = 0; i < k; i++) {
        for (int j = 0; j < k; j++) {
            scaled[i * k + j] = a[i * k + j] / sqrt(a[i * k + i] * a[j * k + j]);
        }
    }
    if (!cholesky_factor(k, scaled, l)) {
        return INFINITY;
    }
    for (int i = 0; i < k; i++) {
        double column[COORDINATES_MAX] = {0};
        column[i] = 1;
        cholesky_solve(k, l, column, column);
        norm = fmax(norm, row_sum(k, scaled + i * k));
        inverse_norm = fmax(inverse_norm, row_sum(k, column)); /* symmetric: a column is a row */
    }
    return norm * inverse_norm;
}
