#include "fit/points_csv.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/csv.h"

enum column { THETA_I, THETA_V, BETA, U_BETA, U_IND, U_COMMON_REL, COLUMNS };
static const char *const names[COLUMNS] = {"theta_i_deg", "theta_v_deg", "beta",
                                           "u_beta",      "u_ind",       "u_common_rel"};

struct layout {
    int column[COLUMNS]; /* -1 = absent */
    int beta_band[BANDS], u_band[BANDS];
    bool spectral;
};

/* "beta_550nm" or "u_550nm": the wavelength, or a number below 0. */
static double wavelength_of(const char *name, const char *prefix) {
    double nm = -1;
    int end = 0;
    size_t n = strlen(prefix);
    if (strncmp(name, prefix, n) != 0 || sscanf(name + n, "%lfnm%n", &nm, &end) != 1 || end == 0 ||
        name[n + (size_t)end]) {
        return -1;
    }
    return nm;
}

static int take_band(const struct csv *csv, int at, double nm, int *bands, struct err_list *errors) {
    long band = lround((nm - BAND_FIRST_NM) / BAND_STEP_NM);
    if (band < 0 || band >= BANDS) {
        return csv_error(csv, &csv->name[at], errors, "%g nm is outside 380 to 780 nm", nm);
    }
    if (bands[band] >= 0) {
        return csv_error(csv, &csv->name[at], errors, "'%s' falls into the same 5 nm band as '%s'",
                         csv->name[at].text, csv->name[bands[band]].text);
    }
    bands[band] = at;
    return 0;
}

static int take_column(const struct csv *csv, int at, struct layout *l, struct err_list *errors) {
    const char *name = csv->name[at].text;
    for (int c = 0; c < COLUMNS; c++) {
        if (strcmp(name, names[c]) == 0) {
            if (l->column[c] >= 0) {
                return csv_error(csv, &csv->name[at], errors, "column '%s' is there twice", name);
            }
            l->column[c] = at;
            return 0;
        }
    }
    double beta_nm = wavelength_of(name, "beta_"), u_nm = wavelength_of(name, "u_");
    if (beta_nm >= 0) {
        l->spectral = true;
        return take_band(csv, at, beta_nm, l->beta_band, errors);
    }
    if (u_nm >= 0) {
        return take_band(csv, at, u_nm, l->u_band, errors);
    }
    return csv_error(
        csv, &csv->name[at], errors,
        "unknown column '%s'; known are theta_i_deg, theta_v_deg, beta, u_beta, u_ind, u_common_rel, and "
        "beta_550nm, u_550nm for any wavelength",
        name);
}

static int find_layout(const struct csv *csv, struct layout *l, struct err_list *errors) {
    int status = 0;
    memset(l, 0xff, sizeof *l); /* -1 everywhere */
    l->spectral = false;
    for (size_t i = 0; i < csv->n_columns; i++) {
        int taken = take_column(csv, (int)i, l, errors);
        status = status ? status : taken;
    }
    for (int c = THETA_I; c <= BETA && !status; c++) {
        if (l->column[c] < 0 && !(c == BETA && l->spectral)) {
            status = csv_error(csv, &csv->name[0], errors, "column '%s' is missing", names[c]);
        }
    }
    if (!status && l->spectral && l->column[BETA] >= 0) {
        status = csv_error(csv, &csv->name[l->column[BETA]], errors,
                           "give either 'beta' or columns by wavelength, not both");
    }
    for (int c = U_BETA; c <= U_IND && !status; c++) {
        if (l->spectral && l->column[c] >= 0) {
            status = csv_error(csv, &csv->name[l->column[c]], errors,
                               "'%s' belongs to the column 'beta'; by wavelength write u_550nm", names[c]);
        }
    }
    return status;
}

static int read_cell(const struct csv *csv, size_t row, int column, const char *name, double low, double high,
                     double *value, struct err_list *errors) {
    *value = NAN;
    return column < 0 ? 0
                      : csv_number(csv, &csv->cell[row * csv->n_columns + (size_t)column], name, low, high,
                                   value, errors);
}

