#include "proto/session_internal.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

/* Walks the rows of sql; row() turns one into a struct and hands it on. */
static int walk(struct session *s, const char *sql,
                int (*row)(struct session *s, struct query *q, void *arg, struct err *e), void *arg,
                struct err *e) {
    struct query *q;
    int rc = store_prepare(s->store, sql, &q, e);
    if (rc < 0)
        return rc;
    while ((rc = query_step(q, e)) == 1)
        if ((rc = row(s, q, arg, e)) != 0)
            break;
    query_free(q);
    return rc;
}

static void get_text(struct query *q, int at, char *text, size_t size) {
    snprintf(text, size, "%s", query_text(q, at));
}

void session_take_doubles(struct query *q, int at, double *value, size_t n) {
    size_t size;
    const void *bytes = query_bytes(q, at, &size);
    if (size > 0 && size == n * sizeof *value)
        memcpy(value, bytes, size);
    else
        for (size_t i = 0; i < n; i++)
            value[i] = NAN;
}

int session_get_text(struct session *s, const char *key, char **text, struct err *e) {
    struct query *q;
    *text = NULL;
    int rc = store_query(s->store, "SELECT value FROM fact WHERE key = ?", &q, e);
    if (rc < 0)
        return rc;
    query_bind_text(q, 0, key);
    rc = query_step(q, e);
    if (rc == 1 && !(*text = strdup(query_text(q, 0))))
        rc = err_set(e, ERR_NOMEM, "%s: out of memory", s->path);
    query_reset(q);
    return rc < 0 ? rc : 0;
}

bool session_has_table(struct session *s, const char *table) {
    struct query *q;
    if (store_query(s->store, "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ?", &q, NULL) < 0)
        return false;
    query_bind_text(q, 0, table);
    bool there = query_step(q, NULL) == 1;
    query_reset(q);
    return there;
}

struct text_walk {
    int (*seen)(void *arg, const char *key, const char *value);
    void *arg;
};

static int text_row(struct session *s, struct query *q, void *arg, struct err *e) {
    (void)s;
    (void)e;
    struct text_walk *w = arg;
    return w->seen(w->arg, query_text(q, 0), query_text(q, 1));
}

int session_each_text(struct session *s, int (*seen)(void *arg, const char *key, const char *value),
                      void *arg, struct err *e) {
    return walk(s, "SELECT key, value FROM fact ORDER BY key", text_row, &(struct text_walk){seen, arg}, e);
}

static void calibration_row(struct query *q, struct calibration *c) {
    int at = 1;
    get_text(q, at++, c->model, sizeof c->model);
    get_text(q, at++, c->serial, sizeof c->serial);
    c->pixels = (int)query_int(q, at++);
    c->dark_first = (int)query_int(q, at++);
    c->dark_last = (int)query_int(q, at++);
    c->active_first = (int)query_int(q, at++);
    c->active_last = (int)query_int(q, at++);
    for (int i = 0; i < 4; i++)
        c->wavelength[i] = query_double(q, at++);
    for (int i = 0; i < 8; i++)
        c->nonlinearity[i] = query_double(q, at++);
    c->nonlinearity_order = (int)query_int(q, at++);
    c->nonlinearity_used = query_int(q, at++) != 0;
    c->saturation = (int)query_int(q, at++);
    c->read_noise_counts = query_double(q, at++);
    c->electrons_per_count = query_double(q, at++);
}

int session_get_calibration(struct session *s, struct calibration *c, struct err *e) {
    struct query *q;
    int rc = store_query(s->store, "SELECT * FROM calibration", &q, e);
    if (rc < 0)
        return rc;
    memset(c, 0, sizeof *c);
    rc = query_step(q, e);
    if (rc == 1)
        calibration_row(q, c);
    query_reset(q);
    if (rc == 0)
        return err_set(e, ERR_STATE, "%s: holds no calibration of a spectrometer", s->path);
    if (rc == 1 &&
        (c->nonlinearity_order < 0 || c->nonlinearity_order > 7)) /* it counts through nonlinearity[] */
        return err_set(e, ERR_INPUT,
                       "%s: its calibration is damaged: non-linearity of order %d, expected 0..7", s->path,
                       c->nonlinearity_order);
    return rc < 0 ? rc : 0;
}

struct exposure_walk {
    int (*seen)(void *arg, const struct exposure *x);
    void *arg;
};

static int exposure_kind(const char *name) {
    for (int k = 0; k < EXPOSURE_KINDS; k++)
        if (strcmp(SESSION_KINDS[k], name) == 0)
            return k;
    return -1;
}

