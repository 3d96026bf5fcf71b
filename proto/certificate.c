#include "proto/certificate.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/csv.h"
#include "proto/number.h"
#include "proto/yaml.h"

enum { LAMBDA, BETA, U, THETA_I, THETA_V, COLUMNS };

static const char *const column_names[] = {"lambda_nm", "beta", "u", "theta_i_deg", "theta_v_deg", NULL};
static const char *const note_names[] = {"geometry",       "k", "serial", "date", "valid_until",
                                         "correlation_nm", NULL};

struct reading {
    const struct csv *csv;
    struct certificate *c;
    double k;
    struct err_list *errors;
};

static const struct csv_cell *note(const struct reading *r, const char *key) {
    const struct csv_note *found = csv_note_find(r->csv, key);
    return found ? &found->value : NULL;
}

static int read_angles(struct reading *r, const struct csv_cell *value) {
    char first[32];
    const char *colon = strchr(value->text, ':');
    if (!colon || (size_t)(colon - value->text) >= sizeof first)
        return -ERR_INPUT;
    snprintf(first, sizeof first, "%.*s", (int)(colon - value->text), value->text);
    if (!number_read_double(first, &r->c->theta_i_deg) || !number_read_double(colon + 1, &r->c->theta_v_deg))
        return -ERR_INPUT;
    return r->c->theta_i_deg >= 0 && r->c->theta_i_deg < 90 && fabs(r->c->theta_v_deg) < 90 ? 0 : -ERR_INPUT;
}

static int read_geometry(struct reading *r) {
    const struct csv_cell *value = note(r, "geometry");
    if (!value)
        return csv_error(r->csv, NULL, r->errors,
                         "the line '# geometry:' is missing; write 45:0 (theta_i:theta_v), 8:di or in-plane "
                         "table");
    r->c->geometry = CERTIFICATE_ONE;
    if (strcmp(value->text, "8:di") == 0)
        r->c->geometry = CERTIFICATE_8DI;
    else if (strcmp(value->text, "in-plane table") == 0)
        r->c->geometry = CERTIFICATE_TABLE;
    else if (read_angles(r, value) != 0)
        return csv_error(r->csv, value, r->errors,
                         "geometry must be theta_i:theta_v in degrees (as 45:0), 8:di or in-plane table, not "
                         "'%.40s'",
                         value->text);
    return 0;
}

