#include "fit/points_option.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "proto/number.h"

const char points_option_help[] =
    "  FILE                a session (.gonio); CSV: theta_i_deg,theta_v_deg, then\n"
    "                      beta[,u_beta][,u_ind][,u_common_rel] or beta_550nm[,u_550nm],...; or the\n"
    "                      files of others: .astm, .brdf, ALTA text, CSV as NIST publishes it\n"
    "  --format FORMAT     session, csv, astm, brdf, alta, nist; default: recognised\n"
    "  --azimuth SIDE      forward-zero or forward-pi: where others' azimuths have the mirror side;\n"
    "                      default: detected, and said\n"
    "  --wavelength LO:HI  the mean is that of these nm (default 400:700)\n"
    "  --q Q               mean(S^2) / mean(S)^2 of a file that holds means alone (default 1: a grey "
    "surface)\n"
    "  --u REL:ABS         every point gets u = hypot(REL beta, ABS), whatever the file states\n"
    "  --max-theta-i DEG, --max-theta-v DEG, --blind DEG, --in-plane\n"
    "                      leave out larger angles, what is nearer to the source, what is out of plane\n";

static int take_format(const char *text, struct points_options *o, struct err *e) {
    o->format = text;
    return points_format_known(text)
               ? 0
               : err_set(e, ERR_USAGE, "--format is session, csv, astm, brdf, alta or nist, not '%.40s'",
                         text);
}

static int take_azimuth(const char *text, struct points_options *o, struct err *e) {
    o->azimuth = strcmp(text, "forward-zero") == 0 ? AZIMUTH_FORWARD_ZERO : AZIMUTH_FORWARD_PI;
    return o->azimuth == AZIMUTH_FORWARD_ZERO || strcmp(text, "forward-pi") == 0
               ? 0
               : err_set(e, ERR_USAGE, "--azimuth is forward-zero or forward-pi, not '%.40s'", text);
}

static int take_angle(const char *name, const char *text, double *deg, struct err *e) {
    return number_read_double(text, deg) && *deg > 0 && *deg <= 90
               ? 0
               : err_set(e, ERR_USAGE, "--%s is an angle of more than 0, up to 90 deg, not '%.40s'", name,
                         text);
}

/* "LOW:HIGH", both of them numbers. */
static bool read_pair(const char *text, double *low, double *high) {
    char first[32];
    const char *colon = strchr(text, ':');
    if (!colon || colon - text >= (ptrdiff_t)sizeof first) {
        return false;
    }
    snprintf(first, sizeof first, "%.*s", (int)(colon - text), text);
    return number_read_double(first, low) && number_read_double(colon + 1, high);
}

static int take_range(const char *text, struct points_options *o, struct err *e) {
    double low, high;
    if (!read_pair(text, &low, &high) || !(low >= 100 && high >= low && high <= 5000) || low != floor(low) ||
        high != floor(high)) {
        return err_set(e, ERR_USAGE, "--wavelength is LOW:HIGH in whole nm, 100 to 5000, not '%.40s'", text);
    }
    o->mean_low_nm = (int)low;
    o->mean_high_nm = (int)high;
    return 0;
}

static int take_u(const char *text, struct points_options *o, struct err *e) {
    o->has_u = read_pair(text, &o->u_relative, &o->u_absolute) && o->u_relative >= 0 && o->u_absolute >= 0 &&
               o->u_relative + o->u_absolute > 0;
    return o->has_u
               ? 0
               : err_set(e, ERR_USAGE,
                         "--u is RELATIVE:ABSOLUTE, two numbers of 0 or more and not both 0, not '%.40s'",
                         text);
}

static int take_q(const char *text, struct points_options *o, struct err *e) {
    return number_read_double(text, &o->q) && o->q >= 1 && o->q <= BANDS
               ? 0
               : err_set(e, ERR_USAGE, "--q is mean(S^2) / mean(S)^2, a number from 1 to %d, not '%.40s'",
                         BANDS, text);
}

int points_option_take(const char *name, const char *text, struct points_options *o, struct err *e) {
    if (strcmp(name, "format") == 0) {
        return take_format(text, o, e);
    }
    if (strcmp(name, "azimuth") == 0) {
        return take_azimuth(text, o, e);
    }
    if (strcmp(name, "max-theta-i") == 0) {
        return take_angle(name, text, &o->mask.max_theta_i_deg, e);
    }
    if (strcmp(name, "max-theta-v") == 0) {
        return take_angle(name, text, &o->mask.max_theta_v_deg, e);
    }
    if (strcmp(name, "blind") == 0) {
        return take_angle(name, text, &o->mask.blind_deg, e);
    }
    if (strcmp(name, "wavelength") == 0) {
        return take_range(text, o, e);
    }
    if (strcmp(name, "q") == 0) {
        return take_q(text, o, e);
    }
    if (strcmp(name, "u") == 0) {
        return take_u(text, o, e);
    }
    o->mask.in_plane = true;
    return 0;
}
