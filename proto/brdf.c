#include "proto/brdf.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/file.h"
#include "proto/number.h"
#include "proto/units.h"

#define WAVELENGTHS_MAX 4096
#define ANGLES 4 /* theta_i phi_i theta_s phi_s */

/* The numbers of a text one after another, with the place of the last one. */
struct numbers {
    const char *file, *at, *end, *line_start;
    int line, column;
};

static void skip_blank(struct numbers *s) {
    while (s->at < s->end) {
        if (*s->at == '\n') {
            s->line++;
            s->line_start = s->at + 1;
        } else if (*s->at == '#') {
            const char *newline = memchr(s->at, '\n', (size_t)(s->end - s->at));
            s->at = newline ? newline : s->end;
            continue;
        } else if (!strchr(" \t\r", *s->at)) {
            return;
        }
        s->at++;
    }
}

/* 1 a number, 0 the end, else -ERR_INPUT. */
static int next_number(struct numbers *s, double *value, struct err *e) {
    char token[64];
    skip_blank(s);
    if (s->at == s->end)
        return 0;
    s->column = (int)(s->at - s->line_start) + 1;
    size_t size = 0;
    while (s->at + size < s->end && !strchr(" \t\r\n#", s->at[size]) && size < sizeof token - 1)
        size++;
    memcpy(token, s->at, size);
    token[size] = '\0';
    s->at += size;
    if (!number_read_double(token, value))
        return err_at(e, ERR_INPUT, s->file, s->line, s->column, "'%.40s' is no number", token);
    return 1;
}

static int need_number(struct numbers *s, const char *what, double low, double high, double *value,
                       struct err *e) {
    int rc = next_number(s, value, e);
    if (rc == 0)
        return err_at(e, ERR_INPUT, s->file, s->line, 0, "the file ends where %s should follow", what);
    if (rc < 0)
        return rc;
    if (*value < low || *value > high)
        return err_at(e, ERR_INPUT, s->file, s->line, s->column, "%s is %g; it must be from %g to %g", what,
                      *value, low, high);
    return 0;
}

static int read_wavelengths(struct numbers *s, struct brdf *b, struct err *e) {
    double n;
    int rc = need_number(s, "the number of wavelengths", 1, WAVELENGTHS_MAX, &n, e);
    if (rc != 0)
        return rc;
    if (n != floor(n))
        return err_at(e, ERR_INPUT, s->file, s->line, s->column,
                      "the number of wavelengths is %g; it must be whole", n);
    b->n_lambda = (size_t)n;
    b->lambda_nm = calloc(b->n_lambda, sizeof *b->lambda_nm);
    if (!b->lambda_nm)
        return err_set(e, ERR_NOMEM, "no memory left to read %s", s->file);
    for (size_t k = 0; k < b->n_lambda; k++) {
        rc = need_number(s, "a wavelength in nm", 100, 5000, &b->lambda_nm[k], e);
        if (rc != 0)
            return rc;
        if (k > 0 && b->lambda_nm[k] <= b->lambda_nm[k - 1])
            return err_at(e, ERR_INPUT, s->file, s->line, s->column,
                          "the wavelengths must ascend; %g follows on %g nm", b->lambda_nm[k],
                          b->lambda_nm[k - 1]);
    }
    return 0;
}

static void set_side(struct brdf_geometry *g) {
    bool forward = g->delta_phi_deg >= 180 - BRDF_PLANE_DEG, backward = g->delta_phi_deg <= BRDF_PLANE_DEG;
    g->in_plane = forward || backward || g->theta_i_deg == 0 || g->theta_s_deg == 0;
    g->theta_v_deg = g->delta_phi_deg > 90 ? g->theta_s_deg : -g->theta_s_deg;
    if (!g->in_plane)
        g->theta_v_deg = NAN;
}

static struct brdf_geometry geometry_of(double theta_i_deg, double phi_i_deg, double theta_s_deg,
                                        double phi_s_deg) {
    struct brdf_geometry g = {.theta_i_deg = fmin(90, fabs(theta_i_deg)),
                              .theta_s_deg = fmin(90, fabs(theta_s_deg))};
    double turn = (theta_i_deg < 0) != (theta_s_deg < 0) ? 180 : 0;
    g.delta_phi_deg = fabs(remainder(phi_s_deg - phi_i_deg + turn, 360));
    set_side(&g);
    return g;
}

