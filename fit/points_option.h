/*
 * points_option.h — the options of a command line that say how a file is read and what of it is used.
 *
 * One table for every command that reads points: POINTS_OPTIONS goes into the struct option of getopt_long, the name
 * of the option that came and its argument go to points_option_take, points_option_help into the help.
 * Errors     -ERR_USAGE with what the option must be.
 * Checked    tests/unit/test_goniofit.py
 */
#ifndef FIT_POINTS_OPTION_H
#define FIT_POINTS_OPTION_H

#include "fit/points.h"

/* All of them return code. */
#define POINTS_OPTIONS(code)                                                                                 \
    {"format", required_argument, NULL, code}, {"azimuth", required_argument, NULL, code},                   \
        {"max-theta-i", required_argument, NULL, code}, {"max-theta-v", required_argument, NULL, code},      \
        {"blind", required_argument, NULL, code}, {"in-plane", no_argument, NULL, code},                     \
        {"wavelength", required_argument, NULL, code}, {"q", required_argument, NULL, code}, {               \
        "u", required_argument, NULL, code                                                                   \
    }

extern const char points_option_help[];

/* text must live as long as options do. */
int points_option_take(const char *name, const char *text, struct points_options *options, struct err *e);

#endif
