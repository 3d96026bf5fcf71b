#include "fit/fitset.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int no_memory(struct err *e) {
    return err_set(e, ERR_NOMEM, "no memory for the points of a fit");
}

/* Makes room for need elements of one array; arrays of a group share the capacity the caller keeps. */
static int reserve(void *array, size_t size, size_t capacity, struct err *e) {
    void *old, *larger;
    memcpy(&old, array, sizeof old);
    larger = realloc(old, size * capacity);
    if (!larger) {
        return no_memory(e);
    }
    memcpy(array, &larger, sizeof larger);
    return 0;
}

static size_t next_capacity(size_t capacity) {
    return capacity ? capacity * 2 : 16;
}

void fitset_init(struct fitset *d) {
    *d = (struct fitset){.input = {.kappa = 1,
                                   .mean_low_nm = 400,
                                   .mean_high_nm = 700,
                                   .model = "composite",
                                   .polarisation_unknown = true},
                         .has_u = true};
}

void fitset_free(struct fitset *d) {
    for (size_t i = 0; i < d->n_causes; i++) {
        free(d->cause[i].point);
        free(d->cause[i].mean);
        free(d->cause[i].bands);
    }
    for (size_t i = 0; i < d->n_brackets; i++) {
        free(d->bracket[i].point);
        free(d->bracket[i].tau_us);
        free(d->bracket[i].tau_r_us);
    }
    void *all[] = {d->theta_i_deg, d->theta_v_deg, d->delta_phi_deg, d->beta,     d->u_ind,
                   d->bands,       d->bands_u,     d->bands_cov,     d->mirrored, d->cause,
                   d->bracket,     d->common,      d->brackets};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) {
        free(all[i]);
    }
    fitset_init(d);
}

static int grow_points(struct fitset *d, struct err *e) {
    size_t capacity = next_capacity(d->capacity);
    if (d->n < d->capacity) {
        return 0;
    }
    int status = 0;
    void *columns[] = {&d->theta_i_deg, &d->theta_v_deg, &d->delta_phi_deg, &d->beta, &d->u_ind};
    for (size_t i = 0; i < sizeof columns / sizeof *columns && !status; i++) {
        status = reserve(columns[i], sizeof(double), capacity, e);
    }
    if (status || (status = reserve(&d->mirrored, sizeof(bool), capacity, e))) {
        return status;
    }
    d->capacity = capacity;
    return 0;
}

static void copy_bands(double *to, const double *from) {
    for (int b = 0; b < BANDS; b++) {
        to[b] = from ? from[b] : NAN;
    }
}

/* Bands are 1.3 kB a point: no room for them before the first point that has some. */
static int grow_bands(struct fitset *d, struct err *e) {
    int status = 0;
    if (d->band_capacity < d->capacity) {
        if ((status = reserve(&d->bands, BANDS * sizeof(double), d->capacity, e)) ||
            (status = reserve(&d->bands_u, BANDS * sizeof(double), d->capacity, e)) ||
            (status = reserve(&d->bands_cov, BANDS * sizeof(double), d->capacity, e))) {
            return status;
        }
        d->band_capacity = d->capacity;
    }
    for (size_t i = 0; i < d->n && !d->has_bands; i++) {
        copy_bands(d->bands + i * BANDS, NULL);
        copy_bands(d->bands_u + i * BANDS, NULL);
        copy_bands(d->bands_cov + i * BANDS, NULL);
    }
    d->has_bands = true;
    return status;
}

int fitset_add_point(struct fitset *d, const struct fitset_point *point, struct err *e) {
    int status = grow_points(d, e);
    if (!status && (point->bands || d->has_bands)) {
        status = grow_bands(d, e);
    }
    if (status) {
        return status;
    }
    size_t i = d->n++;
    d->theta_i_deg[i] = point->theta_i_deg;
    d->theta_v_deg[i] = point->theta_v_deg;
    d->delta_phi_deg[i] = point->delta_phi_deg;
    d->has_directions = d->has_directions || point->delta_phi_deg != 0;
    d->mirrored[i] = point->mirrored;
    d->beta[i] = point->beta;
    d->u_ind[i] = point->u_ind;
    d->has_u = d->has_u && !isnan(point->u_ind);
    if (d->has_bands) {
        copy_bands(d->bands + i * BANDS, point->bands);
        copy_bands(d->bands_u + i * BANDS, point->bands ? point->bands_u : NULL);
        copy_bands(d->bands_cov + i * BANDS, point->bands ? point->bands_cov : NULL);
    }
    d->has_bands_u = d->has_bands_u || (point->bands && point->bands_u);
    d->has_bands_cov = d->has_bands_cov || (point->bands && point->bands_cov);
    return 0;
}

