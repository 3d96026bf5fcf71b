/* csv and astm: the points that stand, one row each. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/session_text.h"
#include "daemon/verb_export.h"
#include "fit/drift.h"

#define RAD_PER_UDEG (3.14159265358979323846 / 180e6)

struct rows {
    size_t n, capacity;
    struct point *point;
    int n_brackets;
    struct bracket *bracket;
};

static int keep_point(void *arg, const struct point *p) {
    struct rows *r = arg;
    if (p->provisional)
        return 0;
    if (r->n == r->capacity) {
        size_t capacity = r->capacity ? 2 * r->capacity : 64;
        struct point *grown = realloc(r->point, capacity * sizeof *grown);
        if (!grown)
            return -ERR_NOMEM;
        r->point = grown;
        r->capacity = capacity;
    }
    r->point[r->n++] = *p;
    return 0;
}

static int keep_bracket(void *arg, const struct bracket *b) {
    struct rows *r = arg;
    struct bracket *grown = realloc(r->bracket, (size_t)(r->n_brackets + 1) * sizeof *grown);
    if (!grown)
        return -ERR_NOMEM;
    r->bracket = grown;
    r->bracket[r->n_brackets++] = *b;
    return 0;
}

static int by_angles(const void *a, const void *b) {
    const struct point *p = a, *q = b;
    if (p->theta_i_udeg != q->theta_i_udeg)
        return p->theta_i_udeg < q->theta_i_udeg ? -1 : 1;
    return (p->theta_v_udeg > q->theta_v_udeg) - (p->theta_v_udeg < q->theta_v_udeg);
}

static int read_rows(struct session *s, struct rows *r, struct err *e) {
    memset(r, 0, sizeof *r);
    int rc = session_each_point(s, false, keep_point, r, e);
    if (rc == 0)
        rc = session_each_bracket(s, keep_bracket, r, e);
    if (rc == 0 && r->n == 0)
        rc = err_set(
            e, ERR_STATE,
            "the session holds no final point: no bracket was closed by a reading of the reference. What is "
            "provisional is in its view point_mean (docs/session-format.md)");
    if (r->n)
        qsort(r->point, r->n, sizeof *r->point, by_angles);
    return rc;
}

static void free_rows(struct rows *r) {
    free(r->point);
    free(r->bracket);
}

/* Relative variance of the drift between the reading of the reference and that of the sample. */
static double drift_variance(const struct rows *r, const struct point *p, int band) {
    for (int i = 0; i < r->n_brackets; i++) {
        const struct bracket *b = &r->bracket[i];
        if (b->number != p->bracket)
            continue;
        const struct estimate_bracket of = {.n = 1,
                                            .tau_us = &p->tau_us,
                                            .tau_r_us = &p->tau_r_us,
                                            .length_us = (double)(b->close_us - b->open_us),
                                            .rate = band < 0 ? b->mean_rate : b->rate[band]};
        return drift_covariance(&of, 0, 0);
    }
    return 0;
}

static double total_u(const struct rows *r, const struct point *p, int band) {
    double ind = band < 0 ? p->mean_u_ind : p->u_ind[band], beta = band < 0 ? p->mean : p->beta[band];
    double common = band < 0 ? session_common_mean(p) : session_common_band(p, band);
    return sqrt(ind * ind + common * common + beta * beta * drift_variance(r, p, band));
}

static double certificate_rel(const struct point *p) {
    for (int k = 0; k < p->n_common; k++)
        if (strcmp(p->common[k].name, "certificate") == 0 && p->mean > 0)
            return p->common[k].mean / p->mean;
    return 0;
}

static void print_angles(const struct point *p, FILE *out) {
    fprintf(out, "%.6f,%.6f", p->theta_i_udeg / 1e6, p->theta_v_udeg / 1e6);
}

