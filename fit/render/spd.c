#include "fit/render/spd.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/cie.h"
#include "fit/render/place.h"
#include "fit/render/sha256.h"
#include "proto/number.h"
#include "proto/spectrum.h"

static double rounded(double m) {
    return round(m * 1000) / 1000;
}

int spd_daylight(struct spd *spd, double cct_k, struct err *e) {
    if (!(cct_k >= 4000 && cct_k <= 25000)) {
        return err_set(e, ERR_INPUT,
                       "%g K is no daylight: the locus runs from 4000 to 25000 K; use A, or a file", cct_k);
    }
    double t = 1000 / cct_k;
    double x = cct_k <= 7000 ? ((-4.6070 * t + 2.9678) * t + 0.09911) * t + 0.244063
                             : ((-2.0064 * t + 1.9018) * t + 0.24748) * t + 0.237040;
    double y = (-3 * x + 2.870) * x - 0.275;
    double m = 0.0241 + 0.2562 * x - 0.7341 * y;
    double m1 = rounded((-1.3515 - 1.7703 * x + 5.9114 * y) / m);
    double m2 = rounded((0.0300 - 31.4424 * x + 30.0717 * y) / m);
    for (int k = 0; k < BANDS; k++) {
        spd->power[k] = cie_daylight[k][0] + m1 * cie_daylight[k][1] + m2 * cie_daylight[k][2];
    }
    spd->n_missing = 0;
    return 0;
}

static int from_file(struct spd *spd, const char *name, const char *folder, struct err_list *errors,
                     struct err *e) {
    char path[PLACE_MAX];
    struct spectrum spectrum;
    bool dark = true;
    place_of(path, folder, name);
    if (spectrum_read_file(path, &spectrum, errors)) {
        return -ERR_INPUT;
    }
    for (int k = 0; k < BANDS; k++) {
        spd->power[k] = spectrum.covered[k] ? spectrum.value[k] : 0;
        spd->n_missing += !spectrum.covered[k];
        dark = dark && !(spd->power[k] > 0);
        if (spd->power[k] < 0) {
            return err_set(e, ERR_INPUT, "%s: the power at %d nm is %g; a lamp gives 0 or more", name,
                           band_nm(k), spd->power[k]);
        }
    }
    return dark
               ? err_set(e, ERR_INPUT, "%s gives no power between 380 and 780 nm; leave that light out", name)
               : sha256_of_file(path, spd->sha256, e);
}

int spd_find(struct spd *spd, const char *name, const char *folder, struct err_list *errors, struct err *e) {
    double cct_k;
    char number[32];
    *spd = (struct spd){0};
    snprintf(spd->name, sizeof spd->name, "%s", name);
    for (int i = 0; i < CIE_ILLUMINANTS; i++) {
        if (strcmp(name, cie_illuminant[i].name) == 0) {
            memcpy(spd->power, cie_illuminant[i].power, sizeof spd->power);
            return 0;
        }
    }
    snprintf(number, sizeof number, "%.*s", (int)strcspn(name, " K"), name);
    if (place_ends(name, "K") && number_read_double(number, &cct_k)) {
        return spd_daylight(spd, cct_k, e);
    }
    if (place_ends(name, ".csv")) {
        return from_file(spd, name, folder, errors, e);
    }
    return err_set(e, ERR_INPUT,
                   "there is no light '%s'; known are A, D50, D65, F2, F7, F11, a daylight as \"5003 K\", "
                   "and a file NAME.csv with lambda_nm,value",
                   name);
}