static int exposure_row(struct session *s, struct query *q, void *arg, struct err *e) {
    struct exposure_walk *w = arg;
    struct exposure x = {.id = query_int(q, 0)};
    size_t size;
    int at = 1, kind;
    x.step = (int)query_int(q, at++);
    x.attempt = (int)query_int(q, at++);
    kind = exposure_kind(query_text(q, at++));
    x.kind = (enum exposure_kind)kind;
    x.bracket = (int)query_int(q, at++);
    x.opens = (int)query_int(q, at++);
    x.control = query_int(q, at++) != 0;
    x.theta_i_udeg = (int32_t)query_int(q, at++);
    x.theta_v_udeg = (int32_t)query_int(q, at++);
    x.mirrored = query_int(q, at++) != 0;
    x.source_udeg = (int32_t)query_int(q, at++);
    x.sample_udeg = (int32_t)query_int(q, at++);
    x.holder_udeg = (int32_t)query_int(q, at++);
    x.settled_us = query_int(q, at++);
    x.start_us = query_int(q, at++);
    x.end_us = query_int(q, at++);
    x.utc_us = query_int(q, at++);
    x.exposure_us = (int)query_int(q, at++);
    x.n_scans = (int)query_int(q, at++);
    x.pixels = (int)query_int(q, at++);
    x.saturated_pixels = (int)query_int(q, at++);
    x.lamp = query_int(q, at++) != 0;
    x.temperature_c = query_double(q, at++);
    const void *counts = query_bytes(q, at++, &size);
    x.counts = (uint16_t *)(uintptr_t)counts;
    if (kind < 0 || x.n_scans < 1 || x.pixels < 1 ||
        size / sizeof *x.counts / (size_t)x.pixels != (size_t)x.n_scans)
        return err_set(e, ERR_INPUT,
                       "%s: exposure %lld is damaged: its spectra do not fit its scans and pixels", s->path,
                       (long long)x.id);
    return w->seen(w->arg, &x);
}

int session_each_exposure(struct session *s, int (*seen)(void *arg, const struct exposure *x), void *arg,
                          struct err *e) {
    return walk(s, "SELECT * FROM exposure ORDER BY id", exposure_row, &(struct exposure_walk){seen, arg}, e);
}

struct point_walk {
    int (*seen)(void *arg, const struct point *p);
    void *arg;
};

static int read_bands(struct session *s, struct point *p, struct err *e) {
    struct query *q;
    int rc = store_query(
        s->store, "SELECT band, beta, u_ind, cov_next FROM point_band WHERE point_id = ? ORDER BY band", &q,
        e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, p->id);
    while ((rc = query_step(q, e)) == 1) {
        int64_t band = query_int(q, 0);
        if (band < 0 || band >= BANDS)
            continue;
        p->present[band] = true;
        p->beta[band] = query_double(q, 1);
        p->u_ind[band] = query_double(q, 2);
        p->cov_next[band] = query_double(q, 3);
    }
    query_reset(q);
    return rc;
}

static int read_commons(struct session *s, struct point *p, struct err *e) {
    struct query *q;
    int rc = store_query(
        s->store, "SELECT name, mean, sensitivity FROM point_common WHERE point_id = ? ORDER BY at", &q, e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, p->id);
    while ((rc = query_step(q, e)) == 1 && p->n_common < POINT_COMMON_MAX) {
        struct point_common *c = &p->common[p->n_common++];
        get_text(q, 0, c->name, sizeof c->name);
        c->mean = query_double(q, 1);
        session_take_doubles(q, 2, c->sensitivity, BANDS);
    }
    query_reset(q);
    return rc < 0 ? rc : 0;
}

static int point_row(struct session *s, struct query *q, void *arg, struct err *e) {
    struct point_walk *w = arg;
    struct point p = {.id = query_int(q, 0)};
    int at = 1;
    p.supersedes = query_int(q, at++);
    p.provisional = query_int(q, at++) != 0;
    p.exposure_id = query_int(q, at++);
    p.bracket = (int)query_int(q, at++);
    p.tau_us = query_double(q, at++);
    p.tau_r_us = query_double(q, at++);
    p.theta_i_udeg = (int32_t)query_int(q, at++);
    p.theta_v_udeg = (int32_t)query_int(q, at++);
    p.saturated = query_int(q, at++) != 0;
    p.scan_f = query_double(q, at++);
    p.noisy = query_int(q, at++) != 0;
    p.mean = query_double(q, at++);
    p.mean_u_ind = query_double(q, at++);
    for (int band = 0; band < BANDS; band++)
        p.beta[band] = p.u_ind[band] = NAN;
    int rc = read_bands(s, &p, e);
    if (rc == 0)
        rc = read_commons(s, &p, e);
    return rc < 0 ? rc : w->seen(w->arg, &p);
}

