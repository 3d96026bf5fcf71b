#include <math.h>
#include <stdlib.h>

#include "fit/render/bench.h"
#include "fit/render/ciede2000.h"

#define EPSILON 1e-4 /* of the mean squared, in relMSE */

int bench_reference_make(struct bench_reference *r, const struct scene *scene, struct err *e) {
    size_t n = (size_t)scene->image.width * (size_t)scene->image.height;
    r->n = (int)n;
    r->half[0] = malloc(3 * n * sizeof(double));
    r->half[1] = malloc(3 * n * sizeof(double));
    r->shown = calloc(n, 1);
    return r->half[0] && r->half[1] && r->shown ? 0 : err_set(e, ERR_NOMEM, "no memory for a reference");
}

void bench_reference_free(struct bench_reference *r) {
    free(r->half[0]);
    free(r->half[1]);
    free(r->shown);
}

static int by_size(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double mean_y(const struct bench_reference *r) {
    double sum = 0;
    int n = 0;
    for (int i = 0; i < r->n; i++) {
        if (r->shown[i] & 1) {
            sum += (r->half[0][3 * i + 1] + r->half[1][3 * i + 1]) / 2;
            n++;
        }
    }
    return n ? sum / n : 1;
}

struct sums {
    double all, edge, inner, relative;
    int n, n_edge, n_inner;
};

static double root_mean(double sum, int n) {
    return n ? sqrt(sum / (3.0 * n)) : 0;
}

static void compare_pixel(const struct bench_reference *r, int i, const double *xyz, double mean,
                          struct sums *sums, struct bench_error *out) {
    double square = 0;
    for (int k = 0; k < 3; k++) {
        double expected = (r->half[0][3 * i + k] + r->half[1][3 * i + k]) / 2, d = xyz[3 * i + k] - expected;
        square += d * d;
        sums->relative += d * d / (expected * expected + EPSILON * mean * mean);
        out->largest = fmax(out->largest, fabs(d) / mean);
    }
    sums->all += square;
    sums->n++;
    if (r->shown[i] & 2) {
        sums->edge += square;
        sums->n_edge++;
    } else {
        sums->inner += square;
        sums->n_inner++;
    }
}

static double difference(const struct bench_reference *r, int i, const double *xyz, const double white[3]) {
    double expected[3], lab1[3], lab2[3];
    for (int k = 0; k < 3; k++) {
        expected[k] = (r->half[0][3 * i + k] + r->half[1][3 * i + k]) / 2;
    }
    colour_lab(expected, white, lab1);
    colour_lab(xyz + 3L * i, white, lab2);
    return ciede2000(lab1, lab2);
}

int bench_compare(const struct bench_reference *r, const double *xyz, const double white[3],
                  struct bench_error *out, struct err *e) {
    struct sums sums = {0};
    double mean = mean_y(r), *de = malloc((size_t)r->n * sizeof *de);
    if (!de) {
        return err_set(e, ERR_NOMEM, "no memory to compare");
    }
    for (int i = 0; i < r->n; i++) {
        if (r->shown[i] & 1) {
            de[sums.n] = difference(r, i, xyz, white);
            out->de_mean += de[sums.n];
            compare_pixel(r, i, xyz, mean, &sums, out);
        }
    }
    out->rmse = root_mean(sums.all, sums.n) / mean;
    out->edge_rmse = root_mean(sums.edge, sums.n_edge) / mean;
    out->inner_rmse = root_mean(sums.inner, sums.n_inner) / mean;
    out->relmse = sums.n ? sums.relative / (3.0 * sums.n) : 0;
    out->de_mean /= sums.n ? sums.n : 1;
    qsort(de, (size_t)sums.n, sizeof *de, by_size);
    out->de_p95 = sums.n ? de[(int)(0.95 * (sums.n - 1))] : 0;
    out->de_largest = sums.n ? de[sums.n - 1] : 0;
    free(de);
    return 0;
}

double bench_floor(const struct bench_reference *r) {
    double sum = 0;
    int n = 0;
    for (int i = 0; i < r->n; i++) {
        for (int k = 0; k < 3 && (r->shown[i] & 1); k++) {
            double d = r->half[0][3 * i + k] - r->half[1][3 * i + k];
            sum += d * d;
            n++;
        }
    }
    return n ? sqrt(sum / n) / 2 / mean_y(r) : 0;
}

double bench_slope(const struct bench_error *row, int n) {
    double sx = 0, sy = 0, sxx = 0, sxy = 0;
    for (int i = 0; i < n; i++) {
        double x = log(row[i].samples), y = log(row[i].rmse);
        sx += x;
        sy += y;
        sxx += x * x;
        sxy += x * y;
    }
    return (n * sxy - sx * sy) / (n * sxx - sx * sx);
}
