/*
 * nist.h — measured surfaces as NIST publishes them: a CSV of one wavelength and one geometry a row.
 *
 *     lambda,thetai,phi,thetar,phir,f_r11,...      um, degrees, 1/sr; further columns (Mueller matrix) are passed over
 *
 * Geometry   thetai is stored negative: the source stands on the other side of the normal, at phi + 180 deg, so
 *            that phir = 0 is the mirror side. phi may be called phii, and f_r11 fr11.
 * Shapes     the rows of one geometry become one; a wavelength it lacks is NaN. Wavelengths ascend.
 * Domain     lambda 0.1..5 um, |theta| <= 90, |phi| <= 360 deg, |f_r11| < 1e6 /sr.
 * Errors     -ERR_INPUT, all mistakes with file:line:column in errors; -ERR_NOMEM. Nothing to free then.
 * Source     T. A. Germer, Applied Optics 2017 (data set 10.6084/m9.figshare.5417410); reflection-model.md 1.4.
 * Checked    tests/unit/test_surface_files.c, tests/fuzz/fuzz_nist.c
 */
#ifndef PROTO_NIST_H
#define PROTO_NIST_H

#include "proto/brdf.h"

int nist_read_text(const char *file, const char *text, size_t size, struct brdf *brdf,
                   struct err_list *errors);

#endif
