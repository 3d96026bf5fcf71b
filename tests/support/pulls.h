/*
 * pulls.h — estimates against the truth over many seeds of the bench, judged as measurement.md 11 says.
 *
 * pull = (estimate - truth) / u. Per parameter |mean pull| < max(0.3, 4 / sqrt(N)), N = number of seeds: the samples of
 * one seed share its draws and count once. For each sample the squared Mahalanobis distance of estimate from truth is
 * chi-square of five degrees over the seeds: Kolmogorov's test, p > 1e-4. Of each parameter and sample 91.5 to 98 % of
 * the estimates lie within 1.96 u; with fewer than 500 seeds there is room for the scatter of the count.
 * Parts      PULLS_WITH: of a bench that draws its common parts, the estimate as the session has it. PULLS_WITHOUT: of a
 *            bench whose certificate, zeros, P and stray light are as stated; the estimate made anew as of a laboratory
 *            that knows so, with no part of u left but noise (that of darks and reference readings too) and drift.
 * Checked    tests/unit/test_pulls_statistics.c
 */
#ifndef TESTS_SUPPORT_PULLS_H
#define TESTS_SUPPORT_PULLS_H

#include "daemon/dataset.h"

#define PULLS_SAMPLES 4
#define PULLS_SEEDS 1000

enum pulls_parts { PULLS_WITH, PULLS_WITHOUT, PULLS_PARTS };

struct pull { /* of one campaign */
    double of[DATASET_PARAMETERS];
    double distance2; /* Mahalanobis, squared */
};

struct pulls {
    enum pulls_parts parts;
    int n_samples, n_seeds;
    char sample[PULLS_SAMPLES][64];
    struct pull pull[PULLS_SEEDS][PULLS_SAMPLES];
};

/* Of a session with its truth; fails the test where there is no estimate with a full covariance. */
void pulls_of(const struct dataset *d, struct pull *pull);
/* For PULLS_WITHOUT, from the points of the session at path. */
void pulls_refit(struct dataset *d, const char *path);
/* Prints the table; returns how many of its figures break the rules, each with a line of its own. */
int pulls_judge(const struct pulls *p);

/* P of a distance at least as large between n draws and their distribution; value: the n distribution functions,
 * sorted here (Stephens 1970, better than 1 % from n = 5 on). */
double pulls_kolmogorov(double *value, int n);
double pulls_chi2_5(double x); /* distribution function */

#endif
