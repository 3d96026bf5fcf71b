/*
 * table.h — what the readers of measured tables promise, whatever the bytes: accepted, and then angles inside the
 * hemisphere and finite or missing values; or refused with a sentence.
 */
#ifndef TESTS_FUZZ_TABLE_H
#define TESTS_FUZZ_TABLE_H

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#include "proto/brdf.h"

typedef int table_reader(const char *name, const char *text, size_t size, struct brdf *b,
                         struct err_list *errors);

static int judge_table(table_reader *read, const uint8_t *data, size_t size) {
    struct brdf b;
    struct err_list errors = {0};
    int rc = read("f", (const char *)data, size, &b, &errors);
    if ((rc == 0) != (errors.n == 0))
        abort();
    for (size_t i = 0; rc == 0 && i < b.n; i++) {
        const struct brdf_geometry *g = &b.geometry[i];
        if (!(g->theta_i_deg >= 0 && g->theta_i_deg <= 90 && g->theta_s_deg >= 0 && g->theta_s_deg <= 90) ||
            !(g->delta_phi_deg >= 0 && g->delta_phi_deg <= 180) || g->in_plane != isfinite(g->theta_v_deg))
            abort();
        for (size_t k = 0; k < b.n_lambda; k++)
            if (isinf(b.beta[i * b.n_lambda + k]) || (b.u && b.u[i * b.n_lambda + k] < 0))
                abort();
    }
    if (rc == 0)
        brdf_free(&b);
    err_list_free(&errors);
    return 0;
}

#endif
