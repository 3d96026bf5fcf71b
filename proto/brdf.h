/*
 * brdf.h — a measured surface: geometries, and the spectral radiance factor at each; the reader of `.brdf` files.
 *
 * beta = pi f_r. A .brdf file holds, after #-comments, the number of wavelengths, the wavelengths in nm, then for
 * each geometry theta_i phi_i theta_s phi_s (radians) and f_r (1/sr) per wavelength; free of line structure.
 * proto/astm.h, alta.h and nist.h fill the same struct from other forms.
 *
 * Geometry   delta_phi_deg = |phi_s - phi_i| folded into 0..180; 180 is the specular side, 0 the side of the
 *            source. In plane (within BRDF_PLANE_DEG of either, or theta_i or theta_s 0) theta_v_deg is
 *            signed, > 0 on the mirror side; else it is NaN.
 * Shapes     n geometries, n_lambda wavelengths (ascending in a .brdf; NaN: a channel of no stated wavelength):
 *            beta[i * n_lambda + k], u[] alike or NULL. Values of zero and below are kept as they are; NaN: none.
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
#define BRDF_NOTES_MAX 8

struct brdf_geometry {
    double theta_i_deg, theta_s_deg, delta_phi_deg;
    bool in_plane;
    double theta_v_deg;
};

struct brdf {
    size_t n, n_lambda, capacity;
    double *lambda_nm;
    struct brdf_geometry *geometry;
    double *beta, *u;
    bool azimuth_stated; /* the file, or its form, says that delta phi = 180 is the mirror side */
    int n_notes;
    char note[BRDF_NOTES_MAX][200]; /* what the reader had to assume, for the person who asked */
};

int brdf_read_text(const char *file, const char *text, size_t size, struct brdf *brdf, struct err *e);
int brdf_read_file(const char *path, struct brdf *brdf, struct err *e);
void brdf_free(struct brdf *brdf);

/* For the readers of the other forms. One geometry more, by the directions to source and sensor; theta below 0 is
 * the other side of the normal. Its values are NaN. */
int brdf_add(struct brdf *brdf, double theta_i_deg, double phi_i_deg, double theta_s_deg, double phi_s_deg,
             struct err *e);
void brdf_note(struct brdf *brdf, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* The file counted azimuths from the mirror side: exchanges it with the side of the source. */
void brdf_turn(struct brdf *brdf);

#endif
