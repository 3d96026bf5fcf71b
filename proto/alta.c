#include "proto/alta.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/lines.h"
#include "proto/units.h"

#define INPUTS_MAX 6
#define OUTPUTS_MAX 64
#define COLUMNS_MAX (INPUTS_MAX + 3 * OUTPUTS_MAX)

struct pair { /* unit vectors to sensor and source; z is the normal */
    double view[3], light[3];
};

static void direct(double theta, double phi, double *to) {
    to[0] = sin(theta) * cos(phi);
    to[1] = sin(theta) * sin(phi);
    to[2] = cos(theta);
}

/* A direction drawn as its polar angle along an azimuth. */
static void project(double x, double y, double *to) {
    direct(hypot(x, y), atan2(y, x), to);
}

/* Half vector and difference angles: the difference direction is turned to the half vector, the light is the view
 * reflected about it (Rusinkiewicz 1998). */
static void half(double theta_h, double phi_h, double theta_d, double phi_d, struct pair *p) {
    double h[3], d[3];
    direct(theta_h, phi_h, h);
    direct(theta_d, phi_d, d);
    double x = d[0] * cos(theta_h) + d[2] * sin(theta_h), z = d[2] * cos(theta_h) - d[0] * sin(theta_h);
    p->view[0] = x * cos(phi_h) - d[1] * sin(phi_h);
    p->view[1] = x * sin(phi_h) + d[1] * cos(phi_h);
    p->view[2] = z;
    for (int k = 0; k < 3; k++)
        p->light[k] = 2 * cos(theta_d) * h[k] - p->view[k];
}

static void from_cartesian(const double *x, struct pair *p) {
    memcpy(p->view, x, sizeof p->view);
    memcpy(p->light, x + 3, sizeof p->light);
}

static void from_spherical(const double *x, struct pair *p) {
    direct(x[0], x[1], p->light);
    direct(x[2], x[3], p->view);
}

static void from_isotropic(const double *x, struct pair *p) {
    direct(x[0], 0, p->view);
    direct(x[1], x[2], p->light);
}

static void from_projected(const double *x, struct pair *p) {
    direct(x[0], 0, p->light);
    project(x[1], x[2], p->view);
}

static void from_normal_light(const double *x, struct pair *p) {
    direct(0, 0, p->light);
    project(x[0], x[1], p->view);
}

static void from_half_isotropic(const double *x, struct pair *p) {
    half(x[0], 0, x[1], x[2], p);
}

static void from_half(const double *x, struct pair *p) {
    half(x[0], x[1], x[2], x[3], p);
}

static const struct parametrisation {
    const char *name;
    int dimension;
    void (*directions)(const double *x, struct pair *p);
} parametrisations[] = {{"SPHERICAL_TL_PL_TV_PV", 4, from_spherical},
                        {"ISOTROPIC_TV_TL_DPHI", 3, from_isotropic},
                        {"ISOTROPIC_TL_TV_PROJ_DPHI", 3, from_projected},
                        {"ISOTROPIC_TV_PROJ_DPHI", 2, from_normal_light},
                        {"RUSIN_TH_TD_PD", 3, from_half_isotropic},
                        {"RUSIN_TH_PH_TD_PD", 4, from_half},
                        {"CARTESIAN", 6, from_cartesian}};

const char *alta_parametrisations(void) {
    return "SPHERICAL_TL_PL_TV_PV, ISOTROPIC_TV_TL_DPHI, ISOTROPIC_TL_TV_PROJ_DPHI, ISOTROPIC_TV_PROJ_DPHI, "
           "RUSIN_TH_TD_PD, RUSIN_TH_PH_TD_PD, CARTESIAN";
}

struct reading {
    struct lines lines;
    const struct parametrisation *in;
    int n_in, n_out; /* 0 = not stated yet */
    bool has_out;
    int interval; /* columns of the interval: 0, 1 or 2, for the first output or for each */
    size_t under; /* rows with a direction under the surface */
    struct brdf *brdf;
    struct err_list *errors;
};

