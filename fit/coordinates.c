#include "fit/coordinates.h"

#include <math.h>
#include <string.h>

/* measurement.md 10; A stands for beta' > 0: seven decades under and over a perfect diffuser. */
static const double bound[][2] = {[MATERIAL_S] = {1e-4, 1.5},
                                  [MATERIAL_SIGMA] = {0.01, 1},
                                  [MATERIAL_GAMMA] = {0.01, 1},
                                  [MATERIAL_BETA_PRIME] = {1e-7, 1e7},
                                  [MATERIAL_N] = {1.3, 3}};

static double fresnel_45(double n, double *slope) {
    return reflectance_fresnel(M_SQRT1_2, 0.5, n, slope);
}

void coordinates_bounds(enum reflectance_model model, double *low, double *high) {
    for (int j = 0; j < reflectance_parameters(model); j++) {
        enum material_parameter p = reflectance_parameter(model, j);
        double shift = p == MATERIAL_N ? 1 : 0;
        low[j] = log(bound[p][0] - shift);
        high[j] = log(bound[p][1] - shift);
    }
}

void coordinates_from_value(enum reflectance_model model, const double *value, double *x) {
    double slope;
    for (int j = 0; j < reflectance_parameters(model); j++) {
        enum material_parameter p = reflectance_parameter(model, j);
        double factor = p == MATERIAL_BETA_PRIME ? fresnel_45(value[MATERIAL_N], &slope) : 1;
        x[j] = log(p == MATERIAL_N ? value[p] - 1 : factor * value[p]);
    }
}

void coordinates_to_value(enum reflectance_model model, const double *x, double *value) {
    memset(value, 0, MATERIAL_PARAMETERS * sizeof *value);
    for (int j = 0; j < reflectance_parameters(model); j++) {
        enum material_parameter p = reflectance_parameter(model, j);
        value[p] = p == MATERIAL_N ? 1 + exp(x[j]) : exp(x[j]);
    }
    if (value[MATERIAL_N] > 1) {
        double slope;
        value[MATERIAL_BETA_PRIME] /= fresnel_45(value[MATERIAL_N], &slope);
    }
}

void coordinates_chain(enum reflectance_model model, const double *value, double *chain) {
    int k = reflectance_parameters(model), column_b = -1, column_n = -1;
    memset(chain, 0, (size_t)(k * k) * sizeof *chain);
    for (int j = 0; j < k; j++) {
        enum material_parameter p = reflectance_parameter(model, j);
        chain[j * k + j] = p == MATERIAL_N ? value[p] - 1 : value[p];
        column_b = p == MATERIAL_BETA_PRIME ? j : column_b;
        column_n = p == MATERIAL_N ? j : column_n;
    }
    if (column_b >= 0 && column_n >= 0) { /* A held, beta' answers to n */
        double slope, f = fresnel_45(value[MATERIAL_N], &slope);
        chain[column_b * k + column_n] = -value[MATERIAL_BETA_PRIME] * slope / f * (value[MATERIAL_N] - 1);
    }
}
