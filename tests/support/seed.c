#include "tests/support/seed.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>
#include <errno.h>
#include <stdlib.h>

uint64_t test_seed(uint64_t usual) {
    const char *text = getenv("GONIOD_TEST_SEED");
    uint64_t seed = text ? strtoull(text, NULL, 0) : usual;
    print_message("# seed %llu: GONIOD_TEST_SEED=%llu %s\n", (unsigned long long)seed,
                  (unsigned long long)seed, program_invocation_name);
    return seed;
}
