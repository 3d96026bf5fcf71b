/*
 * bands.h — the wavelength grid of all reduced data: 81 bands, 380..780 nm every 5 nm, triangles of 10 nm base.
 *
 * Band k is centred at 380 + 5 k nm; its weight falls linearly to zero 5 nm away (measurement.md 5).
 * Checked    tests/unit/test_reduce.c
 */
#ifndef PROTO_BANDS_H
#define PROTO_BANDS_H

#define BANDS 81
#define BAND_FIRST_NM 380
#define BAND_STEP_NM 5

static inline int band_nm(int band) {
    return BAND_FIRST_NM + BAND_STEP_NM * band;
}

#endif