int session_each_point(struct session *s, bool with_superseded, int (*seen)(void *arg, const struct point *p),
                       void *arg, struct err *e) {
    const char *sql = with_superseded
                          ? "SELECT * FROM point ORDER BY id"
                          : "SELECT * FROM point AS p WHERE NOT EXISTS (SELECT 1 FROM point AS later"
                            " WHERE later.supersedes = p.id) ORDER BY id";
    return walk(s, sql, point_row, &(struct point_walk){seen, arg}, e);
}

struct bracket_walk {
    int (*seen)(void *arg, const struct bracket *b);
    void *arg;
};

static int bracket_row(struct session *s, struct query *q, void *arg, struct err *e) {
    (void)s;
    (void)e;
    struct bracket_walk *w = arg;
    struct bracket b = {
        .number = (int)query_int(q, 1), .open_us = query_int(q, 2), .close_us = query_int(q, 3)};
    b.mean_rate = query_double(q, 4);
    get_text(q, 5, b.ended_by, sizeof b.ended_by);
    b.last_exposure_id = query_int(q, 6);
    session_take_doubles(q, 7, b.rate, BANDS);
    return w->seen(w->arg, &b);
}

int session_each_bracket(struct session *s, int (*seen)(void *arg, const struct bracket *b), void *arg,
                         struct err *e) {
    return walk(s, "SELECT * FROM bracket ORDER BY id", bracket_row, &(struct bracket_walk){seen, arg}, e);
}

struct event_walk {
    int (*seen)(void *arg, int64_t us, const char *kind, const char *json);
    void *arg;
};

static int event_row(struct session *s, struct query *q, void *arg, struct err *e) {
    (void)s;
    (void)e;
    struct event_walk *w = arg;
    return w->seen(w->arg, query_int(q, 1), query_text(q, 2), query_text(q, 3));
}

int session_each_event(struct session *s,
                       int (*seen)(void *arg, int64_t us, const char *kind, const char *json), void *arg,
                       struct err *e) {
    return walk(s, "SELECT * FROM event ORDER BY id", event_row, &(struct event_walk){seen, arg}, e);
}

struct exchange_walk {
    int (*seen)(void *arg, const struct exchange *x);
    void *arg;
};

static int exchange_row(struct session *s, struct query *q, void *arg, struct err *e) {
    (void)s;
    (void)e;
    struct exchange_walk *w = arg;
    struct exchange x = {.id = query_int(q, 0), .sent_us = query_int(q, 1), .result = (int)query_int(q, 3)};
    x.done_us = x.sent_us + query_int(q, 2);
    x.link = query_text(q, 4);
    x.request = query_bytes(q, 5, &x.request_size);
    x.reply = query_bytes(q, 6, &x.reply_size);
    return w->seen(w->arg, &x);
}

int session_each_exchange(struct session *s, int (*seen)(void *arg, const struct exchange *x), void *arg,
                          struct err *e) {
    return walk(s,
                "SELECT x.id, x.sent_us, x.took_us, x.result, r.link, r.request, x.reply FROM exchange AS x"
                " JOIN exchange_request AS r ON r.id = x.request_id ORDER BY x.id",
                exchange_row, &(struct exchange_walk){seen, arg}, e);
}

int session_get_summary(struct session *s, struct session_summary *m, struct err *e) {
    const struct {
        const char *sql;
        int64_t *value;
    } numbers[] = {
        {"SELECT count(*) FROM exposure", &m->n_exposures},
        {"SELECT count(*) FROM point", &m->n_points},
        {"SELECT count(*) FROM point WHERE NOT provisional", &m->n_final},
        {"SELECT count(*) FROM point AS p WHERE provisional AND NOT EXISTS"
         " (SELECT 1 FROM point AS final WHERE final.supersedes = p.id)",
         &m->n_provisional},
        {"SELECT count(*) FROM bracket", &m->n_brackets},
        {"SELECT count(*) FROM estimation", &m->n_estimates},
        {"SELECT count(*) FROM event", &m->n_events},
        {"SELECT count(*) FROM exchange", &m->n_exchanges},
        {"SELECT min(start_us) FROM exposure", &m->first_us},
        {"SELECT max(end_us) FROM exposure", &m->last_us},
        {"SELECT min(utc_us) FROM exposure", &m->first_utc_us},
    };
    memset(m, 0, sizeof *m);
    m->user_version = s->user_version;
    int rc = 0;
    for (size_t i = 0; rc == 0 && i < sizeof numbers / sizeof numbers[0]; i++)
        rc = store_number(s->store, numbers[i].sql, 0, numbers[i].value, e);
    return rc;
}
