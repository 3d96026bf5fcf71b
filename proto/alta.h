/*
 * alta.h — a measured surface from a text file of ALTA (Analysis of Bidirectional Reflectance Distribution Functions).
 *
 *     #DIM 3 1                          numbers of input and output columns
 *     #PARAM_IN ISOTROPIC_TV_TL_DPHI    what the input columns are (radians; alta_parametrisations())
 *     #PARAM_OUT INV_STERADIAN          INV_STERADIAN, or RGB_COLOR (1/sr in three channels)
 *     #VS 1                             columns after the outputs: 0 none, 1 half width, 2 low and high end
 *     0.5 0.7 3.14  0.12  0.002         rows; blanks or commas
 *
 * Geometry   as brdf.h; ALTA counts azimuths from direction to direction: delta phi = pi is the mirror side. Rows
 *            with a direction under the surface are left out, with a note.
 * Shapes     no channel states a wavelength. An interval is taken as one standard uncertainty either way.
 * Domain     angles in radians within 2 pi; |f_r| < 1e6 /sr. The binary form is refused.
 * Errors     -ERR_INPUT, all mistakes with file:line:column in errors; -ERR_NOMEM. Nothing to free then.
 * Source     the parametrisations of ALTA's core (belcour/alta, sources/core/params.h); reflection-model.md 5.5.
 * Checked    tests/unit/test_surface_files.c, tests/fuzz/fuzz_alta.c
 */
#ifndef PROTO_ALTA_H
#define PROTO_ALTA_H

#include "proto/brdf.h"

int alta_read_text(const char *file, const char *text, size_t size, struct brdf *brdf,
                   struct err_list *errors);
const char *alta_parametrisations(void); /* the names that are read, for a sentence */

#endif
