#include "proto/astm.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/lines.h"
#include "proto/number.h"
#include "proto/units.h"

#define COLUMNS_MAX 512
#define THETA_MAX_RAD 1.5708 /* pi/2, rounded up as files are */
#define PHI_MAX_RAD 6.2832

enum angle { THETA_I, PHI_I, THETA_S, PHI_S, ANGLES };
static const char *const angle_names[ANGLES] = {"theta_i", "phi_i", "theta_s", "phi_s"};

/* What goniod's own export says of its azimuths. */
static const char mirror_note[] = "phi_s = pi on the mirror side";

struct layout {
    int n_names, n_columns; /* named by VARS; of a row */
    int angle[ANGLES];      /* column, -1 = there is none */
    int channel[COLUMNS_MAX];
    double lambda_nm[COLUMNS_MAX];
    int n_channels;
    bool settled; /* the first row has been seen */
};

struct reading {
    struct lines lines;
    struct layout layout;
    struct brdf *brdf;
    double value[COLUMNS_MAX];
    int column[COLUMNS_MAX];
    double stated_points;
    struct err_list *errors;
};

/* The number directly before a final "nm", or NaN. */
static double wavelength_of(const char *name) {
    char digits[64];
    double nm = NAN;
    size_t n = strlen(name);
    if (n < 3 || strcmp(name + n - 2, "nm") != 0)
        return NAN;
    size_t from = n - 2;
    while (from > 0 && strchr("0123456789.", name[from - 1]))
        from--;
    snprintf(digits, sizeof digits, "%.*s", (int)(n - 2 - from), name + from);
    return number_read_double(digits, &nm) && nm >= 100 && nm <= 5000 ? nm : NAN;
}

static int take_name(struct reading *r, const char *name, int column) {
    struct layout *l = &r->layout;
    for (int a = 0; a < ANGLES; a++) {
        if (strcmp(name, angle_names[a]) != 0)
            continue;
        if (l->angle[a] >= 0)
            return lines_error(&r->lines, column, r->errors, "VARS names %s twice", name);
        l->angle[a] = l->n_names++;
        return 0;
    }
    l->lambda_nm[l->n_channels] = wavelength_of(name);
    l->channel[l->n_channels++] = l->n_names++;
    return 0;
}

/* Names stand between commas, or where there are none between blanks. */
static int take_names(struct reading *r, const char *text, size_t size) {
    const char *separators = memchr(text, ',', size) ? "," : " \t";
    int status = 0;
    for (size_t at = 0; at < size;) {
        char name[64];
        size_t to = at;
        while (to < size && !strchr(separators, text[to]))
            to++;
        size_t from = at, last = to;
        while (from < last && strchr(" \t", text[from]))
            from++;
        while (last > from && strchr(" \t", text[last - 1]))
            last--;
        int column = (int)(text + from - r->lines.text) + 1;
        if (r->layout.n_names == COLUMNS_MAX)
            return lines_error(&r->lines, column, r->errors, "VARS names more than %d variables",
                               COLUMNS_MAX);
        snprintf(name, sizeof name, "%.*s", (int)(last - from), text + from);
        int rc = last > from ? take_name(r, name, column) : 0;
        status = status ? status : rc;
        at = to + 1;
    }
    return status;
}

static int check_names(struct reading *r) {
    const struct layout *l = &r->layout;
    for (int a = THETA_I; a <= THETA_S; a += THETA_S)
        if (l->angle[a] < 0)
            return lines_error(&r->lines, 1, r->errors, "VARS does not name %s", angle_names[a]);
    if (l->n_channels == 0)
        return lines_error(&r->lines, 1, r->errors, "VARS names angles, but no value measured at them");
    return 0;
}

static int read_keys(struct reading *r) {
    const char *rest;
    size_t size;
    while (lines_next(&r->lines)) {
        if (lines_keyword(&r->lines, "VARS", &rest, &size)) {
            int rc = take_names(r, rest, size);
            return rc ? rc : check_names(r);
        }
        if (lines_keyword(&r->lines, "NUM_POINTS", &rest, &size)) {
            char number[32];
            snprintf(number, sizeof number, "%.*s", (int)(size < 31 ? size : 31), rest);
            number[strcspn(number, " \t")] = '\0';
            number_read_double(number, &r->stated_points);
        }
        if (lines_keyword(&r->lines, "UNITS", &rest, &size))
            r->brdf->azimuth_stated = memmem(rest, size, mirror_note, strlen(mirror_note)) != NULL;
    }
    return lines_error(&r->lines, 0, r->errors, "no line VARS names the columns; is this an .astm file?");
}

static void insert_column(struct layout *l, int at) {
    for (int a = 0; a < ANGLES; a++)
        l->angle[a] += l->angle[a] >= at;
    for (int k = 0; k < l->n_channels; k++)
        l->channel[k] += l->channel[k] >= at;
}

