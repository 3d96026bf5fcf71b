/* What each model leaves unexplained, as the paper argues from it: relative residuals of four models on the same data. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "daemon/estimator.h"
#include "daemon/plot.h"
#include "proto/figure.h"
#include "proto/process.h"
#include "proto/units.h"

#define BETA_FLOOR .005 /* of the relative residual: measurement.md 10 */

static const char *const MODELS[] = {"lambert", "oren-nayar", "eq1", "composite"};
static const char *const COLOURS[] = {"#bbbbbb", "#ddcc77", "#88ccee", "#882255", "#117733"};
#define N_MODELS ((int)(sizeof MODELS / sizeof *MODELS))

/* `goniofit fit PATH --model MODEL --json`; what it complains of is for the user. */
static int fit(const char *path, const char *model, struct estimate *m, struct err *e) {
    char program[512];
    struct err why = {0};
    int rc = estimator_program(NULL, program, sizeof program, e);
    if (rc != 0)
        return rc;
    const char *const argv[] = {program, "fit", path, "--model", model, "--json", NULL};
    FILE *out = tmpfile();
    if (!out) {
        int saved = errno;
        return err_errno(e, ERR_IO, saved, "cannot make a temporary file for the fits");
    }
    if (process_run(argv, fileno(out), &why) < 0)
        rc = err_set(e, ERR_FIT, "goniofit could not fit %s: %.200s", path, why.text);
    json_t *answer = rc == 0 && lseek(fileno(out), 0, SEEK_SET) == 0 ? json_loadf(out, 0, NULL) : NULL;
    if (rc == 0)
        rc = answer ? estimate_from_json(answer, m, e)
                    : err_set(e, ERR_FIT, "goniofit's answer for %s is not JSON", path);
    json_decref(answer);
    fclose(out);
    return rc;
}

static int write_residuals(struct figure *f, const struct dataset *d, const struct estimate *m) {
    int rows = 0;
    for (int i = 0; i < d->n; i++) {
        const struct point *p = &d->point[i];
        double model, u, theta_i_deg = deg_from_udeg(p->theta_i_udeg),
                         theta_v_deg = deg_from_udeg(p->theta_v_udeg);
        if (!isfinite(p->mean) ||
            dataset_model_seen(m, theta_i_deg, theta_v_deg, dataset_mirrored(d, p), &model, &u, NULL) != 0)
            continue;
        double residual = p->mean - model;
        fprintf(f->csv, "%s,%s,%.3f,%.3f,%.9g,%.3g,%.9g,%.6g,%.6g\n", d->sample, m->model, theta_i_deg,
                theta_v_deg, p->mean, dataset_u_total(p), model, residual,
                residual / fmax(p->mean, BETA_FLOOR));
        rows++;
    }
    if (rows)
        figure_next_block(f);
    return rows;
}

/* The k-th model to show: after the paper's, that of the session's own fit where it is none of these. */
static const char *model_at(const struct dataset *d, int k) {
    for (int i = 0; k == N_MODELS && i < N_MODELS; i++)
        if (!strcmp(d->estimate.model, MODELS[i]))
            return NULL;
    return k < N_MODELS ? MODELS[k] : k == N_MODELS && d->has_estimate ? d->estimate.model : NULL;
}

/* A model that cannot be fitted is left out; it is an error where none can. */
static int panel(struct figure *f, const struct dataset *d, const char *path, struct err *e) {
    char title[200];
    const char *glue = "plot ";
    struct err last = {0};
    fprintf(
        f->gp,
        "set title \"%s\"\nset xlabel \"viewing angle / deg\"\nset ylabel \"(measured - model) / measured\"\n"
        "set yrange [-1:1]\nset key outside below\n",
        plot_title(d, title, sizeof title));
    for (int k = 0; model_at(d, k); k++) {
        struct estimate m;
        struct err why = {0};
        if (fit(path, model_at(d, k), &m, &why) != 0) {
            last = why;
            continue;
        }
        if (write_residuals(f, d, &m) == 0)
            continue;
        fprintf(
            f->gp,
            "%sdata index %d using 4:9 with points pt 7 ps 0.3 lc rgb \"%s\" title \"%s (median %.2g %%)\"",
            glue, f->block - 1, COLOURS[k], m.model, 100 * m.median_relative_error);
        glue = ", \\\n     ";
    }
    bool none = glue[0] == 'p';
    fputs(none ? "set multiplot next\n" : "\n", f->gp);
    if (none && last.code && e)
        *e = last;
    return none && last.code ? -last.code : 0;
}

int plot_residual(const struct plot_set *set, bool *drawn, struct err *e) {
    struct figure f;
    int rc = figure_begin(&f, set->dir, "residual",
                          "sample,model,theta_i_deg,theta_v_deg,beta,u,fitted,residual,relative", e);
    if (rc != 0)
        return rc;
    plot_panels(&f, set->n);
    for (int i = 0; rc == 0 && i < set->n; i++)
        rc = panel(&f, &set->data[i], set->path[i], e);
    *drawn = true;
    int ended = figure_end(&f, e);
    return rc ? rc : ended;
}
