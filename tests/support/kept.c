#include "tests/support/kept.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

bool kept(int *tries, const char *what, int64_t took_us, int64_t limit_us) {
    bool within = took_us <= limit_us;
    print_message("# %s took %.1f ms, limit %.1f ms\n", what, (double)took_us * 1e-3,
                  (double)limit_us * 1e-3);
    if (!within && ++*tries == KEPT_TRIES)
        fail_msg("%s took longer than its limit in each of %d tries", what, KEPT_TRIES);
    return within;
}
