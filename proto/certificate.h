/*
 * certificate.h — the certificate of a reference diffuser: radiance factor by wavelength and, for a table, by
 * angle.
 *
 * Form: measurement.md 2. Valid at its own geometry only; interpolated in angle and wavelength, never
 * extrapolated. Checked    tests/unit/test_certificate.c
 */
#ifndef PROTO_CERTIFICATE_H
#define PROTO_CERTIFICATE_H

#include <stdbool.h>
#include <stddef.h>

#include "proto/bands.h"
#include "proto/err.h"

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
 * angular_u_rel is 0) or the wavelengths; the sentence says what is covered. With angular_u_rel > 0 the
 * nearest geometry it has is used and *angular_u_rel_used says so. covered[]: bands outside its wavelengths
 * are false. */
int certificate_at(const struct certificate *c, double theta_i_deg, double theta_v_deg, double angular_u_rel,
                   double beta[BANDS], double u[BANDS], bool covered[BANDS], double *angular_u_rel_used,
                   struct err *e);

#endif