static int take_dim(struct reading *r, const char *text) {
    int n_in, n_out;
    if (sscanf(text, "%d %d", &n_in, &n_out) != 2 || n_in < 1 || n_in > INPUTS_MAX || n_out < 1 ||
        n_out > OUTPUTS_MAX)
        return lines_error(&r->lines, 1, r->errors,
                           "#DIM must give the numbers of input (1 to %d) and output columns (1 to %d)",
                           INPUTS_MAX, OUTPUTS_MAX);
    r->n_in = n_in;
    r->n_out = n_out;
    return 0;
}

static int take_in(struct reading *r, const char *name) {
    for (size_t i = 0; i < sizeof parametrisations / sizeof *parametrisations; i++)
        if (strcmp(parametrisations[i].name, name) == 0) {
            r->in = &parametrisations[i];
            return 0;
        }
    return lines_error(&r->lines, 1, r->errors,
                       "the parametrisation %.40s is not read; convert the file with ALTA to one of %s", name,
                       alta_parametrisations());
}

static int take_out(struct reading *r, const char *name) {
    r->has_out = strcmp(name, "INV_STERADIAN") == 0 || strcmp(name, "RGB_COLOR") == 0;
    return r->has_out
               ? 0
               : lines_error(&r->lines, 1, r->errors,
                             "values of the kind %.40s are not read; INV_STERADIAN and RGB_COLOR (1/sr) are",
                             name);
}

static int take_interval(struct reading *r, const char *text) {
    int interval;
    if (sscanf(text, "%d", &interval) != 1 || interval < 0 || interval > 2)
        return lines_error(&r->lines, 1, r->errors, "#VS is 0, 1 or 2, not '%.20s'", text);
    r->interval = interval;
    return 0;
}

static int refuse_binary(struct reading *r, const char *text) {
    return strcmp(text, "binary") == 0
               ? lines_error(&r->lines, 1, r->errors, "this is ALTA's binary form; save it as text")
               : 0;
}

static int take_header(struct reading *r) {
    static const struct {
        const char *key;
        int (*take)(struct reading *r, const char *text);
    } keys[] = {{"#DIM", take_dim},
                {"#PARAM_IN", take_in},
                {"#PARAM_OUT", take_out},
                {"#VS", take_interval},
                {"#FORMAT", refuse_binary}};
    const char *rest;
    size_t size;
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        if (lines_keyword(&r->lines, keys[i].key, &rest, &size)) {
            char text[128];
            snprintf(text, sizeof text, "%.*s", (int)(size < 127 ? size : 127), rest);
            for (size_t n = strlen(text); n > 0 && strchr(" \t", text[n - 1]);)
                text[--n] = '\0';
            return keys[i].take(r, text);
        }
    return 0;
}

/* Before the first row: is everything known that its columns need? */
static int begin_rows(struct reading *r) {
    struct brdf *b = r->brdf;
    if (r->n_in == 0 || !r->in || !r->has_out)
        return lines_error(&r->lines, 1, r->errors, "a row before %s is stated",
                           r->n_in == 0 ? "#DIM"
                           : r->in      ? "#PARAM_OUT"
                                        : "#PARAM_IN");
    if (r->n_in != r->in->dimension)
        return lines_error(&r->lines, 1, r->errors, "#DIM states %d input columns, but %s has %d", r->n_in,
                           r->in->name, r->in->dimension);
    b->n_lambda = (size_t)r->n_out;
    b->lambda_nm = calloc(b->n_lambda, sizeof *b->lambda_nm);
    b->u = r->interval ? calloc(1, sizeof *b->u) : NULL;
    if (!b->lambda_nm || (r->interval && !b->u))
        return lines_error(&r->lines, 0, r->errors, "no memory left to read this file");
    for (size_t k = 0; k < b->n_lambda; k++)
        b->lambda_nm[k] = NAN;
    if (r->interval)
        brdf_note(b, "the interval of #VS is taken as one standard uncertainty to either side");
    return 0;
}

