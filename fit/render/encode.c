#include "fit/render/encode.h"

#include <math.h>
#include <stdlib.h>

#define CELLS_PER_CODE                                                                                       \
    16 /* sRGB climbs by 12.92 codes in a cell of one code near black; 8 bits stay in the cache */

double encode_inverse(const struct colour_curve *curve, double code) {
    double linear = curve->gain > 0 ? code / curve->gain : INFINITY;
    return linear <= curve->low ? linear : pow((code + curve->offset) / curve->scale, curve->gamma);
}

int encode_make(struct encode *encode, const struct colour_curve *curve, int bits, struct err *e) {
    encode->top = (1 << bits) - 1;
    encode->cells = bits == 8 ? CELLS_PER_CODE * 256 : 1 << bits;
    encode->limit = malloc((size_t)(encode->top + 1) * sizeof *encode->limit);
    encode->first = malloc((size_t)(encode->cells + 1) * sizeof *encode->first);
    if (!encode->limit || !encode->first) {
        encode_free(encode);
        return err_set(e, ERR_NOMEM, "no memory for the tone curve");
    }
    encode->limit[0] = 0;
    for (int k = 1; k <= encode->top; k++) {
        encode->limit[k] = encode_inverse(curve, (k - 0.5) / encode->top);
    }
    int code = 0;
    for (int cell = 0; cell <= encode->cells; cell++) {
        while (code < encode->top && cell / (double)encode->cells >= encode->limit[code + 1]) {
            code++;
        }
        encode->first[cell] = (uint16_t)code;
    }
    return 0;
}

void encode_free(struct encode *encode) {
    free(encode->limit);
    free(encode->first);
    *encode = (struct encode){0};
}
