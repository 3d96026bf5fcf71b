#include "tests/support/pulls.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/fitset.h"
#include "fit/points_session.h"

#define K DATASET_PARAMETERS
#define P_MIN 1e-4 /* measurement.md 11 */
#define U_95 1.96
#define COVERAGE 0.95
#define COVERAGE_LOW 0.915 /* 3.6 standard deviations of a count of 500 */
#define COVERAGE_HIGH 0.98
#define COVERAGE_SEEDS 500

/* ---- one estimate ---- */

/* d^T C^-1 d by Cholesky: C = L L^T, y = L^-1 d, y^T y. */
static double distance2(double c[K][K], const double d[K]) {
    double y[K], sum = 0;
    for (int i = 0; i < K; i++) {
        for (int j = 0; j <= i; j++) {
            for (int k = 0; k < j; k++)
                c[i][j] -= c[i][k] * c[j][k];
            if (i == j && !(c[i][i] > 0))
                fail_msg("the covariance of the estimate is not positive definite");
            c[i][j] = i == j ? sqrt(c[i][i]) : c[i][j] / c[j][j];
        }
        y[i] = d[i];
        for (int k = 0; k < i; k++)
            y[i] -= c[i][k] * y[k];
        y[i] /= c[i][i];
        sum += y[i] * y[i];
    }
    return sum;
}

void pulls_of(const struct dataset *d, struct pull *pull) {
    const struct estimate *m = &d->estimate;
    double off[K], scale[K], correlation[K][K];
    if (!d->has_estimate || !d->has_truth || m->provisional)
        fail_msg("%s has no final estimate or no truth", d->name);
    for (int k = 0; k < K; k++) {
        if (m->at_bound[k] || m->not_identifiable[k])
            fail_msg("%s: parameter %d has no standard uncertainty", d->name, k);
        scale[k] = dataset_u(m, k);
        off[k] = pull->of[k] = (m->value[k] - d->truth[k]) / scale[k];
    }
    for (int i = 0; i < K; i++)
        for (int j = 0; j < K; j++)
            correlation[i][j] = (m->statistical[i][j] + m->common[i][j]) / (scale[i] * scale[j]);
    pull->distance2 = distance2(correlation, off);
}

static bool is_noise(const char *cause) {
    return strchr(cause, '/') != NULL; /* dark/ID, reading/ID, ...: daemon/reduce_point.c */
}

void pulls_refit(struct dataset *d, const char *path) {
    struct fitset points;
    struct err e = {0};
    fitset_init(&points);
    if (points_session_read(path, &points, &e) < 0)
        fail_msg("%s", e.text);
    for (size_t c = 0; c < points.n_causes; c++)
        if (!is_noise(points.cause[c].name))
            points.cause[c].n = 0;
    points.input.u_zero_source_deg = points.input.u_zero_sample_deg = points.input.u_polarisation = 0;
    if (fitset_fit(&points, &d->estimate, &e) < 0)
        fail_msg("%s", e.text);
    fitset_free(&points);
}

/* ---- many ---- */

double pulls_chi2_5(double x) {
    return x <= 0 ? 0 : erf(sqrt(x / 2)) - sqrt(2 * x / M_PI) * exp(-x / 2) * (1 + x / 3);
}

static int ascending(const void *a, const void *b) {
    const double *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

double pulls_kolmogorov(double *value, int n) {
    double far = 0, p = 0;
    qsort(value, (size_t)n, sizeof *value, ascending);
    for (int i = 0; i < n; i++)
        far = fmax(far, fmax(value[i] - (double)i / n, (i + 1.0) / n - value[i]));
    double x = far * (sqrt(n) + 0.12 + 0.11 / sqrt(n));
    for (int k = 1; k <= 100; k++)
        p += 2 * (k % 2 ? 1 : -1) * exp(-2.0 * k * k * x * x);
    return x < 0.2 ? 1 : fmin(fmax(p, 0), 1); /* the series does not converge near 0, where p is 1 */
}

static int judge_distances(const struct pulls *p, int sample) {
    double value[PULLS_SEEDS], mean = 0;
    for (int s = 0; s < p->n_seeds; s++) {
        mean += p->pull[s][sample].distance2 / p->n_seeds;
        value[s] = pulls_chi2_5(p->pull[s][sample].distance2);
    }
    double probability = pulls_kolmogorov(value, p->n_seeds);
    print_message("#   distance^2 of 5 degrees: mean %.2f, Kolmogorov p = %.3g%s\n", mean, probability,
                  probability > P_MIN ? "" : "  TOO SMALL");
    return !(probability > P_MIN);
}

struct moments {
    double mean, rms, worst, within; /* within: share of them inside 1.96 u */
};

/* sample < 0: of all. */
static struct moments moments_of(const struct pulls *p, int sample, int parameter) {
    struct moments m = {0};
    int n = 0;
    for (int s = 0; s < p->n_seeds; s++)
        for (int i = 0; i < p->n_samples; i++) {
            double x = p->pull[s][i].of[parameter];
            if (sample >= 0 && i != sample)
                continue;
            m.mean += x;
            m.rms += x * x;
            m.worst = fabs(x) > fabs(m.worst) ? x : m.worst;
            m.within += fabs(x) <= U_95;
            n++;
        }
    return (struct moments){m.mean / n, sqrt(m.rms / n), m.worst, m.within / n};
}

/* A count of fewer seeds scatters more, and is a whole number. */
static double coverage_limit(const struct pulls *p, double limit) {
    const double n = p->n_seeds, side = limit < COVERAGE ? -1 : 1;
    return n < COVERAGE_SEEDS ? COVERAGE + (limit - COVERAGE) * sqrt(COVERAGE_SEEDS / n) + side / n : limit;
}

static int judge_means(const struct pulls *p, int sample) {
    const double limit = fmax(0.3, 4 / sqrt(p->n_seeds));
    int broken = 0;
    for (int k = 0; k < K; k++) {
        struct moments m = moments_of(p, sample, k);
        bool good = fabs(m.mean) < limit;
        bool covers =
            m.within >= coverage_limit(p, COVERAGE_LOW) && m.within <= coverage_limit(p, COVERAGE_HIGH);
        print_message("#   %-10s mean pull %6.2f, rms %5.2f, worst %6.2f, within 1.96 u %5.1f %%%s%s\n",
                      material_parameter_name("composite", k), m.mean, m.rms, m.worst, 100 * m.within,
                      good ? "" : "  MEAN TOO LARGE", covers ? "" : "  COVERAGE");
        broken += !good + !covers;
    }
    return broken;
}

int pulls_judge(const struct pulls *p) {
    int broken = 0;
    print_message("# %s: %d seeds; |mean pull| must stay below %.2f, %.1f .. %.1f %% within 1.96 u\n",
                  p->parts == PULLS_WITH ? "with common parts" : "without common parts", p->n_seeds,
                  fmax(0.3, 4 / sqrt(p->n_seeds)), 100 * fmax(0, coverage_limit(p, COVERAGE_LOW)),
                  100 * fmin(1, coverage_limit(p, COVERAGE_HIGH)));
    for (int i = 0; i < p->n_samples; i++) {
        print_message("# %s\n", p->sample[i]);
        broken += judge_means(p, i) + judge_distances(p, i);
    }
    print_message("# all samples\n");
    return broken + judge_means(p, -1);
}
