/* Figures of fitted parameters: against water, and their uncertainty against what it cost to measure them. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "daemon/plot.h"
#include "proto/figure.h"

#define INCIDENCE_DEG 40 /* of peak height and retro/normal ratio; the paper's Fig. 4 */
#define SUPPORTS 5
#define COLUMNS 4

/* Parameters by their names of proto/material.h, whichever model has them; then what follows from all of them. */
static const struct {
    const char *key, *label;
} QUANTITY[] = {{"S", "S"},
                {"sigma", "sigma / rad"},
                {"gamma", "gamma / rad"},
                {"beta_prime", "beta'"},
                {"n", "n"},
                {"tail", "tail"},
                {"n_d", "n of the transmitted light"},
                {"gamma_2", "gamma / rad of the second lobe"},
                {"beta_prime_2", "beta' of the second lobe"},
                {"peak_40", "peak height at 40:40"},
                {"retro_normal_40", "retro/normal ratio at 40 deg"}};
#define QUANTITIES (int)(sizeof QUANTITY / sizeof *QUANTITY)
#define PEAK (QUANTITIES - 2)
static const char *const COLOURS[] = {"#332288", "#117733", "#cc6677", "#ddaa33",
                                      "#aa4499", "#88ccee", "#882255"};

/* Negative where the model has no such parameter or no value there. */
static int quantity(const struct dataset *d, int k, double *value, double *u) {
    const struct estimate *m = &d->estimate;
    if (k == PEAK)
        return dataset_model(m, INCIDENCE_DEG, INCIDENCE_DEG, value, u, NULL);
    if (k > PEAK)
        return dataset_model_ratio(m, INCIDENCE_DEG, -INCIDENCE_DEG, 0, value, u, NULL);
    const int at = material_parameter_find(m->model, QUANTITY[k].key);
    if (at < 0)
        return -ERR_RANGE;
    *value = m->value[at];
    *u = m->at_bound[at] ? NAN : dataset_u(m, at);
    return 0;
}

static bool is_drawn(const struct dataset *d) {
    return d->has_estimate && d->has_water;
}

static bool any_has(const struct plot_set *set, int k) {
    double value, u;
    for (int i = 0; i < set->n; i++)
        if (is_drawn(&set->data[i]) && quantity(&set->data[i], k, &value, &u) == 0)
            return true;
    return false;
}

/* The truth is one of the composite model, whose parameters come first. */
static void write_quantities(struct figure *f, const struct dataset *d) {
    for (int k = 0; k < QUANTITIES; k++) {
        double value, u, truth = d->has_truth && k < DATASET_PARAMETERS ? d->truth[k] : NAN;
        if (quantity(d, k, &value, &u) != 0)
            continue;
        fprintf(f->csv, "%s,%s,%g,%s,%.9g,%.3g,%.9g\n", d->sample, d->support,
                d->has_water ? d->water_percent : NAN, QUANTITY[k].key, value, u, truth);
    }
}

/* Each support is a curve of its own: paint on board and on paper are different surfaces. */
static int list_supports(const struct plot_set *set, const char *support[SUPPORTS]) {
    int n = 0;
    for (int i = 0; i < set->n; i++) {
        int known = 0;
        while (known < n && strcmp(support[known], set->data[i].support) != 0)
            known++;
        if (known == n && n < SUPPORTS && is_drawn(&set->data[i]))
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
            QUANTITY[k].label);
    for (int s = 0; s < n; s++) {
        figure_label(support[s], label, sizeof label);
        fprintf(f->gp,
                "%sdata using (strcol(2) eq \"%s\" && strcol(4) eq \"%s\" ? $3 : NaN):5:6 with yerrorbars pt "
                "7 ps 0.6 "
                "lc rgb \"%s\" title \"%s\"",
                s ? ", \\\n     " : "", label, QUANTITY[k].key, COLOURS[s], label);
        if (truth)
            fprintf(f->gp,
                    ", \\\n     data using (strcol(2) eq \"%s\" && strcol(4) eq \"%s\" ? $3 : NaN):7 with "
                    "points pt 6 "
                    "ps 1.4 lc rgb \"%s\" title \"%s\"",
                    label, QUANTITY[k].key, COLOURS[s], s ? "" : "true");
    }
    fputs("\n", f->gp);
}

int plot_parameters(const struct plot_set *set, bool *drawn, struct err *e) {
    struct figure f;
    int panels = 0;
    for (int k = 0; k < QUANTITIES; k++)
        panels += any_has(set, k);
    if (panels == 0)
        return 0;
    int rc =
        figure_begin(&f, set->dir, "parameters", "sample,support,water_percent,quantity,value,u,true", e);
    if (rc != 0)
        return rc;
    for (int i = 0; i < set->n; i++)
        if (is_drawn(&set->data[i]))
            write_quantities(&f, &set->data[i]);
    const int rows = (panels + COLUMNS - 1) / COLUMNS;
    figure_panels(&f, rows, COLUMNS, 1400, 320 * rows);
    for (int k = 0; k < QUANTITIES; k++)
        if (any_has(set, k))
            parameter_panel(&f, set, k);
    *drawn = true;
    return figure_end(&f, e);
}

/* ---- error_time ---- */

/* One block for each parameter of the model. */
static void write_history(struct figure *f, const struct dataset *d) {
    for (int k = 0; k < MATERIAL_PARAMETERS; k++) {
        const char *name = material_parameter_name(d->estimate.model, k);
        const bool truth = d->has_truth && k < DATASET_PARAMETERS;
        for (int i = 0; name && i < d->n_fits; i++) {
            const struct dataset_fit *fit = &d->fit[i];
            double error = truth ? fabs(fit->value[k] - d->truth[k]) / fabs(d->truth[k]) : NAN;
            fprintf(f->csv, "%s,%s,%.3f,%d,%.6g,%.6g\n", d->sample, name, fit->elapsed_s, fit->exposures,
                    fit->u[k] / fabs(fit->value[k]), error);
        }
        if (name)
            figure_next_block(f);
    }
}

static void history_panel(struct figure *f, const struct dataset *d, int first_block, int column,
                          const char *against) {
    char title[200];
    int block = first_block;
    fprintf(f->gp,
            "set title \"%s\"\nset xlabel \"%s\"\nset ylabel \"relative u (line), true error (points)\"\n"
            "set logscale xy\nset format y \"%%.0e\"\nplot ",
            plot_title(d, title, sizeof title), against);
    for (int k = 0; k < MATERIAL_PARAMETERS; k++) {
        const char *name = material_parameter_name(d->estimate.model, k);
        if (!name)
            continue;
        fprintf(f->gp, "%sdata index %d using %d:5 with lines lw 1.5 lc rgb \"%s\" title \"%s\"",
                block > first_block ? ", \\\n     " : "", block, column, COLOURS[k], name);
        if (d->has_truth && k < DATASET_PARAMETERS)
            fprintf(f->gp, ", \\\n     data index %d using %d:6 with points pt 7 ps 0.3 lc rgb \"%s\"", block,
                    column, COLOURS[k]);
        block++;
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
