/*
 * spd.h — the spectral power of a light on the 81 bands, by the name a scene gives it.
 *
 *     A, D50, D65, F2, F7, F11     CIE 015
 *     "5003 K"                     daylight of that correlated colour temperature, 4000..25000 K
 *     lamp.csv                     measured: lambda_nm,value; a path is relative to the scene file
 *
 * Only the shape counts: a picture is exposed for the perfect diffuser. Bands that a file does not cover hold no
 * power, and n_missing counts them.
 * Errors     -ERR_INPUT no such name, a temperature outside the locus, or what is wrong with the file; a power
 *            below 0, or none at all in any band (a lamp that is off is left out of the scene instead).
 * Source     CIE 015:2018: x_D and M1, M2 of a daylight; M1 and M2 are rounded to three decimals, as it demands.
 * Checked    tests/unit/test_colour.c
 */
#ifndef FIT_RENDER_SPD_H
#define FIT_RENDER_SPD_H

#include "proto/bands.h"
#include "proto/err.h"

struct spd {
    char name[256], sha256[65]; /* of the file; empty where there is none */
    double power[BANDS];
    int n_missing;
};

/* folder: where a relative path begins. Mistakes inside a file go to errors with their place. */
int spd_find(struct spd *spd, const char *name, const char *folder, struct err_list *errors, struct err *e);
int spd_daylight(struct spd *spd, double cct_k, struct err *e);

#endif
