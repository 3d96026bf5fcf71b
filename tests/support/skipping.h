/*
 * skipping.h — leaving a test out, and saying why: tests/run.py shows the reason below the file's counts.
 */
#ifndef TESTS_SUPPORT_SKIPPING_H
#define TESTS_SUPPORT_SKIPPING_H

void skip_because(const char *reason);
void skip_without_file(const char *path); /* goes on where it can be read */
/* Where something is preloaded into our programs: the run-time library of ASan must be the first. */
void skip_under_asan(void);

#endif
