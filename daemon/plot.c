/* The figures of measured radiance factors; those of the parameters are in plot_parameters.c. */
#include "daemon/plot.h"

#include <math.h>
#include <stdio.h>

#include "proto/figure.h"
#include "proto/units.h"

#define PAPER_INCIDENCE_DEG 40 /* of the paper's Fig. 2 and 4 */
#define PANEL_WIDTH 440
#define PANEL_HEIGHT 330
#define SPECTRA_STEP_UDEG (20 * UDEG_PER_DEG) /* one spectrum every 20 deg of viewing angle */
#define MODEL_STEP_DEG 0.5
#define MODEL_LIMIT_DEG 85

static const char *const COLOURS[] = {"#332288", "#88ccee", "#117733", "#ddcc77", "#cc6677",
                                      "#aa4499", "#44aa99", "#882255", "#999933", "#661100"};
#define COLOUR(k) COLOURS[(k) % (int)(sizeof COLOURS / sizeof *COLOURS)]

void plot_panels(struct figure *f, int n) {
    int columns = n < 2 ? 1 : 2, rows = (n + columns - 1) / columns;
    figure_panels(f, rows, columns, PANEL_WIDTH * columns, PANEL_HEIGHT * rows);
}

const char *plot_title(const struct dataset *d, char *buffer, size_t size) {
    char text[400], water[32] = "";
    if (d->has_water)
        snprintf(water, sizeof water, ", %g %% water", d->water_percent);
    snprintf(text, sizeof text, "%s%s%s%s%s%s", d->sample[0] ? d->sample : d->name, d->paint[0] ? ": " : "",
             d->paint, d->support[0] ? ", " : "", d->support, water);
    return figure_label(text, buffer, size);
}

/* ---- spectra_i40 ---- */

static int write_spectrum(struct figure *f, const struct dataset *d, const struct point *p) {
    int rows = 0;
    for (int k = 0; k < BANDS; k++) {
        if (!p->present[k])
            continue;
        fprintf(f->csv, "%s,%.3f,%.3f,%d,%.9g,%.3g\n", d->sample, deg_from_udeg(p->theta_i_udeg),
                deg_from_udeg(p->theta_v_udeg), band_nm(k), p->beta[k], dataset_u_band(p, k));
        rows++;
    }
    if (rows)
        figure_next_block(f);
    return rows;
}

static bool wanted_spectrum(const struct point *p) {
    int32_t off = p->theta_v_udeg % SPECTRA_STEP_UDEG;
    int32_t distance = off < 0 ? -off : off;
    return distance < UDEG_PER_DEG / 10 || distance > SPECTRA_STEP_UDEG - UDEG_PER_DEG / 10;
}

static void spectra_panel(struct figure *f, const struct dataset *d) {
    struct dataset_sweep s = dataset_sweep_nearest(d, PAPER_INCIDENCE_DEG);
    char title[200];
    fprintf(f->gp,
            "set key outside right\nset title \"%s, incidence %.3g deg\"\nset xlabel \"wavelength / "
            "nm\"\nset ylabel \"radiance "
            "factor\"\n",
            plot_title(d, title, sizeof title), s.theta_i_deg);
    const char *glue = "plot ";
    int drawn = 0;
    for (int i = s.first; i < s.first + s.n; i++) {
        if (!wanted_spectrum(&d->point[i]) || write_spectrum(f, d, &d->point[i]) == 0)
            continue;
        fprintf(
            f->gp,
            "%sdata index %d using 4:5:6 with yerrorlines pt 7 ps 0.2 lc rgb \"%s\" title \"view %.0f deg\"",
            glue, f->block - 1, COLOUR(drawn++), deg_from_udeg(d->point[i].theta_v_udeg));
        glue = ", \\\n     ";
    }
    fputs(drawn ? "\n" : "set multiplot next\n", f->gp);
}

static int plot_spectra(const struct plot_set *set, bool *drawn, struct err *e) {
    struct figure f;
    int rc = figure_begin(&f, set->dir, "spectra_i40", "sample,theta_i_deg,theta_v_deg,lambda_nm,beta,u", e);
    if (rc != 0)
        return rc;
    plot_panels(&f, set->n);
    for (int i = 0; i < set->n; i++)
        spectra_panel(&f, &set->data[i]);
    *drawn = true;
    return figure_end(&f, e);
}

/* ---- water_i40 ---- */

static void write_sweep(struct figure *f, const struct dataset *d, struct dataset_sweep s) {
    for (int i = s.first; i < s.first + s.n; i++) {
        const struct point *p = &d->point[i];
        if (isfinite(p->mean))
            fprintf(f->csv, "%s,%g,%.3f,%.3f,%.9g,%.3g\n", d->sample, d->water_percent,
                    deg_from_udeg(p->theta_i_udeg), deg_from_udeg(p->theta_v_udeg), p->mean,
                    dataset_u_total(p));
    }
    figure_next_block(f);
}