static void csv_means(const struct rows *r, FILE *out) {
    fputs("theta_i_deg,theta_v_deg,beta,u_beta,u_ind,u_common_rel\n", out);
    for (size_t i = 0; i < r->n; i++) {
        const struct point *p = &r->point[i];
        if (isnan(p->mean))
            continue;
        print_angles(p, out);
        fprintf(out, ",%.17g,%.9g,%.9g,%.9g\n", p->mean, total_u(r, p, -1), p->mean_u_ind,
                certificate_rel(p));
    }
}

/* Bands that every point has; in a table of columns there is no other honest way to leave a value out. */
static void find_bands(const struct rows *r, bool whole[BANDS]) {
    for (int band = 0; band < BANDS; band++) {
        whole[band] = true;
        for (size_t i = 0; i < r->n; i++)
            whole[band] = whole[band] && r->point[i].present[band];
    }
}

static void csv_spectra(const struct rows *r, FILE *out) {
    bool whole[BANDS];
    find_bands(r, whole);
    fputs("theta_i_deg,theta_v_deg", out);
    for (int band = 0; band < BANDS; band++)
        if (whole[band])
            fprintf(out, ",beta_%dnm,u_%dnm", band_nm(band), band_nm(band));
    putc('\n', out);
    for (size_t i = 0; i < r->n; i++) {
        print_angles(&r->point[i], out);
        for (int band = 0; band < BANDS; band++)
            if (whole[band])
                fprintf(out, ",%.17g,%.9g", r->point[i].beta[band], total_u(r, &r->point[i], band));
        putc('\n', out);
    }
}

int export_csv(struct session *s, bool spectrum, FILE *out, struct err *e) {
    struct rows r;
    int rc = read_rows(s, &r, e);
    if (rc == 0 && spectrum)
        csv_spectra(&r, out);
    else if (rc == 0)
        csv_means(&r, out);
    free_rows(&r);
    return rc;
}

static int astm_header(struct session *s, const struct rows *r, const bool whole[BANDS], FILE *out,
                       struct err *e) {
    json_t *sample;
    struct session_summary summary;
    char begun[40];
    int rc = session_text_json(s, "sample", &sample, e);
    if (rc == 0)
        rc = session_get_summary(s, &summary, e);
    if (rc < 0)
        return rc;
    const char *name = json_string_value(json_object_get(sample, "name"));
    fprintf(
        out,
        "ASTM E 1392-96 style, angle resolved scatter, in plane\nLAB_NAME \"goniod %s\"\nSAMPLE_ID \"%s\"\n",
        GONIOD_VERSION, name ? name : "");
    fprintf(out, "DATE \"%s\"\n", session_text_utc(summary.first_utc_us, begun, sizeof begun));
    fputs("UNITS \"angles rad, BRDF 1/sr; phi_s = pi on the mirror side\"\n", out);
    fprintf(out, "NUM_POINTS %zu\nVARS theta_i,phi_i,theta_s,phi_s", r->n);
    for (int band = 0; band < BANDS; band++)
        if (whole[band])
            fprintf(out, ",BRDF_%dnm", band_nm(band));
    putc('\n', out);
    json_decref(sample);
    return 0;
}

int export_astm(struct session *s, FILE *out, struct err *e) {
    struct rows r;
    bool whole[BANDS];
    int rc = read_rows(s, &r, e);
    find_bands(&r, whole);
    if (rc == 0)
        rc = astm_header(s, &r, whole, out, e);
    for (size_t i = 0; rc == 0 && i < r.n; i++) {
        const struct point *p = &r.point[i];
        fprintf(out, "%.9f,0,%.9f,%.9f", p->theta_i_udeg * RAD_PER_UDEG, abs(p->theta_v_udeg) * RAD_PER_UDEG,
                p->theta_v_udeg > 0 ? 180e6 * RAD_PER_UDEG : 0.0);
        for (int band = 0; band < BANDS; band++)
            if (whole[band])
                fprintf(out, ",%.9g", p->beta[band] / (180e6 * RAD_PER_UDEG));
        putc('\n', out);
    }
    free_rows(&r);
    return rc;
}
