#include "fit/render/colour.h"

#include <math.h>

#include "fit/render/cie.h"

const double (*colour_cmf(enum colour_observer observer))[3] {
    return observer == COLOUR_10DEG ? cie_10deg : cie_2deg;
}

const char *colour_observer_name(enum colour_observer observer) {
    static const char *const names[COLOUR_OBSERVERS] = {"CIE 1931 2 deg", "CIE 1964 10 deg"};
    return names[observer];
}

const char *colour_adaptation_name(enum colour_adaptation adaptation) {
    static const char *const names[COLOUR_ADAPTATIONS] = {"none", "von-kries", "bradford", "cat16"};
    return names[adaptation];
}

static const struct {
    const char *name;
    double xy[4][2]; /* red, green, blue, white */
    struct colour_curve curve;
} spaces[COLOUR_SPACES] = {
    [COLOUR_SRGB] = {"sRGB",
                     {{0.64, 0.33}, {0.30, 0.60}, {0.15, 0.06}, {0.3127, 0.3290}},
                     {0.0031308, 12.92, 1.055, 0.055, 2.4}},
    [COLOUR_DISPLAY_P3] = {"Display P3",
                           {{0.680, 0.320}, {0.265, 0.690}, {0.150, 0.060}, {0.3127, 0.3290}},
                           {0.0031308, 12.92, 1.055, 0.055, 2.4}},
    [COLOUR_ADOBE_RGB] = {"Adobe RGB (1998)",
                          {{0.64, 0.33}, {0.21, 0.71}, {0.15, 0.06}, {0.3127, 0.3290}},
                          {0, 0, 1, 0, 563.0 / 256}},
};

const char *colour_space_name(enum colour_space space) {
    return spaces[space].name;
}

const double (*colour_primaries(enum colour_space space))[2] {
    return spaces[space].xy;
}

const struct colour_curve *colour_curve(enum colour_space space) {
    return &spaces[space].curve;
}

/* 1 / sum E ybar; 0 where no eye sees the light. */
static double exposure_of(const double power[BANDS], const double (*cmf)[3]) {
    double sum = 0;
    for (int k = 0; k < BANDS; k++) {
        sum += power[k] * cmf[k][1];
    }
    return sum > 0 && isfinite(sum) ? 1 / sum : 0;
}

static int refuse_dark(struct err *e) {
    return err_set(e, ERR_RANGE, "this light has no luminance: no power where the eye sees; leave it out");
}

int colour_white(const double power[BANDS], enum colour_observer observer, double white[3], struct err *e) {
    struct colour_matrix m;
    double none[BANDS] = {0};
    int status = colour_collapse(none, power, observer, &m, e);
    for (int i = 0; i < 3 && !status; i++) {
        white[i] = m.m[i][2];
    }
    return status;
}

int colour_collapse(const double s[BANDS], const double power[BANDS], enum colour_observer observer,
                    struct colour_matrix *matrix, struct err *e) {
    const double(*cmf)[3] = colour_cmf(observer);
    double scale = exposure_of(power, cmf);
    if (!(scale > 0)) {
        return refuse_dark(e);
    }
    *matrix = (struct colour_matrix){0};
    for (int k = 0; k < BANDS; k++) {
        for (int i = 0; i < 3; i++) {
            double weight = scale * power[k] * cmf[k][i];
            matrix->m[i][0] += weight * s[k];
            matrix->m[i][1] += weight * s[k] * s[k];
            matrix->m[i][2] += weight;
        }
    }
    return 0;
}

void colour_sum(const double radiance[BANDS], enum colour_observer observer, double xyz[3]) {
    const double(*cmf)[3] = colour_cmf(observer);
    xyz[0] = xyz[1] = xyz[2] = 0;
    for (int k = 0; k < BANDS; k++) {
        for (int i = 0; i < 3; i++) {
            xyz[i] += radiance[k] * cmf[k][i];
        }
    }
}

void colour_scale_power(const double power[BANDS], enum colour_observer observer, double scaled[BANDS]) {
    double xyz[3];
    colour_sum(power, observer, xyz);
    for (int k = 0; k < BANDS; k++) {
        scaled[k] = power[k] / xyz[1];
    }
}

