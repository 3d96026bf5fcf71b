#include "proto/nist.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "proto/csv.h"

#define WAVELENGTHS_MAX 4096
#define NM_PER_UM 1000

enum column { LAMBDA, THETA_I, PHI_I, THETA_R, PHI_R, F, COLUMNS };

static const struct {
    const char *name, *other;
    double low, high;
} columns[COLUMNS] = {[LAMBDA] = {"lambda", NULL, 0.1, 5},  [THETA_I] = {"thetai", NULL, -90, 90},
                      [PHI_I] = {"phi", "phii", -360, 360}, [THETA_R] = {"thetar", NULL, -90, 90},
                      [PHI_R] = {"phir", NULL, -360, 360},  [F] = {"f_r11", "fr11", -1e6, 1e6}};

struct row {
    double value[COLUMNS];
};

static int find_columns(const struct csv *csv, int *at, struct err_list *errors) {
    int status = 0;
    for (int c = 0; c < COLUMNS; c++) {
        at[c] = -1;
        for (size_t i = 0; i < csv->n_columns; i++)
            if (strcmp(csv->name[i].text, columns[c].name) == 0 ||
                (columns[c].other && strcmp(csv->name[i].text, columns[c].other) == 0))
                at[c] = (int)i;
        if (at[c] < 0)
            status = csv_error(csv, &csv->name[0], errors, "the column '%s' is missing", columns[c].name);
    }
    return status;
}

static int read_rows(const struct csv *csv, const int *at, struct row *row, struct err_list *errors) {
    int status = 0;
    for (size_t i = 0; i < csv->n_rows; i++)
        for (int c = 0; c < COLUMNS; c++) {
            int rc = csv_number(csv, &csv->cell[i * csv->n_columns + (size_t)at[c]], columns[c].name,
                                columns[c].low, columns[c].high, &row[i].value[c], errors);
            status = rc ? rc : status;
        }
    return status;
}

static int compare(double a, double b) {
    return (a > b) - (a < b);
}

static bool same_geometry(const struct row *a, const struct row *b) {
    for (int c = THETA_I; c <= PHI_R; c++)
        if (a->value[c] != b->value[c])
            return false;
    return true;
}

static int by_geometry(const void *a, const void *b) {
    const struct row *x = a, *y = b;
    for (int c = THETA_I; c <= PHI_R; c++)
        if (x->value[c] != y->value[c])
            return compare(x->value[c], y->value[c]);
    return compare(x->value[LAMBDA], y->value[LAMBDA]);
}

static int by_number(const void *a, const void *b) {
    return compare(*(const double *)a, *(const double *)b);
}

static int find_wavelengths(const struct csv *csv, const struct row *row, struct brdf *b,
                            struct err_list *errors) {
    b->lambda_nm = calloc(csv->n_rows, sizeof *b->lambda_nm);
    if (!b->lambda_nm)
        return csv_error(csv, NULL, errors, "no memory left to read this file");
    for (size_t i = 0; i < csv->n_rows; i++)
        b->lambda_nm[i] = row[i].value[LAMBDA] * NM_PER_UM;
    qsort(b->lambda_nm, csv->n_rows, sizeof *b->lambda_nm, by_number);
    for (size_t i = 0; i < csv->n_rows; i++)
        if (b->n_lambda == 0 || b->lambda_nm[i] > b->lambda_nm[b->n_lambda - 1])
            b->lambda_nm[b->n_lambda++] = b->lambda_nm[i];
    if (b->n_lambda > WAVELENGTHS_MAX)
        return csv_error(csv, &csv->name[0], errors, "%zu wavelengths; at most %d are read", b->n_lambda,
                         WAVELENGTHS_MAX);
    return 0;
}

static int gather(const struct csv *csv, struct row *row, struct brdf *b, struct err_list *errors) {
    qsort(row, csv->n_rows, sizeof *row, by_geometry);
    for (size_t i = 0; i < csv->n_rows; i++) {
        const double *v = row[i].value;
        struct err e = {0};
        if ((i == 0 || !same_geometry(&row[i], &row[i - 1])) &&
            brdf_add(b, v[THETA_I], v[PHI_I], v[THETA_R], v[PHI_R], &e) != 0) {
            err_list_add(errors, &e);
            return -e.code;
        }
        double nm = v[LAMBDA] * NM_PER_UM;
        double *lambda = bsearch(&nm, b->lambda_nm, b->n_lambda, sizeof nm, by_number);
        double *beta = &b->beta[(b->n - 1) * b->n_lambda + (size_t)(lambda - b->lambda_nm)];
        if (!isnan(*beta))
            return csv_error(csv, NULL, errors,
                             "two values for %g nm at thetai %g, thetar %g, phir %g; keep one of them", nm,
                             v[THETA_I], v[THETA_R], v[PHI_R]);
        *beta = M_PI * v[F];
    }
    return 0;
}

static int take_table(const struct csv *csv, struct brdf *b, struct err_list *errors) {
    int at[COLUMNS], rc = find_columns(csv, at, errors);
    if (rc != 0)
        return rc;
    struct row *row = calloc(csv->n_rows, sizeof *row);
    if (!row)
        return csv_error(csv, NULL, errors, "no memory left to read this file");
    rc = read_rows(csv, at, row, errors);
    if (rc == 0)
        rc = find_wavelengths(csv, row, b, errors);
    if (rc == 0)
        rc = gather(csv, row, b, errors);
    free(row);
    return rc;
}

int nist_read_text(const char *file, const char *text, size_t size, struct brdf *brdf,
                   struct err_list *errors) {
    struct csv csv;
    memset(brdf, 0, sizeof *brdf);
    int rc = csv_parse(file, text, size, &csv, errors);
    if (rc != 0)
        return rc;
    rc = take_table(&csv, brdf, errors);
    csv_free(&csv);
    if (rc != 0)
        brdf_free(brdf);
    return rc;
}
