#include "proto/spectrum.h"

#include <math.h>
#include <stdlib.h>

#include "proto/csv.h"
#include "proto/file.h"

struct sample {
    double lambda_nm, value;
    struct csv_cell place;
};

static int by_wavelength(const void *a, const void *b) {
    const struct sample *x = a, *y = b;
    if (x->lambda_nm != y->lambda_nm)
        return x->lambda_nm < y->lambda_nm ? -1 : 1;
    return x->place.line - y->place.line;
}

static int read_rows(const struct csv *csv, const int *column, struct sample *sample,
                     struct err_list *errors) {
    int rc = 0;
    for (size_t i = 0; i < csv->n_rows; i++) {
        const struct csv_cell *row = csv->cell + i * csv->n_columns;
        sample[i].place = row[column[0]];
        if (csv_number(csv, &row[column[0]], "lambda_nm", 100, 5000, &sample[i].lambda_nm, errors) != 0 ||
            csv_number(csv, &row[column[1]], "value", -1e6, 1e6, &sample[i].value, errors) != 0)
            rc = -ERR_INPUT;
    }
    if (rc != 0)
        return rc;
    qsort(sample, csv->n_rows, sizeof *sample, by_wavelength);
    for (size_t i = 1; i < csv->n_rows; i++)
        if (sample[i].lambda_nm == sample[i - 1].lambda_nm)
            rc = csv_error(csv, &sample[i].place, errors, "%g nm stands here a second time; first in line %d",
                           sample[i].lambda_nm, sample[i - 1].place.line);
    return rc;
}

static void resample(const struct sample *sample, size_t n, struct spectrum *spectrum) {
    size_t right = 0;
    for (int k = 0; k < BANDS; k++) {
        double nm = band_nm(k);
        while (right < n && sample[right].lambda_nm < nm)
            right++;
        bool on_node = right < n && sample[right].lambda_nm == nm;
        spectrum->covered[k] = on_node || (right > 0 && right < n);
        spectrum->value[k] = NAN;
        if (on_node) {
            spectrum->value[k] = sample[right].value;
        } else if (spectrum->covered[k]) {
            const struct sample *a = &sample[right - 1], *b = &sample[right];
            double t = (nm - a->lambda_nm) / (b->lambda_nm - a->lambda_nm);
            spectrum->value[k] = a->value + t * (b->value - a->value);
        }
    }
}

static int read_table(const struct csv *csv, struct spectrum *spectrum, struct err_list *errors) {
    static const char *const wanted[] = {"lambda_nm", "value", NULL};
    int column[2];
    if (csv_columns(csv, wanted, 2, column, errors) != 0)
        return -ERR_INPUT;
    struct sample *sample = calloc(csv->n_rows, sizeof *sample);
    if (!sample)
        return csv_error(csv, NULL, errors, "no memory left to read this file");
    int rc = read_rows(csv, column, sample, errors);
    if (rc == 0)
        resample(sample, csv->n_rows, spectrum);
    free(sample);
    return rc;
}

int spectrum_read_text(const char *file, const char *text, size_t size, struct spectrum *spectrum,
                       struct err_list *errors) {
    struct csv csv;
    int rc = csv_parse(file, text, size, &csv, errors);
    if (rc != 0)
        return rc;
    rc = read_table(&csv, spectrum, errors);
    csv_free(&csv);
    return rc;
}

int spectrum_read_file(const char *path, struct spectrum *spectrum, struct err_list *errors) {
    struct err e = {0};
    char *text = NULL;
    size_t size = 0;
    int rc = file_read(path, SPECTRUM_BYTES_MAX, &text, &size, &e);
    if (rc != 0) {
        err_list_add(errors, &e);
        return rc;
    }
    rc = spectrum_read_text(path, text, size, spectrum, errors);
    free(text);
    return rc;
}
