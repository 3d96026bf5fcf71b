/*
 * plot.h — the figures of the paper from sessions, each as .svg, .pdf, .csv and the .gp that drew it.
 *
 * spectra_i40   radiance factor over wavelength at incidence 40 deg (paper, Fig. 2), one panel a session
 * water_i40     visible mean over viewing angle at 40 deg, sessions of one series (Fig. 4)
 * fit           visible mean with u, and the fitted model, every incidence (Fig. 6, 7)
 * residual      relative residual of the paper's model, of the session's own where it is another, and of Lambert,
 *               Oren-Nayar alone and Eq. 1, all fitted to the same data
 * parameters    each parameter that a session's model has, peak height and retro/normal ratio at 40 deg, against water
 * error_time    u of each parameter, and its true error where the truth is known, against time and exposures
 *
 * The incidence nearest to 40 deg that was measured is used and named. A session without a fit is left out of the
 * figures that need one, and said so on stderr.
 * Checked    tests/scenario/test_plot.c
 */
#ifndef DAEMON_PLOT_H
#define DAEMON_PLOT_H

#include "daemon/dataset.h"

struct figure; /* proto/figure.h */

struct plot_set {
    const char *dir;
    const char *const *path; /* of each session, for goniofit */
    const struct dataset *data;
    int n;
};

/* One figure of a name above; *drawn is false where the sessions hold nothing for it. */
struct plot_kind {
    const char *name;
    int (*draw)(const struct plot_set *set, bool *drawn, struct err *e);
};
extern const struct plot_kind PLOT_KINDS[]; /* ends with name == NULL */

/* Shared by the figures. */
void plot_panels(struct figure *f, int n); /* n panels of the usual size, two in a row */
const char *plot_title(const struct dataset *d, char *buffer,
                       size_t size); /* "hg60: Hooker's Green, paper, 60 % water" */
int plot_residual(const struct plot_set *set, bool *drawn, struct err *e);
int plot_parameters(const struct plot_set *set, bool *drawn, struct err *e);
int plot_error_time(const struct plot_set *set, bool *drawn, struct err *e);

#endif