static bool is_date(const char *text) {
    static const int days[] = {31, 29, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
    int year, month, day, used = 0;
    if (strlen(text) != 10 || sscanf(text, "%4d-%2d-%2d%n", &year, &month, &day, &used) != 3 || used != 10)
        return false;
    if (strspn(text, "0123456789-") != 10 || month < 1 || month > 12 || day < 1 || day > days[month - 1])
        return false;
    bool leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
    return month != 2 || day < 29 || leap;
}

static int read_date(struct reading *r, const char *key, char *date, size_t size) {
    const struct csv_cell *value = note(r, key);
    if (!value)
        return 0;
    if (!is_date(value->text))
        return csv_error(r->csv, value, r->errors, "%s must be a date written YYYY-MM-DD, not '%.40s'", key,
                         value->text);
    snprintf(date, size, "%s", value->text);
    return 0;
}

static int check_notes(struct reading *r) {
    int rc = 0;
    for (size_t i = 0; i < r->csv->n_notes; i++) {
        const struct csv_note *n = &r->csv->note[i];
        int known = 0;
        while (note_names[known] && strcmp(note_names[known], n->key) != 0)
            known++;
        /* Free remarks may hold a colon; only a slip of the pen in a known word is a mistake. */
        const char *near = note_names[known] ? NULL : yaml_nearest(n->key, note_names);
        if (near)
            rc = csv_error(r->csv, &n->value, r->errors, "unknown heading '%.40s'; did you mean '%s'?",
                           n->key, near);
        else if (note_names[known] && csv_note_find(r->csv, n->key) != n)
            rc =
                csv_error(r->csv, &n->value, r->errors, "the heading '%s' stands here a second time", n->key);
    }
    return rc;
}

static int read_notes(struct reading *r) {
    struct certificate *c = r->c;
    const struct csv_cell *k = note(r, "k"), *serial = note(r, "serial");
    const struct csv_cell *correlation = note(r, "correlation_nm");
    int rc = check_notes(r) | read_geometry(r);
    rc |= read_date(r, "date", c->date, sizeof c->date);
    rc |= read_date(r, "valid_until", c->valid_until, sizeof c->valid_until);
    if (!k)
        rc |= csv_error(r->csv, NULL, r->errors,
                        "the line '# k:' is missing; write 1 if u is a standard uncertainty");
    else
        rc |= csv_number(r->csv, k, "k", 0.1, 10, &r->k, r->errors);
    if (correlation)
        rc |= csv_number(r->csv, correlation, "correlation_nm", 1e-3, 1e6, &c->correlation_nm, r->errors);
    if (serial && strlen(serial->text) >= sizeof c->serial)
        rc |= csv_error(r->csv, serial, r->errors, "serial is longer than %zu bytes", sizeof c->serial - 1);
    else if (serial)
        strcpy(c->serial, serial->text);
    if (c->date[0] && c->valid_until[0] && strcmp(c->valid_until, c->date) < 0)
        rc |= csv_error(r->csv, note(r, "valid_until"), r->errors, "valid_until lies before date");
    return rc == 0 ? 0 : -ERR_INPUT;
}

static int read_row(struct reading *r, const int *column, size_t i) {
    static const struct {
        double low, high;
    } range[COLUMNS] = {
        [LAMBDA] = {100, 5000}, [BETA] = {0, 10}, [U] = {0, 10}, [THETA_I] = {0, 90}, [THETA_V] = {-90, 90}};
    struct certificate_row *row = &r->c->row[i];
    double *target[COLUMNS] = {&row->lambda_nm, &row->beta, &row->u, &row->theta_i_deg, &row->theta_v_deg};
    row->theta_i_deg = r->c->theta_i_deg;
    row->theta_v_deg = r->c->theta_v_deg;
    int rc = 0;
    for (int k = 0; k < COLUMNS; k++)
        if (column[k] >= 0)
            rc |= csv_number(r->csv, &r->csv->cell[i * r->csv->n_columns + (size_t)column[k]],
                             column_names[k], range[k].low, range[k].high, target[k], r->errors);
    row->u /= r->k;
    return rc;
}

static int by_angles_and_wavelength(const void *a, const void *b) {
    const struct certificate_row *x = a, *y = b;
    const double left[] = {x->theta_i_deg, x->theta_v_deg, x->lambda_nm};
    const double right[] = {y->theta_i_deg, y->theta_v_deg, y->lambda_nm};
    for (int i = 0; i < 3; i++)
        if (left[i] != right[i])
            return left[i] < right[i] ? -1 : 1;
    return 0;
}

static int read_rows(struct reading *r) {
    int column[COLUMNS], rc = 0;
    bool table = r->c->geometry == CERTIFICATE_TABLE;
    if (csv_columns(r->csv, column_names, table ? COLUMNS : THETA_I, column, r->errors) != 0)
        return -ERR_INPUT;
    if (!table && (column[THETA_I] >= 0 || column[THETA_V] >= 0))
        return csv_error(r->csv, &r->csv->name[0], r->errors,
                         "columns of angles belong to '# geometry: in-plane table'");
    r->c->row = calloc(r->csv->n_rows, sizeof *r->c->row);
    if (!r->c->row)
        return csv_error(r->csv, NULL, r->errors, "no memory left to read this file");
    r->c->n = r->csv->n_rows;
    for (size_t i = 0; i < r->c->n; i++)
        rc |= read_row(r, column, i);
    if (rc != 0)
        return -ERR_INPUT;
    qsort(r->c->row, r->c->n, sizeof *r->c->row, by_angles_and_wavelength);
    for (size_t i = 1; i < r->c->n; i++)
        if (by_angles_and_wavelength(&r->c->row[i - 1], &r->c->row[i]) == 0)
            rc = csv_error(r->csv, NULL, r->errors,
                           "%g nm at theta_i %g, theta_v %g deg is given more than once",
                           r->c->row[i].lambda_nm, r->c->row[i].theta_i_deg, r->c->row[i].theta_v_deg);
    return rc;
}

int certificate_read_text(const char *file, const char *text, size_t size, struct certificate *c,
                          struct err_list *errors) {
    struct csv csv;
    memset(c, 0, sizeof *c);
    int rc = csv_parse(file, text, size, &csv, errors);
    if (rc != 0)
        return rc;
    struct reading r = {.csv = &csv, .c = c, .k = 1, .errors = errors};
    int notes = read_notes(&r), rows = read_rows(&r);
    c->text = strndup(text, size);
    if (!c->text)
        rc = csv_error(&csv, NULL, errors, "no memory left to read this file");
    csv_free(&csv);
    if (notes != 0 || rows != 0 || rc != 0) {
        certificate_free(c);
        return -ERR_INPUT;
    }
    return 0;
}

void certificate_free(struct certificate *c) {
    free(c->row);
    free(c->text);
    memset(c, 0, sizeof *c);
}

/* Rows first..end-1 of the table share what is being looked at: an incidence, or a whole geometry. */
struct span {
    size_t first, end;
};

static struct span span_of(const struct certificate *c, size_t first, size_t end, bool whole_geometry) {
    const struct certificate_row *row = c->row;
    struct span s = {first, first};
    while (s.end < end && row[s.end].theta_i_deg == row[first].theta_i_deg &&
           (!whole_geometry || row[s.end].theta_v_deg == row[first].theta_v_deg))
        s.end++;
    return s;
}

/* Values of one geometry at one wavelength; false outside its wavelengths. */
static bool at_wavelength(const struct certificate *c, struct span s, double nm, double *beta, double *u) {
    const struct certificate_row *row = c->row;
    if (nm < row[s.first].lambda_nm || nm > row[s.end - 1].lambda_nm)
        return false;
    size_t right = s.first;
    while (row[right].lambda_nm < nm)
        right++;
    *beta = row[right].beta;
    *u = row[right].u;
    if (row[right].lambda_nm == nm)
        return true;
    const struct certificate_row *a = &row[right - 1], *b = &row[right];
    double t = (nm - a->lambda_nm) / (b->lambda_nm - a->lambda_nm);
    *beta = a->beta + t * (b->beta - a->beta);
    *u = a->u + t * (b->u - a->u);
    return true;
}

/* A geometry as a weighted sum of at most four of the table. */
struct blend {
    int n;
    struct span geometry[4];
    double weight[4];
};

/* The two neighbours of x among the spans of one kind, with their weights; n = 0 when x is not covered. */
struct neighbours {
    int n;
    struct span span[2];
    double weight[2];
};

static struct neighbours find_neighbours(const struct certificate *c, struct span within, bool whole_geometry,
                                         double x) {
    struct neighbours found = {0};
    struct span below = {0};
    double x_below = NAN;
    for (size_t i = within.first; i < within.end;) {
        struct span here = span_of(c, i, within.end, whole_geometry);
        double x_here = whole_geometry ? c->row[i].theta_v_deg : c->row[i].theta_i_deg;
        bool last = here.end == within.end;
        if (x_here >= x || (last && x - x_here <= CERTIFICATE_TOLERANCE_DEG)) {
            if (x_here <= x || isnan(x_below)) { /* met, or just outside an end of the table */
                bool met = x_here - x <= CERTIFICATE_TOLERANCE_DEG;
                return (struct neighbours){met, {here}, {1}};
            }
            double t = (x - x_below) / (x_here - x_below);
            return (struct neighbours){2, {below, here}, {1 - t, t}};
        }
        below = here;
        x_below = x_here;
        i = here.end;
    }
    return found;
}

static struct blend blend_in_table(const struct certificate *c, double theta_i_deg, double theta_v_deg) {
    struct blend blend = {0};
    struct neighbours incidence = find_neighbours(c, (struct span){0, c->n}, false, theta_i_deg);
    for (int i = 0; i < incidence.n; i++) {
        struct neighbours view = find_neighbours(c, incidence.span[i], true, theta_v_deg);
        if (view.n == 0 && c->row[incidence.span[i].first].theta_i_deg == 0)
            view = find_neighbours(c, incidence.span[i], true, -theta_v_deg);
        if (view.n == 0)
            return (struct blend){0};
        for (int k = 0; k < view.n; k++) {
            blend.geometry[blend.n] = view.span[k];
            blend.weight[blend.n++] = incidence.weight[i] * view.weight[k];
        }
    }
    return blend;
}

static struct blend nearest_in_table(const struct certificate *c, double theta_i_deg, double theta_v_deg) {
    struct blend blend = {.n = 1, .weight = {1}};
    double best = INFINITY;
    for (size_t i = 0; i < c->n;) {
        struct span here = span_of(c, i, c->n, true);
        double di = c->row[i].theta_i_deg - theta_i_deg, dv = c->row[i].theta_v_deg - theta_v_deg;
        double distance = di * di + dv * dv;
        if (distance < best) {
            best = distance;
            blend.geometry[0] = here;
        }
        i = here.end;
    }
    return blend;
}

static bool is_own_geometry(const struct certificate *c, double theta_i_deg, double theta_v_deg) {
    if (c->geometry != CERTIFICATE_ONE)
        return false;
    if (c->theta_i_deg == 0)
        theta_v_deg = copysign(theta_v_deg, c->theta_v_deg);
    return fabs(c->theta_i_deg - theta_i_deg) <= CERTIFICATE_TOLERANCE_DEG &&
           fabs(c->theta_v_deg - theta_v_deg) <= CERTIFICATE_TOLERANCE_DEG;
}

static int refuse_geometry(const struct certificate *c, double theta_i_deg, double theta_v_deg,
                           struct err *e) {
    static const char remedy[] = "measure the reference there, or state angular_u_rel in the job";
    if (c->geometry == CERTIFICATE_8DI)
        return err_set(e, ERR_RANGE,
                       "an 8:di certificate holds no radiance factor at theta_i %g, theta_v %g "
                       "deg; state angular_u_rel in the job to use it",
                       theta_i_deg, theta_v_deg);
    if (c->geometry == CERTIFICATE_ONE)
        return err_set(e, ERR_RANGE, "the certificate is of theta_i %g, theta_v %g deg, not of %g, %g; %s",
                       c->theta_i_deg, c->theta_v_deg, theta_i_deg, theta_v_deg, remedy);
    return err_set(
        e, ERR_RANGE,
        "the certificate's table (theta_i %g to %g deg) does not hold theta_i %g, theta_v %g deg; %s",
        c->row[0].theta_i_deg, c->row[c->n - 1].theta_i_deg, theta_i_deg, theta_v_deg, remedy);
}

static int choose(const struct certificate *c, double theta_i_deg, double theta_v_deg, double angular_u_rel,
                  struct blend *blend, double *angular_u_rel_used, struct err *e) {
    *angular_u_rel_used = 0;
    *blend = (struct blend){.n = 1, .geometry = {{0, c->n}}, .weight = {1}};
    if (is_own_geometry(c, theta_i_deg, theta_v_deg))
        return 0;
    if (c->geometry == CERTIFICATE_TABLE) {
        *blend = blend_in_table(c, theta_i_deg, theta_v_deg);
        if (blend->n > 0)
            return 0;
        *blend = nearest_in_table(c, theta_i_deg, theta_v_deg);
    }
    if (angular_u_rel <= 0)
        return refuse_geometry(c, theta_i_deg, theta_v_deg, e);
    *angular_u_rel_used = angular_u_rel;
    return 0;
}

int certificate_at(const struct certificate *c, double theta_i_deg, double theta_v_deg, double angular_u_rel,
                   double beta[BANDS], double u[BANDS], bool covered[BANDS], double *angular_u_rel_used,
                   struct err *e) {
    struct blend blend;
    int rc = choose(c, theta_i_deg, theta_v_deg, angular_u_rel, &blend, angular_u_rel_used, e);
    if (rc != 0)
        return rc;
    int n_covered = 0;
    for (int k = 0; k < BANDS; k++) {
        beta[k] = u[k] = 0;
        covered[k] = true;
        for (int i = 0; i < blend.n && covered[k]; i++) {
            double one_beta, one_u;
            covered[k] = at_wavelength(c, blend.geometry[i], band_nm(k), &one_beta, &one_u);
            if (covered[k]) {
                beta[k] += blend.weight[i] * one_beta;
                u[k] += blend.weight[i] * one_u;
            }
        }
        if (!covered[k])
            beta[k] = u[k] = NAN;
        n_covered += covered[k];
    }
    if (n_covered == 0)
        return err_set(e, ERR_RANGE, "the certificate covers %g to %g nm: no band of %d to %d nm",
                       c->row[blend.geometry[0].first].lambda_nm, c->row[blend.geometry[0].end - 1].lambda_nm,
                       band_nm(0), band_nm(BANDS - 1));
    return 0;
}
