/*
 * colour.h — from spectra to the numbers of a picture: the exact collapse, chromatic adaptation, RGB spaces.
 *
 * One bounce from one paint is radiance(k) = a S(k) + b S(k)^2 + c in units of the perfect diffuser's, so that
 *     XYZ = M (a, b, c),   M = K sum_k [S, S^2, 1] E cmf,   K = 1 / sum_k E ybar
 * holds exactly, and a new S, illuminant or observer is a new 3x3 matrix. Y of the perfect diffuser at normal
 * incidence is 1. Sums run over 380..780 nm at 5 nm.
 *
 * Adaptation linear in cones; from and to are whites with Y = 1. RGB spaces have D65 as white (IEC 61966-2-1:
 *            .3127 .3290), linear values; outside 0..1 is out of gamut or clipped (encode.h).
 * Domain     finite powers >= 0 with a positive sum of E ybar, else -ERR_RANGE (a lamp that no eye sees).
 * Source     CIE 015:2018; Bradford: Lam 1985; CAT16: Li et al. 2017; von Kries: Hunt-Pointer-Estevez cones;
 *            Display P3: SMPTE EG 432-1 primaries, sRGB curve; Adobe RGB (1998).
 * Checked    tests/unit/test_colour.c
 */
#ifndef FIT_RENDER_COLOUR_H
#define FIT_RENDER_COLOUR_H

#include "proto/bands.h"
#include "proto/err.h"

enum colour_observer { COLOUR_2DEG, COLOUR_10DEG, COLOUR_OBSERVERS };
enum colour_adaptation { COLOUR_NONE, COLOUR_VON_KRIES, COLOUR_BRADFORD, COLOUR_CAT16, COLOUR_ADAPTATIONS };
enum colour_space { COLOUR_SRGB, COLOUR_DISPLAY_P3, COLOUR_ADOBE_RGB, COLOUR_SPACES };

struct colour_matrix {
    double m[3][3];
};

struct
    colour_curve { /* code value in 0..1 from linear: gain v below `low`, else scale v^(1/gamma) - offset */
    double low, gain, scale, offset, gamma;
};

const double (*colour_cmf(enum colour_observer observer))[3];
const char *colour_observer_name(enum colour_observer observer);
const char *colour_adaptation_name(enum colour_adaptation adaptation);
const char *colour_space_name(enum colour_space space);
/* xy of red, green, blue and white: what a profile or a cHRM chunk is made of. */
const double (*colour_primaries(enum colour_space space))[2];
const struct colour_curve *colour_curve(enum colour_space space);

int colour_white(const double power[BANDS], enum colour_observer observer, double white[3], struct err *e);
int colour_collapse(const double s[BANDS], const double power[BANDS], enum colour_observer observer,
                    struct colour_matrix *matrix, struct err *e);
/* XYZ of a whole spectrum of radiance factors times E: the sum that the collapse replaces. */
void colour_sum(const double radiance[BANDS], enum colour_observer observer, double xyz[3]);
/* So that the sum of scaled times ybar is 1. */
void colour_scale_power(const double power[BANDS], enum colour_observer observer, double scaled[BANDS]);
struct colour_matrix colour_adapt(enum colour_adaptation adaptation, const double from[3],
                                  const double to[3]);
struct colour_matrix colour_from_xyz(enum colour_space space); /* linear RGB of XYZ */
struct colour_matrix colour_multiply(const struct colour_matrix *a, const struct colour_matrix *b);
struct colour_matrix colour_inverse(const struct colour_matrix *a);
void colour_apply(const struct colour_matrix *m, const double in[3], double out[3]);
void colour_space_white(enum colour_space space, double xyz[3]);
void colour_lab(const double xyz[3], const double white[3], double lab[3]);

#endif