static int plot_water(const struct plot_set *set, bool *drawn, struct err *e) {
    struct figure f;
    char title[200];
    int rc =
        figure_begin(&f, set->dir, "water_i40", "sample,water_percent,theta_i_deg,theta_v_deg,beta,u", e);
    if (rc != 0)
        return rc;
    figure_panels(&f, 1, 1, 2 * PANEL_WIDTH, 2 * PANEL_HEIGHT);
    fprintf(f.gp,
            "set title \"Visible mean at incidence %d deg\"\nset xlabel \"viewing angle / deg\"\n"
            "set ylabel \"radiance factor\"\nset logscale y\nset key left top\nplot ",
            PAPER_INCIDENCE_DEG);
    for (int i = 0; i < set->n; i++) {
        write_sweep(&f, &set->data[i], dataset_sweep_nearest(&set->data[i], PAPER_INCIDENCE_DEG));
        fprintf(f.gp, "%sdata index %d using 4:5:6 with yerrorlines pt 7 ps 0.4 lc rgb \"%s\" title \"%s\"",
                i ? ", \\\n     " : "", i, COLOUR(i), plot_title(&set->data[i], title, sizeof title));
    }
    fputs("\nunset logscale\n", f.gp);
    *drawn = true;
    return figure_end(&f, e);
}

/* ---- fit ---- */

static void write_fit_point(struct figure *f, const struct dataset *d, const struct point *p) {
    double model = NAN, u = NAN;
    double theta_i_deg = deg_from_udeg(p->theta_i_udeg), theta_v_deg = deg_from_udeg(p->theta_v_udeg);
    dataset_model_seen(&d->estimate, theta_i_deg, theta_v_deg, dataset_mirrored(d, p), &model, &u, NULL);
    if (isfinite(p->mean))
        fprintf(f->csv, "%s,measured,%.3f,%.3f,%.9g,%.3g,%.9g,%.3g\n", d->sample, theta_i_deg, theta_v_deg,
                p->mean, dataset_u_total(p), model, u);
}

static void write_fit_curve(struct figure *f, const struct dataset *d, const struct dataset_sweep *s) {
    const bool mirrored = dataset_mirrored(d, &d->point[s->first]);
    for (double v = -MODEL_LIMIT_DEG; v <= MODEL_LIMIT_DEG; v += MODEL_STEP_DEG) {
        double beta, u;
        if (dataset_model_seen(&d->estimate, s->theta_i_deg, v, mirrored, &beta, &u, NULL) == 0)
            fprintf(f->csv, "%s,model,%.3f,%.3f,,,%.9g,%.3g\n", d->sample, s->theta_i_deg, v, beta, u);
    }
}

static void fit_panel(struct figure *f, const struct dataset *d) {
    struct dataset_sweep sweep[DATASET_SWEEPS];
    int n = dataset_sweeps(d, sweep, DATASET_SWEEPS);
    char title[200];
    fprintf(f->gp,
            "set title \"%s\"\nset xlabel \"viewing angle / deg\"\nset ylabel \"radiance factor (mean %d to "
            "%d nm)\"\nset key left top\nplot ",
            plot_title(d, title, sizeof title), d->estimate.mean_low_nm, d->estimate.mean_high_nm);
    for (int s = 0; s < n; s++) {
        for (int i = sweep[s].first; i < sweep[s].first + sweep[s].n; i++)
            write_fit_point(f, d, &d->point[i]);
        figure_next_block(f);
        write_fit_curve(f, d, &sweep[s]);
        figure_next_block(f);
        fprintf(f->gp,
                "%sdata index %d using 4:5:6 with yerrorbars pt 7 ps 0.35 lc rgb \"%s\" title \"incidence "
                "%.3g deg\", "
                "\\\n     data index %d using 4:7 with lines lc rgb \"%s\"",
                s ? ", \\\n     " : "", f->block - 2, COLOUR(s), sweep[s].theta_i_deg, f->block - 1,
                COLOUR(s));
    }
    fputs("\n", f->gp);
}

static int plot_fit(const struct plot_set *set, bool *drawn, struct err *e) {
    struct figure f;
    int n = 0;
    for (int i = 0; i < set->n; i++)
        n += set->data[i].has_estimate;
    if (n == 0)
        return 0;
    int rc = figure_begin(&f, set->dir, "fit", "sample,kind,theta_i_deg,theta_v_deg,beta,u,model,u_model", e);
    if (rc != 0)
        return rc;
    plot_panels(&f, n);
    for (int i = 0; i < set->n; i++)
        if (set->data[i].has_estimate)
            fit_panel(&f, &set->data[i]);
    *drawn = true;
    return figure_end(&f, e);
}

const struct plot_kind PLOT_KINDS[] = {{"spectra_i40", plot_spectra},
                                       {"water_i40", plot_water},
                                       {"fit", plot_fit},
                                       {"residual", plot_residual},
                                       {"parameters", plot_parameters},
                                       {"error_time", plot_error_time},
                                       {0}};
