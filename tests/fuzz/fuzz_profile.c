#include <stdint.h>
#include <stdlib.h>

#include "proto/profile.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static struct profile profile;
    struct err_list errors = {0};
    int rc = profile_read_text("f", (const char *)data, size, &profile, &errors);
    if ((rc == 0) != (errors.n == 0))
        abort();
    if (rc == 0) { /* what was accepted can be used */
        profile_raw_speed(&profile);
        profile_raw_accel(&profile);
        profile_alarm_text(&profile, 0x4A);
    }
    err_list_free(&errors);
    return 0;
}
