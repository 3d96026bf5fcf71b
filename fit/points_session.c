#include "fit/points_session.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/request.h"
#include "proto/session.h"
#include "proto/units.h"

struct reading {
    struct fitset *data;
    bool *mirrored; /* by exposure id */
    int64_t n_exposures;
    struct bracket *bracket; /* closed or open, in order of their rows; a later row of a number replaces it */
    size_t n_brackets;
    bool provisional; /* which kind of points is taken */
    size_t n_final, n_provisional;
    struct err *e;
};

static int see_exposure(void *arg, const struct exposure *x) {
    struct reading *r = arg;
    if (x->id >= r->n_exposures) {
        int64_t n = 2 * x->id + 64;
        bool *larger = realloc(r->mirrored, (size_t)n * sizeof *larger);
        if (!larger) {
            return err_set(r->e, ERR_NOMEM, "no memory for the exposures of a session");
        }
        memset(larger + r->n_exposures, 0, (size_t)(n - r->n_exposures) * sizeof *larger);
        r->mirrored = larger;
        r->n_exposures = n;
    }
    r->mirrored[x->id] = x->mirrored;
    return 0;
}

static int see_bracket(void *arg, const struct bracket *b) {
    struct reading *r = arg;
    struct bracket *larger = realloc(r->bracket, (r->n_brackets + 1) * sizeof *larger);
    if (!larger) {
        return err_set(r->e, ERR_NOMEM, "no memory for the brackets of a session");
    }
    r->bracket = larger;
    r->bracket[r->n_brackets++] = *b;
    double length_us = b->close_us > 0 ? (double)(b->close_us - b->open_us) : 0;
    return fitset_add_bracket(r->data, length_us, b->mean_rate, r->e);
}

static int count_point(void *arg, const struct point *p) {
    struct reading *r = arg;
    *(p->provisional ? &r->n_provisional : &r->n_final) += 1;
    return 0;
}

static int add_to_bracket(struct reading *r, const struct point *p, size_t at) {
    for (size_t b = r->n_brackets; b > 0; b--) {
        if (r->bracket[b - 1].number == p->bracket) {
            return fitset_add_to_bracket(r->data, b - 1, at, p->tau_us, p->tau_r_us, r->e);
        }
    }
    return 0;
}

static int see_point(void *arg, const struct point *p) {
    struct reading *r = arg;
    if (p->provisional != r->provisional) {
        return 0;
    }
    if (isnan(p->mean)) {
        r->data->mask.left_out[MASK_NO_VALUE]++;
        return 0;
    }
    const double theta_i_deg = deg_from_udeg(p->theta_i_udeg), theta_v_deg = deg_from_udeg(p->theta_v_udeg);
    if (!mask_admits(&r->data->mask, theta_i_deg, fabs(theta_v_deg), theta_v_deg > 0 ? 180 : 0)) {
        return 0;
    }
    double bands[BANDS], bands_u[BANDS], bands_cov[BANDS];
    for (int b = 0; b < BANDS; b++) {
        bands[b] = p->present[b] ? p->beta[b] : NAN;
        bands_u[b] = p->present[b] ? p->u_ind[b] : NAN;
        bands_cov[b] = p->present[b] ? p->cov_next[b] : NAN;
    }
    struct fitset_point point = {.theta_i_deg = theta_i_deg,
                                 .theta_v_deg = theta_v_deg,
                                 .mirrored = p->exposure_id < r->n_exposures && r->mirrored[p->exposure_id],
                                 .beta = p->mean,
                                 .u_ind = p->mean_u_ind,
                                 .bands = bands,
                                 .bands_u = bands_u,
                                 .bands_cov = bands_cov};
    size_t at = r->data->n;
    int status = fitset_add_point(r->data, &point, r->e);
    for (int c = 0; c < p->n_common && !status; c++) {
        const struct point_common *cause = &p->common[c];
        status = fitset_add_cause(r->data, cause->name, at, cause->mean, cause->sensitivity, r->e);
    }
    return status ? status : add_to_bracket(r, p, at);
}

static int read_settings(struct session *s, struct fitset *data, struct err *e) {
    char *text = NULL;
    int status = session_get_text(s, "fit_setup", &text, e);
    if (!status && text) {
        json_error_t where;
        json_t *json = json_loads(text, 0, &where);
        status = json ? request_read_settings(json, data, e)
                      : err_set(e, ERR_INPUT, "the session's fit_setup is not JSON: %s", where.text);
        json_decref(json);
    }
    free(text);
    return status;
}

static int read_all(struct session *s, struct reading *r) {
    int status = read_settings(s, r->data, r->e);
    if (status || (status = session_each_exposure(s, see_exposure, r, r->e)) ||
        (status = session_each_bracket(s, see_bracket, r, r->e)) ||
        (status = session_each_point(s, false, count_point, r, r->e))) {
        return status;
    }
    r->provisional = r->n_final == 0;
    r->data->input.any_provisional = r->provisional && r->n_provisional > 0;
    return session_each_point(s, false, see_point, r, r->e);
}

int points_session_read(const char *path, struct fitset *data, struct err *e) {
    struct session *s;
    struct reading r = {.data = data, .e = e};
    int status = session_open(&s, path, true, e);
    if (status) {
        return status;
    }
    status = read_all(s, &r);
    int closed = session_close(s, status ? NULL : e);
    free(r.mirrored);
    free(r.bracket);
    return status ? status : closed;
}
