/*
 * points.h — the points of a file, of any form goniofit knows, into a fitset; what was assumed on the way.
 *
 *     session      .gonio      SQLite file of goniod                    fit/points_session.h
 *     csv          .csv        theta_i_deg,theta_v_deg,beta,...         fit/points_csv.h
 *     astm         .astm       keys, VARS, rows                         proto/astm.h
 *     brdf         .brdf       counts, wavelengths, numbers             proto/brdf.h
 *     alta         .alta .dat  #DIM, #PARAM_IN, rows                    proto/alta.h
 *     nist         .csv        lambda,thetai,phi,thetar,phir,f_r11      proto/nist.h
 *
 * The form is recognised by what the file holds, else by its extension; options->format names it instead.
 * Options    all zero: recognise, detect, leave out nothing. A range of wavelengths (mean_high_nm > 0) is refused
 *            where a file holds none (a session keeps the mean it was reduced to).
 * Errors     -ERR_INPUT with file:line:column, all of them in errors; -ERR_IO; -ERR_USAGE an unknown format.
 * Checked    tests/unit/test_points_surface.c, tests/unit/test_goniofit.py
 */
#ifndef FIT_POINTS_H
#define FIT_POINTS_H

#include "fit/azimuth.h"
#include "fit/fitset.h"

struct points_options {
    const char *format; /* NULL: recognised */
    enum azimuth azimuth;
    struct mask mask;
    int mean_low_nm, mean_high_nm;
    bool has_u; /* every point gets hypot(u_relative beta, u_absolute) */
    double u_relative, u_absolute;
    double q; /* of a file that holds means alone; 0: not given, taken as 1 with a note */
};

struct points_report {
    const char *format;
    char azimuth[200]; /* empty where the form leaves no choice */
    int n_notes;
    char note[BRDF_NOTES_MAX + 2][200];
};

int points_read(const char *path, const struct points_options *options, struct fitset *data,
                struct points_report *report, struct err_list *errors);
bool points_format_known(const char *name);

#endif