/* The mean over the columns within mean_nm, and its independent u. */
static void take_mean(const struct fitset *d, struct fitset_point *point) {
    double sum = 0, square = 0;
    int count = 0;
    for (int b = 0; b < BANDS; b++) {
        if (!isnan(point->bands[b]) && band_nm(b) >= d->input.mean_low_nm &&
            band_nm(b) <= d->input.mean_high_nm) {
            sum += point->bands[b];
            square += point->bands_u[b] * point->bands_u[b];
            count++;
        }
    }
    point->beta = sum / count;
    point->u_ind = sqrt(square) / count;
}

static int read_bands(const struct csv *csv, size_t row, const struct layout *l, double *bands, double *u,
                      struct err_list *errors) {
    int status = 0;
    for (int b = 0; b < BANDS; b++) {
        int got = read_cell(csv, row, l->beta_band[b], "a radiance factor", -1e12, 1e12, &bands[b], errors);
        status = status ? status : got;
        got = read_cell(csv, row, l->u_band[b], "an uncertainty", 0, 1e12, &u[b], errors);
        status = status ? status : got;
    }
    return status;
}

static int add_common(struct fitset *d, const double *cell, double beta, struct err *e) {
    double change = 0;
    if (!isnan(cell[U_COMMON_REL])) {
        change = cell[U_COMMON_REL] * beta;
    } else if (!isnan(cell[U_BETA]) && !isnan(cell[U_IND])) {
        change = sqrt(fmax(cell[U_BETA] * cell[U_BETA] - cell[U_IND] * cell[U_IND], 0));
    }
    return change == 0 ? 0 : fitset_add_cause(d, "common", d->n - 1, change, NULL, e);
}

static int read_row(const struct csv *csv, size_t row, const struct layout *l, struct fitset *d,
                    struct err_list *errors) {
    static const double low[COLUMNS] = {0, -89.9999, -1e12, 0, 0, 0};
    static const double high[COLUMNS] = {89.9999, 89.9999, 1e12, 1e12, 1e12, 10};
    double cell[COLUMNS], bands[BANDS], bands_u[BANDS];
    int status = 0;
    for (int c = 0; c < COLUMNS; c++) {
        int got = read_cell(csv, row, l->column[c], names[c], low[c], high[c], &cell[c], errors);
        status = status ? status : got;
    }
    struct fitset_point point = {.theta_i_deg = cell[THETA_I],
                                 .theta_v_deg = cell[THETA_V],
                                 .beta = cell[BETA],
                                 .u_ind = isnan(cell[U_IND]) ? cell[U_BETA] : cell[U_IND]};
    if (l->spectral) {
        int got = read_bands(csv, row, l, bands, bands_u, errors);
        status = status ? status : got;
        point.bands = bands;
        point.bands_u = bands_u;
    }
    if (status) {
        return status;
    }
    if (l->spectral) {
        take_mean(d, &point);
    }
    struct err e = {0};
    if (isnan(point.beta)) {
        d->mask.left_out[MASK_NO_VALUE]++;
        return 0;
    }
    if (!mask_admits(&d->mask, point.theta_i_deg, fabs(point.theta_v_deg), point.theta_v_deg > 0 ? 180 : 0)) {
        return 0;
    }
    if ((status = fitset_add_point(d, &point, &e)) || (status = add_common(d, cell, point.beta, &e))) {
        err_list_add(errors, &e);
    }
    return status;
}

int points_csv_read(const char *file, const char *text, size_t size, struct fitset *data,
                    struct err_list *errors) {
    struct csv csv;
    struct layout layout;
    int status = csv_parse(file, text, size, &csv, errors);
    if (status) {
        return status;
    }
    status = find_layout(&csv, &layout, errors);
    bool readable = status == 0;
    for (size_t row = 0; readable && row < csv.n_rows; row++) {
        int got = read_row(&csv, row, &layout, data, errors);
        status = status ? status : got;
    }
    data->independence_assumed = !layout.spectral && layout.column[U_BETA] >= 0 && layout.column[U_IND] < 0 &&
                                 layout.column[U_COMMON_REL] < 0;
    csv_free(&csv);
    return status;
}
