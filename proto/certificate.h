/*
 * certificate.h — the certificate of a reference diffuser: radiance factor by wavelength and, for a table, by
 * angle.
 *
 *     # geometry: 45:0            theta_i:theta_v of the values | 8:di | in-plane table
 *     # k: 2                      coverage factor of the column u; 1 if u is a standard uncertainty
 *     # serial: SRS-99-0123       optional, as are date, valid_until (YYYY-MM-DD) and correlation_nm
 *     lambda_nm,beta,u            and theta_i_deg,theta_v_deg for a table
 *
 * Valid at its own geometry only. Linear between wavelengths, then between viewing angles, then between
 * angles of incidence; never extrapolated. At normal incidence the sign of theta_v has no meaning. A geometry
 * counts as met within CERTIFICATE_TOLERANCE_DEG, since the angles of a reading come from readbacks.
 * Domain     theta_i 0..90, theta_v -90..90 deg (> 0 on the mirror side), lambda 100..5000 nm, beta 0..10.
 * Errors     certificate_read_text: -ERR_INPUT with all mistakes in the list, nothing to free.
 * Source     measurement.md 2. Whether it has expired is for whoever has a clock: ISO dates compare as text.
 * Checked    tests/unit/test_certificate.c, tests/fuzz/fuzz_certificate.c
 */
#ifndef PROTO_CERTIFICATE_H
#define PROTO_CERTIFICATE_H

#include <stdbool.h>
#include <stddef.h>

#include "proto/bands.h"
#include "proto/err.h"

#define CERTIFICATE_BYTES_MAX (8 << 20)
/* Far above readback and zero errors of an aligned bench, and small enough for a white diffuser to change by
 * less than 1e-3 of its value (reflection-model.md 5.2: 0.63 over 45 deg at the steepest). */
#define CERTIFICATE_TOLERANCE_DEG 0.1

enum certificate_geometry { CERTIFICATE_ONE, CERTIFICATE_8DI, CERTIFICATE_TABLE };

struct certificate_row {
    double lambda_nm, beta, u, theta_i_deg, theta_v_deg; /* u: standard uncertainty (already divided by k) */
};

struct certificate {
    enum certificate_geometry geometry;
    double theta_i_deg, theta_v_deg; /* of CERTIFICATE_ONE */
    char serial[48], date[16], valid_until[16];
    double correlation_nm; /* 0 = one fully correlated factor */
    size_t n;
    struct certificate_row *row; /* sorted by theta_i, theta_v, lambda */
    char *text;                  /* as read, for the session */
};

int certificate_read_text(const char *file, const char *text, size_t size, struct certificate *c,
                          struct err_list *errors);
void certificate_free(struct certificate *c);
/* beta and u for all bands at a geometry. -ERR_RANGE: the certificate does not cover the geometry (and
 * angular_u_rel is 0) or no band at all; the sentence says what is covered. With angular_u_rel > 0 the
 * nearest geometry it has is used and *angular_u_rel_used says so; else that is 0. covered[]: bands outside
 * its wavelengths are false, with beta and u NaN. */
int certificate_at(const struct certificate *c, double theta_i_deg, double theta_v_deg, double angular_u_rel,
                   double beta[BANDS], double u[BANDS], bool covered[BANDS], double *angular_u_rel_used,
                   struct err *e);

#endif
