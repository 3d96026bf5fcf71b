#include "proto/cosine.h"

/* pi / 180e6 in three parts; the first two have 27 bits, so that their products with an angle up to 45e6 (26
 * bits) are exact. */
#define RAD_HIGH 0x1.2bd8644p-26
#define RAD_MIDDLE 0x1.60df768p-53
#define RAD_LOW 0x1.72e602c403e8ap-80

struct angle { /* radians, high + low, 0..pi/4 */
    double high, low;
};

static struct angle radians(int32_t udeg) {
    double a = udeg * RAD_HIGH, b = udeg * RAD_MIDDLE;
    struct angle x = {.high = a + b};
    x.low = (a - x.high) + b + udeg * RAD_LOW;
    return x;
}

/* Taylor series: the first term left out is below 2^-60 of the result at pi/4. The large terms are added last
 * and what their sum loses is carried along, as is the low part of the angle. */
static double cosine_small(struct angle x) {
    double z = x.high * x.high;
    double r = z * (1.0 / 24 +
                    z * (-1.0 / 720 +
                         z * (1.0 / 40320 +
                              z * (-1.0 / 3628800 +
                                   z * (1.0 / 479001600 + z * (-1.0 / 87178291200 + z / 20922789888000))))));
    double half = 0.5 * z, w = 1 - half;
    return w + (((1 - w) - half) + (z * r - x.high * x.low));
}

static double sine_small(struct angle x) {
    double z = x.high * x.high;
    double r = z * (1.0 / 6227020800 + z * (-1.0 / 1307674368000 + z / 355687428096000));
    r = -1.0 / 6 + z * (1.0 / 120 + z * (-1.0 / 5040 + z * (1.0 / 362880 + z * (-1.0 / 39916800 + r))));
    return x.high + (x.high * z * r + x.low * (1 - 0.5 * z));
}

double cosine_udeg(int32_t angle_udeg) {
    int64_t a = angle_udeg < 0 ? -(int64_t)angle_udeg : angle_udeg;
    a %= 360000000;
    if (a > 180000000)
        a = 360000000 - a;
    double sign = a > 90000000 ? -1 : 1;
    if (a > 90000000)
        a = 180000000 - a;
    if (a == 90000000)
        return 0;
    if (a > 45000000)
        return sign * sine_small(radians((int32_t)(90000000 - a)));
    return sign * cosine_small(radians((int32_t)a));
}
