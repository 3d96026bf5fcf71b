#include "proto/session_internal.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* The lines that session_dump prints for derived rows, from the structs: gonioctl reduce has no file to dump. */

static void put_int(FILE *out, const char *name, int64_t value) {
    fprintf(out, "\t%s=%lld", name, (long long)value);
}

/* A column of SQLite knows neither NaN nor -0. */
static void put_real(FILE *out, const char *name, double value) {
    fprintf(out, "\t%s=", name);
    if (!isnan(value))
        fprintf(out, "%.17g", value + 0.0);
}

static void put_reals(FILE *out, const char *name, const double *value) {
    fprintf(out, "\t%s=", name);
    for (int band = 0; band < BANDS; band++)
        fprintf(out, "%s%.17g", band ? "," : "", value[band]);
}

static void print_point(FILE *out, const struct point *p) {
    fputs("point", out);
    put_int(out, "id", p->id);
    if (p->supersedes)
        put_int(out, "supersedes", p->supersedes);
    else
        fputs("\tsupersedes=", out);
    put_int(out, "provisional", p->provisional);
    put_int(out, "exposure_id", p->exposure_id);
    put_int(out, "bracket", p->bracket);
    put_real(out, "tau_us", p->tau_us);
    put_real(out, "tau_r_us", p->tau_r_us);
    put_int(out, "theta_i_udeg", p->theta_i_udeg);
    put_int(out, "theta_v_udeg", p->theta_v_udeg);
    put_int(out, "saturated", p->saturated);
    put_real(out, "scan_f", p->scan_f);
    put_int(out, "noisy", p->noisy);
    put_real(out, "mean", p->mean);
    put_real(out, "mean_u_ind", p->mean_u_ind);
    put_real(out, "mean_u_common", session_common_mean(p));
    putc('\n', out);
}

static void print_bands(FILE *out, const struct point *p) {
    for (int band = 0; band < BANDS; band++) {
        if (!p->present[band])
            continue;
        fputs("point_band", out);
        put_int(out, "point_id", p->id);
        put_int(out, "band", band);
        put_real(out, "beta", p->beta[band]);
        put_real(out, "u_ind", p->u_ind[band]);
        put_real(out, "u_common", session_common_band(p, band));
        put_real(out, "cov_next", p->cov_next[band]);
        putc('\n', out);
    }
}

static void print_commons(FILE *out, const struct point *p) {
    for (int k = 0; k < p->n_common; k++) {
        fputs("point_common", out);
        put_int(out, "point_id", p->id);
        put_int(out, "at", k);
        fprintf(out, "\tname=%s", p->common[k].name);
        put_real(out, "mean", p->common[k].mean);
        put_reals(out, "sensitivity", p->common[k].sensitivity);
        putc('\n', out);
    }
}

void session_print_point(void *file, const char *table, const struct point *p) {
    if (strcmp(table, "point") == 0)
        print_point(file, p);
    else if (strcmp(table, "point_band") == 0)
        print_bands(file, p);
    else
        print_commons(file, p);
}

void session_print_bracket(void *file, int64_t id, const struct bracket *b) {
    fputs("bracket", file);
    put_int(file, "id", id);
    put_int(file, "number", b->number);
    put_int(file, "open_us", b->open_us);
    put_int(file, "close_us", b->close_us);
    put_real(file, "mean_rate", b->mean_rate);
    fprintf(file, "\tended_by=%s", b->ended_by);
    put_int(file, "last_exposure_id", b->last_exposure_id);
    put_reals(file, "rate", b->rate);
    putc('\n', file);
}
