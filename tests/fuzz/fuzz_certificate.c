#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "proto/certificate.h"

/* Whatever was accepted must give finite values or a refusal at every geometry. */
static void ask(const struct certificate *c, double theta_i_deg, double theta_v_deg, double angular_u_rel) {
    double beta[BANDS], u[BANDS], used;
    bool covered[BANDS];
    if (certificate_at(c, theta_i_deg, theta_v_deg, angular_u_rel, beta, u, covered, &used, NULL) != 0)
        return;
    for (int k = 0; k < BANDS; k++)
        if (covered[k] && !(isfinite(beta[k]) && isfinite(u[k]) && beta[k] >= 0 && u[k] >= 0))
            abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    struct certificate c;
    struct err_list errors = {0};
    int rc = certificate_read_text("f", (const char *)data, size, &c, &errors);
    if ((rc == 0) != (errors.n == 0))
        abort();
    for (int theta_i_deg = 0; rc == 0 && theta_i_deg < 90; theta_i_deg += 15)
        for (int theta_v_deg = -80; theta_v_deg < 90; theta_v_deg += 20) {
            ask(&c, theta_i_deg, theta_v_deg, 0);
            ask(&c, theta_i_deg, theta_v_deg, 0.01);
        }
    if (rc == 0)
        certificate_free(&c);
    err_list_free(&errors);
    return 0;
}
