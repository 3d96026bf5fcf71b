#include "tests/support/skipping.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <unistd.h>

void skip_because(const char *reason) {
    print_message("# skipped: %s\n", reason);
    skip();
}

void skip_without_file(const char *path) {
    char reason[256];
    if (access(path, R_OK) == 0)
        return;
    snprintf(reason, sizeof reason, "%s is not here", path);
    skip_because(reason);
}

void skip_under_asan(void) {
#ifdef __SANITIZE_ADDRESS__
    skip_because("the run-time library of ASan must be loaded first");
#endif
}
