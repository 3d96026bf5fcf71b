/*
 * encode.h — linear values to the codes of a picture, rounded to the nearest code, exactly.
 *
 * code = the k for which value lies between curve^-1((k - 0.5) / top) and curve^-1((k + 0.5) / top), top = 255 or
 * 65535: a table of these limits is searched, so that no power is taken per pixel and nothing depends on its bits.
 * Below 0 gives 0, above 1 the top, NaN 0.
 * Checked    tests/unit/test_colour.c: against the curve itself
 */
#ifndef FIT_RENDER_ENCODE_H
#define FIT_RENDER_ENCODE_H

#include <stdint.h>

#include "fit/render/colour.h"

struct encode {
    int top, cells;
    double *limit;   /* [top + 1]: the least value of code k */
    uint16_t *first; /* [cells + 1]: the code at the lower end of a cell of 0..1 */
};

int encode_make(struct encode *encode, const struct colour_curve *curve, int bits, struct err *e);
void encode_free(struct encode *encode);
double encode_inverse(const struct colour_curve *curve, double code); /* linear value of a code in 0..1 */

static inline uint16_t encode_code(const struct encode *encode, double value) {
    if (!(value > 0)) {
        return 0;
    }
    if (value >= 1) {
        return (uint16_t)encode->top;
    }
    uint16_t code = encode->first[(int)(value * encode->cells)];
    while (code < encode->top && value >= encode->limit[code + 1]) {
        code++;
    }
    return code;
}

#endif
