#include "fit/points.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/points_csv.h"
#include "fit/points_session.h"
#include "fit/points_surface.h"
#include "proto/alta.h"
#include "proto/astm.h"
#include "proto/file.h"
#include "proto/nist.h"

#define FILE_MAX (256u << 20)
#define HEAD_BYTES 4096 /* of a file, looked at to recognise its form */

struct source {
    const char *path, *text;
    size_t size;
    const struct points_options *options;
    struct fitset *data;
    struct points_report *report;
    struct err_list *errors;
};

static bool starts_line(const char *head, const char *word) {
    for (const char *line = head; line; line = strchr(line, '\n') ? strchr(line, '\n') + 1 : NULL) {
        if (strncmp(line, word, strlen(word)) == 0) {
            return true;
        }
    }
    return false;
}

/* The first line that is neither blank nor a comment. */
static const char *first_line(const char *head) {
    while (*head && strchr(" \t\r\n#", *head)) {
        if (*head == '#') {
            head += strcspn(head, "\n");
        } else {
            head++;
        }
    }
    return head;
}

static bool is_session(const char *head) {
    return strncmp(head, "SQLite format 3", 15) == 0;
}

static bool is_alta(const char *head) {
    return starts_line(head, "#DIM") || starts_line(head, "#PARAM_IN");
}

static bool is_astm(const char *head) {
    return starts_line(head, "VARS ") || starts_line(head, "VARS\t");
}

static bool is_nist(const char *head) {
    const char *line = first_line(head);
    return strncmp(line, "lambda", 6) == 0 && memmem(line, strcspn(line, "\n"), "thetai", 6);
}

static bool is_csv(const char *head) {
    const char *line = first_line(head);
    return memmem(line, strcspn(line, "\n"), "theta_i_deg", 11) != NULL;
}

/* Its first number is a count, alone before the wavelengths: nothing but digits. */
static bool is_brdf(const char *head) {
    const char *line = first_line(head);
    size_t digits = strspn(line, "0123456789");
    return digits > 0 && line[digits] && strchr(" \t\r\n", line[digits]);
}

static void add_error(struct source *s, struct err *e) {
    if (e->code) {
        err_list_add(s->errors, e);
    }
}

/* A range of wavelengths cannot be had from a file that only holds means over another. */
static int refuse_range(struct source *s, const char *what) {
    struct err e = {0};
    if (s->options->mean_high_nm == 0) {
        return 0;
    }
    err_at(&e, ERR_INPUT, s->path, 0, 0, "--wavelength needs values by wavelength, but %s", what);
    err_list_add(s->errors, &e);
    return -ERR_INPUT;
}

static int read_session(struct source *s) {
    struct err e = {0};
    int status = refuse_range(s, "a session fits the mean it was reduced to; export it as csv --spectrum");
    if (!status) {
        status = points_session_read(s->path, s->data, &e);
        add_error(s, &e);
    }
    return status;
}

static void note(struct points_report *r, const char *text) {
    snprintf(r->note[r->n_notes++], sizeof r->note[0], "%s", text);
}

/* What fits the form of a CSV file and is all the same not what was meant. Nothing is changed: a person decides. */
static void note_doubts(const struct fitset *d, double q, struct points_report *r) {
    double angle = 0, least = INFINITY;
    for (size_t i = 0; i < d->n; i++) {
        angle = fmax(angle, fmax(d->theta_i_deg[i], fabs(d->theta_v_deg[i])));
        least = fmin(least, d->beta[i]);
    }
    if (d->n > 0 && angle > 0 && angle <= M_PI / 2) {
        note(r, "all angles are within 1.6: are they radians? They are read as degrees");
    }
    if (d->n > 0 && least > 2) {
        note(r, "all values are above 2: are they per cent? A perfect diffuser has 1");
    }
    if (d->n > 0 && !d->has_bands && q == 0) {
        note(r, "means alone do not tell q of a coloured surface: taken as 1; --q states it, columns by "
                "wavelength "
                "give it");
    }
}

static int read_csv(struct source *s) {
    int status = points_csv_read(s->path, s->text, s->size, s->data, s->errors);
    if (!status) {
        s->data->input.q = s->options->q;
        note_doubts(s->data, s->options->q, s->report);
    }
    return status || s->data->has_bands || s->data->n == 0 ? status
                                                           : refuse_range(s, "this file holds means alone");
}