/* What the columns are that VARS does not name (astm.h). */
static void settle_layout(struct reading *r, int n_columns) {
    static const enum angle phis[] = {PHI_S, PHI_I};
    struct layout *l = &r->layout;
    int spare = n_columns - l->n_names;
    for (int i = 0; i < 2; i++) {
        enum angle phi = phis[i];
        if (l->angle[phi] >= 0)
            continue;
        if (spare > 0) {
            int at = l->angle[phi - 1] + 1;
            insert_column(l, at);
            l->angle[phi] = at;
            spare--;
            brdf_note(r->brdf, "column %d, which VARS does not name, is taken for %s", at + 1,
                      angle_names[phi]);
        } else {
            brdf_note(r->brdf, "VARS names no %s and the rows have no column for it: taken as 0",
                      angle_names[phi]);
        }
    }
    if (spare > 0)
        brdf_note(r->brdf, "the last %d of %d columns, which VARS does not name, are not read", spare,
                  n_columns);
    l->n_columns = n_columns;
    l->settled = true;
}

static int take_angles(struct reading *r, double angle_rad[ANGLES]) {
    int status = 0;
    for (int a = 0; a < ANGLES; a++) {
        int column = r->layout.angle[a];
        double limit = a == THETA_I || a == THETA_S ? THETA_MAX_RAD : PHI_MAX_RAD;
        angle_rad[a] = column >= 0 ? r->value[column] : 0;
        if (fabs(angle_rad[a]) > limit)
            status = lines_error(&r->lines, r->column[column], r->errors,
                                 "%s is %g; it must be within %g, angles here are radians", angle_names[a],
                                 angle_rad[a], limit);
    }
    return status;
}

static int take_values(struct reading *r) {
    struct brdf *b = r->brdf;
    int status = 0;
    for (int k = 0; k < r->layout.n_channels; k++) {
        int column = r->layout.channel[k];
        if (fabs(r->value[column]) > 1e6)
            status = lines_error(&r->lines, r->column[column], r->errors,
                                 "a value in 1/sr is %g; it must be within 1e6", r->value[column]);
        b->beta[(b->n - 1) * b->n_lambda + (size_t)k] = M_PI * r->value[column];
    }
    return status;
}

static int take_row(struct reading *r) {
    struct layout *l = &r->layout;
    double rad[ANGLES];
    struct err e = {0};
    int n = lines_numbers(&r->lines, r->value, r->column, COLUMNS_MAX, r->errors);
    if (n < 0)
        return n;
    if (n > COLUMNS_MAX || n < l->n_names)
        return lines_error(&r->lines, 1, r->errors, "%d columns, but VARS names %d", n, l->n_names);
    if (!l->settled)
        settle_layout(r, n);
    if (n != l->n_columns)
        return lines_error(&r->lines, 1, r->errors, "%d columns, but the first row has %d", n, l->n_columns);
    int rc = take_angles(r, rad);
    if (rc == 0 && brdf_add(r->brdf, deg_from_rad(rad[THETA_I]), deg_from_rad(rad[PHI_I]),
                            deg_from_rad(rad[THETA_S]), deg_from_rad(rad[PHI_S]), &e) != 0) {
        err_list_add(r->errors, &e);
        rc = -e.code;
    }
    return rc ? rc : take_values(r);
}

static int read_rows(struct reading *r) {
    int status = 0;
    struct brdf *b = r->brdf;
    b->n_lambda = (size_t)r->layout.n_channels;
    b->lambda_nm = calloc(b->n_lambda, sizeof *b->lambda_nm);
    if (!b->lambda_nm)
        return lines_error(&r->lines, 0, r->errors, "no memory left to read this file");
    memcpy(b->lambda_nm, r->layout.lambda_nm, b->n_lambda * sizeof *b->lambda_nm);
    while (status != -ERR_NOMEM && lines_next(&r->lines)) {
        int rc = lines_blank(&r->lines) ? 0 : take_row(r);
        status = rc ? rc : status;
    }
    if (status == 0 && b->n == 0)
        status = lines_error(&r->lines, 0, r->errors, "no row follows the line VARS");
    if (status == 0 && r->stated_points != (double)b->n)
        brdf_note(b, "NUM_POINTS says %.10g, but the rows are %zu", r->stated_points, b->n);
    return status;
}

int astm_read_text(const char *file, const char *text, size_t size, struct brdf *brdf,
                   struct err_list *errors) {
    memset(brdf, 0, sizeof *brdf);
    struct reading *r = calloc(1, sizeof *r);
    if (!r)
        return -ERR_NOMEM;
    memset(r->layout.angle, 0xff, sizeof r->layout.angle); /* -1: none */
    r->brdf = brdf;
    r->errors = errors;
    int rc = lines_begin(&r->lines, file, text, size, errors);
    if (rc == 0)
        rc = read_keys(r);
    if (rc == 0)
        rc = read_rows(r);
    if (rc != 0)
        brdf_free(brdf);
    free(r);
    return rc;
}
