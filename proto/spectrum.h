/*
 * spectrum.h — one value per wavelength from CSV (`lambda_nm,value`) onto the 81 bands.
 *
 * The value of a band is the linear interpolation at its centre; a file on the grid of the bands is taken as
 * it is. Bands outside the wavelengths of the file are not covered and hold NaN: nothing is extrapolated.
 * Rows may come in any order; a wavelength may stand once. Values from -1e6 to 1e6.
 * Errors     -ERR_INPUT, all mistakes in the list.
 * Checked    tests/unit/test_spectrum.c
 */
#ifndef PROTO_SPECTRUM_H
#define PROTO_SPECTRUM_H

#include <stdbool.h>
#include <stddef.h>

#include "proto/bands.h"
#include "proto/err.h"

#define SPECTRUM_BYTES_MAX (4 << 20)

struct spectrum {
    double value[BANDS];
    bool covered[BANDS];
};

int spectrum_read_text(const char *file, const char *text, size_t size, struct spectrum *spectrum,
                       struct err_list *errors);
int spectrum_read_file(const char *path, struct spectrum *spectrum, struct err_list *errors);

#endif
