/*
 * kept.h — a limit on real time, on a machine that has other work to do.
 *
 * Load makes a measured time longer, never shorter; a mistake of ours makes every one too long. So a limit is kept when
 * one of KEPT_TRIES times keeps it:
 *     int tries = 0;
 *     do
 *         took_us = ...;
 *     while (!kept(&tries, "a stop order", took_us, LIMIT_US));
 */
#ifndef TESTS_SUPPORT_KEPT_H
#define TESTS_SUPPORT_KEPT_H

#include <stdbool.h>
#include <stdint.h>

#define KEPT_TRIES 8

/* False: measure it once more. Fails the test at the last try. */
bool kept(int *tries, const char *what, int64_t took_us, int64_t limit_us);

#endif
