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

static double cos_deg(double angle_deg) {
    return cos(rad_from_deg(angle_deg));
}

double ciede2000(const double lab_1[3], const double lab_2[3]) {
    double mean = (hypot(lab_1[1], lab_1[2]) + hypot(lab_2[1], lab_2[2])) / 2;
    double stretch = 1 + 0.5 * (1 - saturation(mean));
    struct polar p = polar_of(stretch * lab_1[1], lab_1[2]), q = polar_of(stretch * lab_2[1], lab_2[2]);
    double dl = lab_2[0] - lab_1[0], dc = q.c - p.c;
    double dh = 2 * sqrt(p.c * q.c) * sin(rad_from_deg(hue_step(p, q) / 2));
    double l = (lab_1[0] + lab_2[0]) / 2 - 50, c = (p.c + q.c) / 2, h = hue_between(p, q);
    double t = 1 - 0.17 * cos_deg(h - 30) + 0.24 * cos_deg(2 * h) + 0.32 * cos_deg(3 * h + 6) -
               0.20 * cos_deg(4 * h - 63);
    double blue = (h - 275) / 25;
    double turn = 2 * saturation(c) * sin(rad_from_deg(60 * exp(-blue * blue)));
    double light = dl / (1 + 0.015 * l * l / sqrt(20 + l * l));
    double chroma = dc / (1 + 0.045 * c), hue = dh / (1 + 0.015 * c * t);
    /* The turn may leave a little below 0 of equal colours. */
    return sqrt(fmax(light * light + chroma * chroma + hue * hue - turn * chroma * hue, 0));
}
