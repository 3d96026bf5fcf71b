/*
 * spectral.h — the spectral picture: the radiance of every pixel in 81 bands, as an EXR any viewer opens.
 *
 * Channels   S0.380,000000nm ... S0.780,000000nm (decimal comma: a dot separates EXR's layers), and R, G, B beside
 *            them: linear sRGB as the picture has it, adapted and exposed. 32-bit floats.
 * Units      relative W.m^-2.sr^-1 in a band of 5 nm, before exposure: the sum over the bands of S0 times ybar is Y,
 *            which is 1 for the perfect diffuser at normal incidence.
 * Text       spectralLayoutVersion 1.0, emissiveUnits, comments; "goniod": the origin (origin.h).
 * Errors     those of exr.h; those of white_of.
 * Source     Fichet, Pacanowski and Wilkie, JCGT 10(3) 2021, and its reference reader.
 * Checked    tests/unit/test_spectral.c
 */
#ifndef FIT_RENDER_SPECTRAL_H
#define FIT_RENDER_SPECTRAL_H

#include "fit/render/render.h"

int spectral_save(const char *path, const struct scene *scene, const struct planes *planes,
                  const char *origin_json, struct err *e);
/* "S0.550,000000nm" of band k; size: at least 16. */
void spectral_channel(int band, char *name, size_t size);

#endif
