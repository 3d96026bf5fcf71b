/*
 * astm.h — a measured surface from an `.astm` file: keys, a list of variables, rows of numbers.
 *
 *     NUM_POINTS 198                                     keys in capitals; only these two are read
 *     VARS theta_i,phi_i,theta_s,phi_s,BRDF_550nm        ends the keys; any order
 *     0.1745,0,0.5236,3.1416,0.0637                      radians and 1/sr; commas or blanks
 *
 * Geometry   as brdf.h; theta below 0 is the other side of the normal.
 * Shapes     every variable that is no angle is a channel; "465nm" and "BRDF_465nm" state its wavelength.
 *            Instruments write rows with more columns than VARS names: an angle that VARS does not name (phi_s
 *            first, then phi_i) is then the column behind its theta, and columns left over at the end are not
 *            read; with no column to spare that angle is 0. Each such reading is one of brdf.note.
 * Domain     theta within pi/2, phi within 2 pi, |f_r| < 1e6 /sr; file_check_text holds.
 * Errors     -ERR_INPUT, all mistakes with file:line:column in errors; -ERR_NOMEM. Nothing to free then.
 * Source     ASTM E1392-96 as goniod, Cornell and Mini-Diff write it; reflection-model.md 5.5.
 * Checked    tests/unit/test_surface_files.c, test_verbs_offline.c (what goniod exports), tests/fuzz/fuzz_astm.c
 */
#ifndef PROTO_ASTM_H
#define PROTO_ASTM_H

#include "proto/brdf.h"

int astm_read_text(const char *file, const char *text, size_t size, struct brdf *brdf,
                   struct err_list *errors);

#endif