static int grow(struct brdf *b, struct err *e) {
    size_t wanted = b->capacity ? 2 * b->capacity : 64;
    struct brdf_geometry *geometry = realloc(b->geometry, wanted * sizeof *geometry);
    if (geometry)
        b->geometry = geometry;
    double *beta = realloc(b->beta, wanted * b->n_lambda * sizeof *beta);
    if (beta)
        b->beta = beta;
    double *u = b->u ? realloc(b->u, wanted * b->n_lambda * sizeof *u) : NULL;
    if (u)
        b->u = u;
    if (!geometry || !beta || (b->u && !u))
        return err_set(e, ERR_NOMEM, "no memory left for a measured surface of %zu geometries", wanted);
    b->capacity = wanted;
    return 0;
}

int brdf_add(struct brdf *b, double theta_i_deg, double phi_i_deg, double theta_s_deg, double phi_s_deg,
             struct err *e) {
    int rc = b->n < b->capacity ? 0 : grow(b, e);
    if (rc != 0)
        return rc;
    b->geometry[b->n] = geometry_of(theta_i_deg, phi_i_deg, theta_s_deg, phi_s_deg);
    for (size_t k = b->n * b->n_lambda; k < (b->n + 1) * b->n_lambda; k++) {
        b->beta[k] = NAN;
        if (b->u)
            b->u[k] = NAN;
    }
    b->n++;
    return 0;
}

void brdf_note(struct brdf *b, const char *format, ...) {
    va_list arguments;
    if (b->n_notes == BRDF_NOTES_MAX)
        return;
    va_start(arguments, format);
    vsnprintf(b->note[b->n_notes++], sizeof b->note[0], format, arguments);
    va_end(arguments);
}

void brdf_turn(struct brdf *b) {
    for (size_t i = 0; i < b->n; i++) {
        b->geometry[i].delta_phi_deg = 180 - b->geometry[i].delta_phi_deg;
        set_side(&b->geometry[i]);
    }
}

/* 1 a geometry was read, 0 the end, else an error. */
static int read_geometry(struct numbers *s, struct brdf *b, struct err *e) {
    static const char *const what[ANGLES] = {"theta_i", "phi_i", "theta_s", "phi_s"};
    static const double high[ANGLES] = {1.5708, 6.2832, 1.5708, 6.2832}; /* rad, rounded up as files are */
    double angle[ANGLES];
    skip_blank(s);
    if (s->at == s->end)
        return 0;
    for (int k = 0; k < ANGLES; k++) {
        int rc = need_number(s, what[k], k % 2 == 0 ? 0 : -high[k], high[k], &angle[k], e);
        if (rc != 0)
            return rc;
    }
    int rc = brdf_add(b, deg_from_rad(angle[0]), deg_from_rad(angle[1]), deg_from_rad(angle[2]),
                      deg_from_rad(angle[3]), e);
    for (size_t k = 0; rc == 0 && k < b->n_lambda; k++) {
        double f = NAN;
        rc = need_number(s, "a value in 1/sr", -1e6, 1e6, &f, e);
        b->beta[(b->n - 1) * b->n_lambda + k] = M_PI * f;
    }
    return rc ? rc : 1;
}

static int read_all(struct numbers *s, struct brdf *b, struct err *e) {
    int rc = read_wavelengths(s, b, e);
    if (rc != 0)
        return rc;
    do {
        rc = read_geometry(s, b, e);
    } while (rc == 1);
    if (rc == 0 && b->n == 0)
        return err_at(e, ERR_INPUT, s->file, s->line, 0, "the file holds wavelengths but no geometry");
    return rc;
}

int brdf_read_text(const char *file, const char *text, size_t size, struct brdf *brdf, struct err *e) {
    memset(brdf, 0, sizeof *brdf);
    int rc = file_check_text(file, text, size, e);
    if (rc != 0)
        return rc;
    struct numbers s = {.file = file, .at = text, .end = text + size, .line_start = text, .line = 1};
    rc = read_all(&s, brdf, e);
    if (rc != 0)
        brdf_free(brdf);
    return rc;
}

int brdf_read_file(const char *path, struct brdf *brdf, struct err *e) {
    char *text = NULL;
    size_t size = 0;
    memset(brdf, 0, sizeof *brdf);
    int rc = file_read(path, BRDF_BYTES_MAX, &text, &size, e);
    if (rc != 0)
        return rc;
    rc = brdf_read_text(path, text, size, brdf, e);
    free(text);
    return rc;
}

void brdf_free(struct brdf *brdf) {
    free(brdf->lambda_nm);
    free(brdf->geometry);
    free(brdf->beta);
    free(brdf->u);
    memset(brdf, 0, sizeof *brdf);
}
