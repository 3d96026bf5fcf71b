/*
 * seed.h — the seed of a test that draws numbers, and the line that repeats it.
 */
#ifndef TESTS_SUPPORT_SEED_H
#define TESTS_SUPPORT_SEED_H

#include <stdint.h>

/* GONIOD_TEST_SEED where it is set, else the usual one; prints the command that runs this test with it again. */
uint64_t test_seed(uint64_t usual);

#endif
