#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "proto/brdf.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct brdf b;
    struct err e = {0};
    if (brdf_read_text("f", (const char *)data, size, &b, &e) != 0) {
        if (e.code == ERR_NONE)
            abort();
        return 0;
    }
    for (size_t i = 0; i < b.n; i++) {
        const struct brdf_geometry *g = &b.geometry[i];
        if (!(g->theta_i_deg >= 0 && g->theta_i_deg <= 90 && fabs(g->delta_phi_deg) <= 180) ||
            g->in_plane != isfinite(g->theta_v_deg))
            abort();
        for (size_t k = 0; k < b.n_lambda; k++)
            if (!isfinite(b.beta[i * b.n_lambda + k]))
                abort();
    }
    brdf_free(&b);
    return 0;
}
