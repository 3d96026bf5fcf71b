#include "fit/coordinates.h"

#include <math.h>
#include <string.h>

#include "fit/fresnel.h"

/* x = ln(value - origin), or the value itself. The bounds are those of measurement.md 10; A stands for
 * beta' > 0: seven decades under and over a perfect diffuser. */
static const struct {
    double low, high, origin;
    bool linear;
} scales[] = {
    [REFLECTANCE_ALBEDO] = {1e-4, 1.5, 0, false},     [REFLECTANCE_ROUGHNESS] = {0.01, 1, 0, false},
    [REFLECTANCE_WIDTH] = {0.01, 1, 0, false},        [REFLECTANCE_HEIGHT] = {1e-7, 1e7, 0, false},
    [REFLECTANCE_INDEX] = {1.3, 3, 1, false},         [REFLECTANCE_TAIL] = {0, 2, 0, true},
    [REFLECTANCE_TRANSMISSION] = {1.01, 3, 1, false},
};

static double fresnel_45(double n, double *slope) {
    return fresnel_reflectance(M_SQRT1_2, 0.5, n, 0, slope);
}

static double to_x(enum reflectance_kind kind, double value) {
    return scales[kind].linear ? value : log(value - scales[kind].origin);
}

static enum reflectance_kind kind_of(enum reflectance_model model, int column) {
    return reflectance_kind(model, reflectance_parameter(model, column));
}

void coordinates_bounds(enum reflectance_model model, double *low, double *high) {
    for (int j = 0; j < reflectance_parameters(model); j++) {
        enum reflectance_kind kind = kind_of(model, j);
        low[j] = to_x(kind, scales[kind].low);
        high[j] = to_x(kind, scales[kind].high);
    }
}

void coordinates_from_value(enum reflectance_model model, const double *value, double *x) {
    double slope;
    for (int j = 0; j < reflectance_parameters(model); j++) {
        enum reflectance_kind kind = kind_of(model, j);
        double factor = kind == REFLECTANCE_HEIGHT ? fresnel_45(value[MATERIAL_N], &slope) : 1;
        x[j] = to_x(kind, factor * value[reflectance_parameter(model, j)]);
    }
}

void coordinates_to_value(enum reflectance_model model, const double *x, double *value) {
    int k = reflectance_parameters(model), column_n = reflectance_column(model, MATERIAL_N);
    double slope, f = column_n >= 0 ? fresnel_45(1 + exp(x[column_n]), &slope) : 1;
    memset(value, 0, MATERIAL_PARAMETERS * sizeof *value);
    for (int j = 0; j < k; j++) {
        enum reflectance_kind kind = kind_of(model, j);
        double plain = scales[kind].linear ? x[j] : scales[kind].origin + exp(x[j]);
        value[reflectance_parameter(model, j)] = kind == REFLECTANCE_HEIGHT ? plain / f : plain;
    }
}

static void swap(double *a, double *b) {
    double held = *a;
    *a = *b;
    *b = held;
}

void coordinates_order(enum reflectance_model model, double *x) {
    int second = reflectance_column(model, MATERIAL_EXTRA_1),
        gamma = reflectance_column(model, MATERIAL_GAMMA);
    if (second >= 0 && kind_of(model, second) == REFLECTANCE_WIDTH && x[second] < x[gamma]) {
        swap(&x[gamma], &x[second]);
        swap(&x[reflectance_column(model, MATERIAL_BETA_PRIME)],
             &x[reflectance_column(model, MATERIAL_EXTRA_2)]);
    }
}

double coordinates_scale(enum reflectance_model model, const double *value, int column) {
    enum reflectance_kind kind = kind_of(model, column);
    return scales[kind].linear ? 1 : value[reflectance_parameter(model, column)] - scales[kind].origin;
}

void coordinates_chain(enum reflectance_model model, const double *value, double *chain) {
    int k = reflectance_parameters(model), column_n = reflectance_column(model, MATERIAL_N);
    memset(chain, 0, (size_t)(k * k) * sizeof *chain);
    for (int j = 0; j < k; j++) {
        chain[j * k + j] = coordinates_scale(model, value, j);
    }
    for (int j = 0; j < k && column_n >= 0; j++) {
        if (kind_of(model, j) == REFLECTANCE_HEIGHT) { /* A held, beta' answers to n */
            double slope, f = fresnel_45(value[MATERIAL_N], &slope);
            chain[j * k + column_n] = -chain[j * k + j] * slope / f * chain[column_n * k + column_n];
        }
    }
}
