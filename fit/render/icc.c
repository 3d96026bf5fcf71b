#include "fit/render/icc.h"

#include <lcms2.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#define DATE_AT 24 /* ICC.1:2010 table 17: year, month, day, hour, minute, second, 16 bits each */
#define DATE_SIZE 12

static cmsToneCurve *curve_of(enum colour_space space) {
    const struct colour_curve *c = colour_curve(space);
    if (c->gain == 0) {
        return cmsBuildGamma(NULL, c->gamma);
    }
    /* Type 4: (a X + b)^g from d on, c X below. */
    cmsFloat64Number parameters[5] = {c->gamma, 1 / c->scale, c->offset / c->scale, 1 / c->gain,
                                      c->low * c->gain};
    return cmsBuildParametricToneCurve(NULL, 4, parameters);
}

static void name_profile(cmsHPROFILE profile, enum colour_space space) {
    cmsMLU *text = cmsMLUalloc(NULL, 1);
    if (text && cmsMLUsetASCII(text, "en", "US", colour_space_name(space))) {
        cmsWriteTag(profile, cmsSigProfileDescriptionTag, text);
    }
    cmsMLUfree(text);
}

static cmsHPROFILE make_profile(enum colour_space space) {
    const double(*xy)[2] = colour_primaries(space);
    cmsCIExyY white = {xy[3][0], xy[3][1], 1};
    cmsCIExyYTRIPLE primaries = {{xy[0][0], xy[0][1], 1}, {xy[1][0], xy[1][1], 1}, {xy[2][0], xy[2][1], 1}};
    cmsToneCurve *curve = curve_of(space);
    if (!curve) {
        return NULL;
    }
    cmsHPROFILE profile = cmsCreateRGBProfile(&white, &primaries, (cmsToneCurve *[]){curve, curve, curve});
    cmsFreeToneCurve(curve);
    if (profile) {
        name_profile(profile, space);
    }
    return profile;
}

int icc_make(enum colour_space space, unsigned char **bytes, size_t *size, struct err *e) {
    static const unsigned char date[DATE_SIZE] = {0x07, 0xd0, 0, 1, 0, 1}; /* 2000-01-01 */
    cmsUInt32Number needed = 0;
    cmsHPROFILE profile = make_profile(space);
    bool good = profile && cmsSaveProfileToMem(profile, NULL, &needed) && (*bytes = malloc(needed)) != NULL;
    if (good && !cmsSaveProfileToMem(profile, *bytes, &needed)) {
        free(*bytes);
        good = false;
    }
    if (profile) {
        cmsCloseProfile(profile);
    }
    if (!good) {
        return err_set(e, ERR_NOMEM, "no memory for the profile of %s", colour_space_name(space));
    }
    memcpy(*bytes + DATE_AT, date, DATE_SIZE);
    *size = needed;
    return 0;
}
