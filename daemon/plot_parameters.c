/* Figures of fitted parameters: against water, and their uncertainty against what it cost to measure them. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "proto/figure.h"
#include "daemon/plot.h"

#define INCIDENCE_DEG 40 /* of peak height and retro/normal ratio; the paper's Fig. 4 */
#define SUPPORTS 5
#define QUANTITIES (DATASET_PARAMETERS + 2)

static const char *const QUANTITY[QUANTITIES] = {
    "S", "sigma / rad", "gamma / rad", "beta'", "n", "peak height at 40:40", "retro/normal ratio at 40 deg"};
static const char *const KEY[QUANTITIES] = {"S", "sigma",   "gamma",          "beta_prime",
                                            "n", "peak_40", "retro_normal_40"};
static const char *const COLOURS[] = {"#332288", "#117733", "#cc6677", "#ddaa33", "#aa4499"};

static int quantity(const struct dataset *d, int k, double *value, double *u) {
    const struct estimate *m = &d->estimate;
    if (k == DATASET_PARAMETERS)
        return dataset_model(m, INCIDENCE_DEG, INCIDENCE_DEG, value, u, NULL);
    if (k > DATASET_PARAMETERS)
        return dataset_model_ratio(m, INCIDENCE_DEG, -INCIDENCE_DEG, 0, value, u, NULL);
    *value = m->value[k];
    *u = m->at_bound[k] ? NAN : dataset_u(m, k);
    return 0;
}

static void write_quantities(struct figure *f, const struct dataset *d) {
    double truth;
    for (int k = 0; k < QUANTITIES; k++) {
        double value, u;
        if (quantity(d, k, &value, &u) != 0)
            continue;
        truth = d->has_truth && k < DATASET_PARAMETERS ? d->truth[k] : NAN;
        fprintf(f->csv, "%s,%s,%g,%s,%.9g,%.3g,%.9g\n", d->sample, d->support,
                d->has_water ? d->water_percent : NAN, KEY[k], value, u, truth);
    }
}

/* Each support is a curve of its own: paint on board and on paper are different surfaces. */
static int list_supports(const struct plot_set *set, const char *support[SUPPORTS]) {
    int n = 0;
    for (int i = 0; i < set->n; i++) {
        int known = 0;
        while (known < n && strcmp(support[known], set->data[i].support) != 0)
            known++;
        if (known == n && n < SUPPORTS && set->data[i].has_estimate && set->data[i].has_water)
            support[n++] = set->data[i].support;
    }
    return n;
}

static void parameter_panel(struct figure *f, const struct plot_set *set, int k) {
    const char *support[SUPPORTS];
    char label[80];
    int n = list_supports(set, support);
    bool truth = k < DATASET_PARAMETERS && set->data[0].has_truth;
    fprintf(f->gp,
            "set title \"%s\"\nset xlabel \"added water / %%\"\nset xrange [-10:100]\nunset ylabel\nplot ",
            QUANTITY[k]);
    for (int s = 0; s < n; s++) {
        figure_label(support[s], label, sizeof label);
        fprintf(f->gp,
                "%sdata using (strcol(2) eq \"%s\" && strcol(4) eq \"%s\" ? $3 : NaN):5:6 with yerrorbars pt "
                "7 ps 0.6 "
                "lc rgb \"%s\" title \"%s\"",
                s ? ", \\\n     " : "", label, KEY[k], COLOURS[s], label);
        if (truth)
            fprintf(f->gp,
                    ", \\\n     data using (strcol(2) eq \"%s\" && strcol(4) eq \"%s\" ? $3 : NaN):7 with "
                    "points pt 6 "
                    "ps 1.4 lc rgb \"%s\" title \"%s\"",
                    label, KEY[k], COLOURS[s], s ? "" : "true");
    }
    fputs("\n", f->gp);
}

int plot_parameters(const struct plot_set *set, bool *drawn, struct err *e) {
    struct figure f;
    int n = 0;
    for (int i = 0; i < set->n; i++)
        n += set->data[i].has_estimate && set->data[i].has_water;
    if (n == 0)
        return 0;
    int rc =
        figure_begin(&f, set->dir, "parameters", "sample,support,water_percent,quantity,value,u,true", e);
    if (rc != 0)
        return rc;
    for (int i = 0; i < set->n; i++)
        if (set->data[i].has_estimate && set->data[i].has_water)
            write_quantities(&f, &set->data[i]);
    figure_panels(&f, 2, 4, 1400, 640);
    for (int k = 0; k < QUANTITIES; k++)
        parameter_panel(&f, set, k);
    *drawn = true;
    return figure_end(&f, e);
}

/* ---- error_time ---- */

static void write_history(struct figure *f, const struct dataset *d) {
    for (int k = 0; k < DATASET_PARAMETERS; k++) {
        for (int i = 0; i < d->n_fits; i++) {
            const struct dataset_fit *fit = &d->fit[i];
            double error = d->has_truth ? fabs(fit->value[k] - d->truth[k]) / fabs(d->truth[k]) : NAN;
            fprintf(f->csv, "%s,%s,%.3f,%d,%.6g,%.6g\n", d->sample, KEY[k], fit->elapsed_s, fit->exposures,
                    fit->u[k] / fabs(fit->value[k]), error);
        }
        figure_next_block(f);
    }
}

static void history_panel(struct figure *f, const struct dataset *d, int first_block, int column,
                          const char *against) {
    char title[200];
    fprintf(f->gp,
            "set title \"%s\"\nset xlabel \"%s\"\nset ylabel \"relative u (line), true error (points)\"\n"
            "set logscale xy\nset format y \"%%.0e\"\nplot ",
            plot_title(d, title, sizeof title), against);
    for (int k = 0; k < DATASET_PARAMETERS; k++) {
        fprintf(f->gp, "%sdata index %d using %d:5 with lines lw 1.5 lc rgb \"%s\" title \"%s\"",
                k ? ", \\\n     " : "", first_block + k, column, COLOURS[k], KEY[k]);
        if (d->has_truth)
            fprintf(f->gp, ", \\\n     data index %d using %d:6 with points pt 7 ps 0.3 lc rgb \"%s\"",
                    first_block + k, column, COLOURS[k]);
    }
    fputs("\nunset logscale\nset format y\n", f->gp);
}

int plot_error_time(const struct plot_set *set, bool *drawn, struct err *e) {
    struct figure f;
    int n = 0;
    for (int i = 0; i < set->n; i++)
        n += set->data[i].n_fits > 0;
    if (n == 0)
        return 0;
    int rc = figure_begin(&f, set->dir, "error_time",
                          "sample,parameter,elapsed_s,exposures,u_rel,true_error_rel", e);
    if (rc != 0)
        return rc;
    figure_panels(&f, n, 2, 900, 330 * n);
    for (int i = 0; i < set->n; i++) {
        int first = f.block;
        if (set->data[i].n_fits == 0)
            continue;
        write_history(&f, &set->data[i]);
        history_panel(&f, &set->data[i], first, 3, "campaign time / s");
        history_panel(&f, &set->data[i], first, 4, "exposures");
    }
    *drawn = true;
    return figure_end(&f, e);
}
