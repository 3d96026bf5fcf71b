/*
 * pulls_log.h — pulls of campaigns in a file as they come, so that a long run may be cut and taken up again.
 *
 * Text: a line that names the bench ("# MODE FILLING"), then one row a campaign,
 *     seed,parts,sample,S,sigma,gamma,beta_prime,n,distance2
 * with the pulls of all samples of a seed appended in one write: processes may share the file, and a run that is
 * killed leaves no half seed. A file of another bench is refused. The same build must take it up again; nothing here
 * can know that.
 * Checked    tests/unit/test_pulls_statistics.c
 */
#ifndef TESTS_SUPPORT_PULLS_LOG_H
#define TESTS_SUPPORT_PULLS_LOG_H

#include "tests/support/pulls.h"

/* Makes the file where there is none; fails the test where it is of another bench. */
void pulls_log_open(const char *path, const char *bench);
void pulls_log_add(const char *path, int seed, enum pulls_parts parts, const char *const *sample,
                   const struct pull *pull, int n_samples);
bool pulls_log_has(const char *path, int seed, enum pulls_parts parts);
/* Of p->parts, the seeds first .. first + n - 1 that are there. */
void pulls_log_read(const char *path, int first, int n, struct pulls *p);

#endif