static int take_surface(struct source *s, struct brdf *b) {
    struct err e = {0};
    struct points_report *r = s->report;
    for (int i = 0; i < b->n_notes; i++) {
        snprintf(r->note[r->n_notes++], sizeof r->note[0], "%s", b->note[i]);
    }
    int status = azimuth_settle(b, s->options->azimuth, r->azimuth, sizeof r->azimuth, &e);
    if (!status) {
        status = points_surface_add(b, s->path, s->data, r, &e);
    }
    add_error(s, &e);
    brdf_free(b);
    return status;
}

static int read_brdf(struct source *s) {
    struct brdf b;
    struct err e = {0};
    int status = brdf_read_text(s->path, s->text, s->size, &b, &e);
    add_error(s, &e);
    return status ? status : take_surface(s, &b);
}

static int read_astm(struct source *s) {
    struct brdf b;
    int status = astm_read_text(s->path, s->text, s->size, &b, s->errors);
    return status ? status : take_surface(s, &b);
}

static int read_alta(struct source *s) {
    struct brdf b;
    int status = alta_read_text(s->path, s->text, s->size, &b, s->errors);
    return status ? status : take_surface(s, &b);
}

static int read_nist(struct source *s) {
    struct brdf b;
    int status = nist_read_text(s->path, s->text, s->size, &b, s->errors);
    return status ? status : take_surface(s, &b);
}

static const struct format {
    const char *name, *extensions; /* each with a blank behind it */
    bool (*recognise)(const char *head);
    int (*read)(struct source *s);
} formats[] = {{"session", ".gonio ", is_session, read_session},
               {"alta", ".alta .dat ", is_alta, read_alta},
               {"astm", ".astm ", is_astm, read_astm},
               {"nist", "", is_nist, read_nist},
               {"csv", ".csv ", is_csv, read_csv},
               {"brdf", ".brdf ", is_brdf, read_brdf}};

#define FORMATS (sizeof formats / sizeof *formats)

static const struct format *find_named(const char *name) {
    for (size_t i = 0; i < FORMATS; i++) {
        if (strcmp(formats[i].name, name) == 0) {
            return &formats[i];
        }
    }
    return NULL;
}

bool points_format_known(const char *name) {
    return find_named(name) != NULL;
}

/* By content, else by extension; a file like nothing else is read as CSV, whose reader says what is amiss. */
static const struct format *recognise(const struct source *s) {
    char head[HEAD_BYTES + 1], extension[16];
    snprintf(head, sizeof head, "%.*s", (int)(s->size < HEAD_BYTES ? s->size : HEAD_BYTES), s->text);
    for (size_t i = 0; i < FORMATS; i++) {
        if (formats[i].recognise(head)) {
            return &formats[i];
        }
    }
    const char *dot = strrchr(s->path, '.');
    snprintf(extension, sizeof extension, "%.14s ", dot ? dot : "");
    for (size_t i = 0; i < FORMATS && dot; i++) {
        if (strcasestr(formats[i].extensions, extension)) {
            return &formats[i];
        }
    }
    return find_named("csv");
}

static void assume_u(const struct points_options *o, struct fitset *d) {
    for (size_t i = 0; i < d->n; i++) {
        d->u_ind[i] = hypot(o->u_relative * d->beta[i], o->u_absolute);
    }
    d->has_u = true;
}

int points_read(const char *path, const struct points_options *options, struct fitset *data,
                struct points_report *report, struct err_list *errors) {
    struct err e = {0};
    char *text = NULL;
    struct source s = {.path = path, .options = options, .data = data, .report = report, .errors = errors};
    *report = (struct points_report){0};
    data->mask = options->mask;
    if (options->mean_high_nm > 0) {
        data->input.mean_low_nm = options->mean_low_nm;
        data->input.mean_high_nm = options->mean_high_nm;
    }
    int status = file_read(path, FILE_MAX, &text, &s.size, &e);
    if (status) {
        add_error(&s, &e);
        return status;
    }
    s.text = text;
    const struct format *format = options->format ? find_named(options->format) : recognise(&s);
    report->format = format->name;
    status = format->read(&s);
    free(text);
    if (!status && options->has_u) {
        assume_u(options, data);
    }
    return status;
}