void colour_apply(const struct colour_matrix *m, const double in[3], double out[3]) {
    double x = in[0], y = in[1], z = in[2];
    for (int i = 0; i < 3; i++) {
        out[i] = m->m[i][0] * x + m->m[i][1] * y + m->m[i][2] * z;
    }
}

struct colour_matrix colour_multiply(const struct colour_matrix *a, const struct colour_matrix *b) {
    struct colour_matrix product = {0};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            for (int k = 0; k < 3; k++) {
                product.m[i][j] += a->m[i][k] * b->m[k][j];
            }
        }
    }
    return product;
}

/* Adjugate over determinant: the matrices here are far from singular. */
struct colour_matrix colour_inverse(const struct colour_matrix *a) {
    struct colour_matrix inverse;
    const double(*m)[3] = a->m;
    double determinant = 0;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            int r0 = (j + 1) % 3, r1 = (j + 2) % 3, c0 = (i + 1) % 3, c1 = (i + 2) % 3;
            inverse.m[i][j] = m[r0][c0] * m[r1][c1] - m[r0][c1] * m[r1][c0];
        }
        determinant += m[0][i] * inverse.m[i][0];
    }
    for (int i = 0; i < 9; i++) {
        inverse.m[i / 3][i % 3] /= determinant;
    }
    return inverse;
}

static const struct colour_matrix cones[COLOUR_ADAPTATIONS] = {
    [COLOUR_NONE] = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
    [COLOUR_VON_KRIES] = {{{0.40024, 0.70760, -0.08081}, {-0.22630, 1.16532, 0.04570}, {0, 0, 0.91822}}},
    [COLOUR_BRADFORD] = {{{0.8951, 0.2664, -0.1614}, {-0.7502, 1.7135, 0.0367}, {0.0389, -0.0685, 1.0296}}},
    [COLOUR_CAT16] = {{{0.401288, 0.650173, -0.051461},
                       {-0.250268, 1.204414, 0.045854},
                       {-0.002079, 0.048952, 0.953127}}},
};

struct colour_matrix colour_adapt(enum colour_adaptation adaptation, const double from[3],
                                  const double to[3]) {
    const struct colour_matrix *cone = &cones[adaptation];
    if (adaptation == COLOUR_NONE) {
        return *cone;
    }
    double source[3], target[3];
    colour_apply(cone, from, source);
    colour_apply(cone, to, target);
    struct colour_matrix gain = {0}, back = colour_inverse(cone);
    for (int i = 0; i < 3; i++) {
        gain.m[i][i] = target[i] / source[i];
    }
    gain = colour_multiply(&gain, cone);
    return colour_multiply(&back, &gain);
}

static void xyz_of_xy(const double xy[2], double xyz[3]) {
    xyz[0] = xy[0] / xy[1];
    xyz[1] = 1;
    xyz[2] = (1 - xy[0] - xy[1]) / xy[1];
}

void colour_space_white(enum colour_space space, double xyz[3]) {
    xyz_of_xy(spaces[space].xy[3], xyz);
}

struct colour_matrix colour_from_xyz(enum colour_space space) {
    struct colour_matrix primaries;
    double column[3], white[3], amount[3];
    for (int j = 0; j < 3; j++) {
        xyz_of_xy(spaces[space].xy[j], column);
        for (int i = 0; i < 3; i++) {
            primaries.m[i][j] = column[i];
        }
    }
    struct colour_matrix inverse = colour_inverse(&primaries);
    colour_space_white(space, white);
    colour_apply(&inverse, white, amount); /* so much of each primary makes white */
    for (int j = 0; j < 9; j++) {
        primaries.m[j / 3][j % 3] *= amount[j % 3];
    }
    return colour_inverse(&primaries);
}

/* CIE 015: cube root, and its tangent below (6/29)^3. */
static double lab_root(double t) {
    return t > 216.0 / 24389 ? cbrt(t) : (24389.0 / 27 * t + 16) / 116;
}

void colour_lab(const double xyz[3], const double white[3], double lab[3]) {
    double fx = lab_root(xyz[0] / white[0]), fy = lab_root(xyz[1] / white[1]),
           fz = lab_root(xyz[2] / white[2]);
    lab[0] = 116 * fy - 16;
    lab[1] = 500 * (fx - fy);
    lab[2] = 200 * (fy - fz);
}