static int find_cause(struct fitset *d, const char *name, struct fitset_cause **found, struct err *e) {
    for (size_t i = d->n_causes; i > 0; i--) { /* the newest first: most causes touch neighbours */
        if (strncmp(d->cause[i - 1].name, name, sizeof d->cause->name - 1) == 0) {
            *found = &d->cause[i - 1];
            return 0;
        }
    }
    if (d->n_causes == d->cause_capacity) {
        int status = reserve(&d->cause, sizeof *d->cause, next_capacity(d->cause_capacity), e);
        if (status) {
            return status;
        }
        d->cause_capacity = next_capacity(d->cause_capacity);
    }
    *found = &d->cause[d->n_causes++];
    **found = (struct fitset_cause){0};
    snprintf((*found)->name, sizeof(*found)->name, "%s", name);
    return 0;
}

static int grow_cause(struct fitset_cause *c, bool with_bands, struct err *e) {
    int status = 0;
    if (c->n == c->capacity) {
        size_t capacity = next_capacity(c->capacity);
        if ((status = reserve(&c->point, sizeof(int), capacity, e)) ||
            (status = reserve(&c->mean, sizeof(double), capacity, e))) {
            return status;
        }
        c->capacity = capacity;
    }
    if ((with_bands || c->has_bands) && c->band_capacity < c->capacity) {
        if ((status = reserve(&c->bands, BANDS * sizeof(double), c->capacity, e))) {
            return status;
        }
        c->band_capacity = c->capacity;
    }
    for (size_t i = 0; with_bands && !c->has_bands && i < c->n; i++) {
        copy_bands(c->bands + i * BANDS, NULL);
    }
    c->has_bands = c->has_bands || with_bands;
    return 0;
}

int fitset_add_cause(struct fitset *d, const char *name, size_t point, double mean, const double *bands,
                     struct err *e) {
    struct fitset_cause *c;
    int status = find_cause(d, name, &c, e);
    if (status || (status = grow_cause(c, bands != NULL, e))) {
        return status;
    }
    size_t i = c->n++;
    c->point[i] = (int)point;
    c->mean[i] = mean;
    if (c->has_bands) {
        copy_bands(c->bands + i * BANDS, bands);
    }
    return 0;
}

int fitset_add_bracket(struct fitset *d, double length_us, double rate, struct err *e) {
    if (d->n_brackets == d->bracket_capacity) {
        int status = reserve(&d->bracket, sizeof *d->bracket, next_capacity(d->bracket_capacity), e);
        if (status) {
            return status;
        }
        d->bracket_capacity = next_capacity(d->bracket_capacity);
    }
    d->bracket[d->n_brackets++] = (struct fitset_bracket){.length_us = length_us, .rate = rate};
    return 0;
}

int fitset_add_to_bracket(struct fitset *d, size_t bracket, size_t point, double tau_us, double tau_r_us,
                          struct err *e) {
    struct fitset_bracket *b = &d->bracket[bracket];
    if (b->n == b->capacity) {
        size_t capacity = next_capacity(b->capacity);
        int status = reserve(&b->point, sizeof(int), capacity, e);
        if (status || (status = reserve(&b->tau_us, sizeof(double), capacity, e)) ||
            (status = reserve(&b->tau_r_us, sizeof(double), capacity, e))) {
            return status;
        }
        b->capacity = capacity;
    }
    size_t i = b->n++;
    b->point[i] = (int)point;
    b->tau_us[i] = tau_us;
    b->tau_r_us[i] = tau_r_us;
    return 0;
}

int fitset_input(struct fitset *d, const struct estimate_input **input, struct err *e) {
    struct estimate_input *in = &d->input;
    int status = reserve(&d->common, sizeof *d->common, d->n_causes + 1, e);
    if (status || (status = reserve(&d->brackets, sizeof *d->brackets, d->n_brackets + 1, e))) {
        return status;
    }
    for (size_t i = 0; i < d->n_causes; i++) {
        const struct fitset_cause *c = &d->cause[i];
        d->common[i] = (struct estimate_common){
            .n = c->n, .point = c->point, .mean = c->mean, .bands = c->has_bands ? c->bands : NULL};
    }
    for (size_t i = 0; i < d->n_brackets; i++) {
        const struct fitset_bracket *b = &d->bracket[i];
        static const int none = 0; /* a bracket without points still has to say that it has none */
        d->brackets[i] = (struct estimate_bracket){.n = b->n,
                                                   .point = b->n ? b->point : &none,
                                                   .tau_us = b->tau_us,
                                                   .tau_r_us = b->tau_r_us,
                                                   .length_us = b->length_us,
                                                   .rate = b->rate};
    }
    in->n = d->n;
    in->theta_i_deg = d->theta_i_deg;
    in->theta_v_deg = d->theta_v_deg;
    in->delta_phi_deg = d->has_directions ? d->delta_phi_deg : NULL;
    in->mirrored = d->mirrored;
    in->beta = d->beta;
    in->u_ind = d->has_u ? d->u_ind : NULL;
    in->band_beta = d->has_bands ? d->bands : NULL;
    in->band_u_ind = d->has_bands_u ? d->bands_u : NULL;
    in->band_cov_next = d->has_bands_cov ? d->bands_cov : NULL;
    in->n_common = d->n_causes;
    in->common = d->common;
    in->n_bracket = d->n_brackets;
    in->bracket = d->brackets;
    *input = in;
    return 0;
}
