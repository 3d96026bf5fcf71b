/*
 * cie.h — colour matching functions, illuminants and daylight components of CIE 015, on the 81 bands.
 *
 * cie_2deg[k] and cie_10deg[k]: x, y, z of the 1931 (2 deg) and 1964 (10 deg) standard observers at band k.
 * cie_daylight[k]: S0, S1, S2. Illuminants: relative power, 100 at 560 nm (fluorescent lamps: as tabulated).
 * Every value stands at its wavelength, 380..780 nm every 5 nm; sums over these bands leave out what lies beyond
 * (of y: 8e-5 of 21.3714, 4e-6 of the whole).
 * Source     CIE 015:2018.
 * Checked    tests/unit/test_colour.c: sums and white points
 */
#ifndef FIT_RENDER_CIE_H
#define FIT_RENDER_CIE_H

#include "proto/bands.h"

#define CIE_ILLUMINANTS 6

struct cie_illuminant {
    const char *name;
    const double *power; /* [BANDS] */
};

extern const double cie_2deg[BANDS][3], cie_10deg[BANDS][3], cie_daylight[BANDS][3];
extern const struct cie_illuminant cie_illuminant[CIE_ILLUMINANTS];

#endif
