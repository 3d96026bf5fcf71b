/*
 * brdf.h — a measured surface from a `.brdf` file: geometries, and the spectral radiance factor at each.
 *
 * beta = pi f_r. The file holds, after #-comments, the number of wavelengths, the wavelengths in nm, then for
 * each geometry theta_i phi_i theta_s phi_s (radians) and f_r (1/sr) per wavelength; free of line structure.
 *
 * Geometry   delta_phi_deg = |phi_s - phi_i| folded into 0..180; 180 is the specular side, 0 the side of the
 *            source. In plane (within BRDF_PLANE_DEG of either, or theta_i or theta_s 0) theta_v_deg is
 *            signed, > 0 on the mirror side; else it is NaN.
 * Shapes     n geometries, n_lambda wavelengths, ascending: beta[i * n_lambda + k]. Values of zero and below
 *            are kept as they are.
 * Domain     theta 0..90 deg, lambda 100..5000 nm, |f_r| < 1e6 /sr, BRDF_BYTES_MAX.
 * Errors     -ERR_INPUT with file, line and column; -ERR_IO. Nothing to free then.
 * Source     reflection-model.md 5.5, 6; the form is that of the BRDF files of pbrt.
 * Checked    tests/unit/test_brdf.c, tests/fuzz/fuzz_brdf.c
 */
#ifndef PROTO_BRDF_H
#define PROTO_BRDF_H

#include <stdbool.h>
#include <stddef.h>

#include "proto/err.h"

#define BRDF_BYTES_MAX (64 << 20)
#define BRDF_PLANE_DEG 0.01

struct brdf_geometry {
    double theta_i_deg, theta_s_deg, delta_phi_deg;
    bool in_plane;
    double theta_v_deg;
};

struct brdf {
    size_t n, n_lambda;
    double *lambda_nm;
    struct brdf_geometry *geometry;
    double *beta;
};

int brdf_read_text(const char *file, const char *text, size_t size, struct brdf *brdf, struct err *e);
int brdf_read_file(const char *path, struct brdf *brdf, struct err *e);
void brdf_free(struct brdf *brdf);

#endif
