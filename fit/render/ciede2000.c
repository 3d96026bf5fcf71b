#include "fit/render/ciede2000.h"

#include <math.h>

#include "proto/units.h"

struct polar { /* chroma and hue of a', b */
    double c, h_deg;
};

/* sqrt(c^7 / (c^7 + 25^7)): 1 for strong colours, 0 for greys. */
static double saturation(double c) {
    double r = c / 25, r2 = r * r, r7 = r2 * r2 * r2 * r;
    return sqrt(r7 / (r7 + 1));
}

static struct polar polar_of(double a, double b) {
    double h_deg = a == 0 && b == 0 ? 0 : deg_from_rad(atan2(b, a));
    return (struct polar){sqrt(a * a + b * b), h_deg < 0 ? h_deg + 360 : h_deg};
}

/* Signed, the short way around. */
static double hue_step(struct polar p, struct polar q) {
    double step = q.h_deg - p.h_deg;
    if (p.c * q.c == 0) {
        return 0;
    }
    return step > 180 ? step - 360 : step < -180 ? step + 360 : step;
}

static double hue_between(struct polar p, struct polar q) {
    double sum = p.h_deg + q.h_deg;
    if (p.c * q.c == 0) {
        return sum;
    }
    if (fabs(p.h_deg - q.h_deg) <= 180) {
        return sum / 2;
    }
    return sum < 360 ? (sum + 360) / 2 : (sum - 360) / 2;
}

/* 1 - 0.17 cos(h - 30 deg) + 0.24 cos 2h + 0.32 cos(3h + 6 deg) - 0.20 cos(4h - 63 deg) from one sine and cosine. */
static double hue_weight(double h_deg) {
    static const double cos_30 = 0.86602540378443865, sin_30 = 0.5, cos_6 = 0.99452189536827333,
                        sin_6 = 0.10452846326765347, cos_63 = 0.45399049973954675,
                        sin_63 = 0.89100652418836786;
    double h = rad_from_deg(h_deg), c = cos(h), s = sin(h), c2 = c * c - s * s, s2 = 2 * c * s;
    double c3 = c * c2 - s * s2, s3 = s * c2 + c * s2, c4 = c2 * c2 - s2 * s2, s4 = 2 * c2 * s2;
    return 1 - 0.17 * (c * cos_30 + s * sin_30) + 0.24 * c2 + 0.32 * (c3 * cos_6 - s3 * sin_6) -
           0.20 * (c4 * cos_63 + s4 * sin_63);
}

static double length(double a, double b) { /* of colours: nothing to overflow */
    return sqrt(a * a + b * b);
}

double ciede2000(const double lab_1[3], const double lab_2[3]) {
    double mean = (length(lab_1[1], lab_1[2]) + length(lab_2[1], lab_2[2])) / 2;
    double stretch = 1 + 0.5 * (1 - saturation(mean));
    struct polar p = polar_of(stretch * lab_1[1], lab_1[2]), q = polar_of(stretch * lab_2[1], lab_2[2]);
    double dl = lab_2[0] - lab_1[0], dc = q.c - p.c;
    double dh = 2 * sqrt(p.c * q.c) * sin(rad_from_deg(hue_step(p, q) / 2));
    double l = (lab_1[0] + lab_2[0]) / 2 - 50, c = (p.c + q.c) / 2, h = hue_between(p, q);
    double t = hue_weight(h);
    double blue = (h - 275) / 25;
    double turn = 2 * saturation(c) * sin(rad_from_deg(60 * exp(-blue * blue)));
    double light = dl / (1 + 0.015 * l * l / sqrt(20 + l * l));
    double chroma = dc / (1 + 0.045 * c), hue = dh / (1 + 0.015 * c * t);
    /* The turn may leave a little below 0 of equal colours. */
    return sqrt(fmax(light * light + chroma * chroma + hue * hue - turn * chroma * hue, 0));
}
