#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "fit/points_csv.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* What is accepted has angles inside the model and a finite mean; what is not has a sentence. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct fitset set;
    struct err_list errors = {0};
    fitset_init(&set);
    int rc = points_csv_read("f", (const char *)data, size, &set, &errors);
    if ((rc == 0) != (errors.n == 0))
        abort();
    for (size_t i = 0; rc == 0 && i < set.n; i++) {
        if (!(set.theta_i_deg[i] >= 0 && set.theta_i_deg[i] < 90 && fabs(set.theta_v_deg[i]) < 90) ||
            !isfinite(set.beta[i]))
            abort();
    }
    fitset_free(&set);
    err_list_free(&errors);
    return 0;
}
