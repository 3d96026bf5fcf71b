/*
 * pulls.h — estimates against the truth over many seeds of the bench, judged as measurement.md 11 says.
 *
 * pull = (estimate - truth) / u, u total. Per parameter |mean pull| < max(0.3, 4 / sqrt(N)), N = number of seeds: the
 * samples of one seed share its draws and count once. For each sample the squared Mahalanobis distance of estimate
 * from truth (total covariance) is chi-square of five degrees over the seeds: Kolmogorov's test, p > 1e-4.
 * Checked    tests/unit/test_pulls_statistics.c
 */
#ifndef TESTS_SUPPORT_PULLS_H
#define TESTS_SUPPORT_PULLS_H

#include "daemon/dataset.h"

#define PULLS_SAMPLES 4
#define PULLS_SEEDS 1000

struct pull { /* of one campaign */
    double of[DATASET_PARAMETERS];
    double distance2; /* Mahalanobis, squared */
};

struct pulls {
    int n_samples, n_seeds;
    char sample[PULLS_SAMPLES][64];
    struct pull pull[PULLS_SEEDS][PULLS_SAMPLES];
};

/* Of a session with its truth; fails the test where there is no estimate with a full covariance. */
void pulls_of(const struct dataset *d, struct pull *pull);
/* Prints the table; returns how many of its figures break the rules, each with a line of its own. */
int pulls_judge(const struct pulls *p);

/* P of a distance at least as large between n draws and their distribution; value: the n distribution functions,
 * sorted here (Stephens 1970, better than 1 % from n = 5 on). */
double pulls_kolmogorov(double *value, int n);
double pulls_chi2_5(double x); /* distribution function */

#endif