static int take_values(struct reading *r, const double *value, const int *column, int n) {
    struct brdf *b = r->brdf;
    const double *dt = value + r->n_in + r->n_out;
    int with_u = r->interval ? (n - r->n_in - r->n_out) / r->interval : 0;
    for (int k = 0; k < r->n_out; k++) {
        size_t at = (b->n - 1) * b->n_lambda + (size_t)k;
        double f = value[r->n_in + k];
        if (fabs(f) > 1e6)
            return lines_error(&r->lines, column[r->n_in + k], r->errors,
                               "a value in 1/sr is %g; it must be within 1e6", f);
        b->beta[at] = M_PI * f;
        if (k < with_u)
            b->u[at] = M_PI * (r->interval == 1 ? fabs(dt[k]) : fabs(dt[2 * k + 1] - dt[2 * k]) / 2);
    }
    return 0;
}

static int add_geometry(struct reading *r, const struct pair *p) {
    struct err e = {0};
    const double *l = p->light, *v = p->view;
    if (brdf_add(r->brdf, deg_from_rad(atan2(hypot(l[0], l[1]), l[2])), deg_from_rad(atan2(l[1], l[0])),
                 deg_from_rad(atan2(hypot(v[0], v[1]), v[2])), deg_from_rad(atan2(v[1], v[0])), &e) != 0) {
        err_list_add(r->errors, &e);
        return -e.code;
    }
    return 0;
}

static int check_inputs(struct reading *r, const double *value, const int *column) {
    for (int i = 0; i < r->n_in; i++)
        if (fabs(value[i]) > 6.2832)
            return lines_error(&r->lines, column[i], r->errors,
                               "%g is no angle in radians, nor a part of a unit vector", value[i]);
    return 0;
}

static int take_row(struct reading *r) {
    double value[COLUMNS_MAX];
    int column[COLUMNS_MAX];
    int rc = r->brdf->lambda_nm ? 0 : begin_rows(r);
    if (rc != 0)
        return rc;
    int n = lines_numbers(&r->lines, value, column, COLUMNS_MAX, r->errors);
    if (n < 0)
        return n;
    int plain = r->n_in + r->n_out;
    if (n != plain + r->interval && n != plain + r->interval * r->n_out)
        return lines_error(&r->lines, 1, r->errors, "%d columns; #DIM and #VS make it %d", n,
                           plain + r->interval);
    struct pair p;
    if ((rc = check_inputs(r, value, column)) != 0)
        return rc;
    r->in->directions(value, &p);
    if (p.view[2] < 0 || p.light[2] < 0) {
        r->under++;
        return 0;
    }
    rc = add_geometry(r, &p);
    return rc ? rc : take_values(r, value, column, n);
}

static int read_all(struct reading *r) {
    int status = 0;
    while (status != -ERR_NOMEM && lines_next(&r->lines)) {
        bool comment = r->lines.size > 0 && r->lines.text[0] == '#';
        bool header = comment && !r->brdf->lambda_nm; /* what follows on a row no longer rules */
        int rc = header ? take_header(r) : comment || lines_blank(&r->lines) ? 0 : take_row(r);
        status = rc ? rc : status;
        if (rc && !header && !r->brdf->lambda_nm)
            return status; /* without its header no row can be judged */
    }
    if (status == 0 && r->brdf->n == 0)
        status = lines_error(&r->lines, 0, r->errors, "no row with both directions over the surface");
    if (r->under)
        brdf_note(r->brdf, "%zu rows with a direction under the surface were left out", r->under);
    return status;
}

int alta_read_text(const char *file, const char *text, size_t size, struct brdf *brdf,
                   struct err_list *errors) {
    struct reading r = {.brdf = brdf, .errors = errors};
    memset(brdf, 0, sizeof *brdf);
    brdf->azimuth_stated = true; /* ALTA's azimuths are those of directions */
    int rc = lines_begin(&r.lines, file, text, size, errors);
    if (rc == 0)
        rc = read_all(&r);
    if (rc != 0)
        brdf_free(brdf);
    return rc;
}
