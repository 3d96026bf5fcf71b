#include "proto/session_internal.h"

#include <math.h>
#include <string.h>

int session_enter(struct session *s, bool *own, struct err *e) {
    if (s->read_only)
        return err_set(e, ERR_STATE, "%s: is open for reading only", s->path);
    if (s->spoilt)
        return err_set(e, ERR_STATE, "%s: an earlier row of this transaction failed; roll it back first",
                       s->path);
    *own = !store_in_transaction(s->store);
    return *own ? session_begin(s, e) : 0;
}

int session_leave(struct session *s, bool own, int rc, struct err *e) {
    if (rc == 0)
        return own ? session_commit(s, e) : 0;
    if (own)
        session_rollback(s);
    else
        s->spoilt = true;
    return rc;
}

static int write_text(struct session *s, const char *key, const char *text, struct err *e) {
    struct query *q;
    int64_t present;
    int rc = store_query(s->store, "SELECT count(*) FROM fact WHERE key = ?", &q, e);
    if (rc < 0)
        return rc;
    query_bind_text(q, 0, key);
    rc = query_step(q, e);
    present = rc == 1 ? query_int(q, 0) : 0;
    query_reset(q);
    if (present)
        return err_set(e, ERR_STATE, "%s: the text '%s' is written already; texts are written once", s->path,
                       key);
    rc = store_query(s->store, "INSERT INTO fact VALUES (?, ?,?)", &q, e);
    if (rc < 0)
        return rc;
    query_bind_text(q, 0, key);
    query_bind_text(q, 1, text);
    return query_insert(q, NULL, e);
}

int session_set_text(struct session *s, const char *key, const char *text, struct err *e) {
    bool own;
    int rc = session_enter(s, &own, e);
    return rc < 0 ? rc : session_leave(s, own, write_text(s, key, text, e), e);
}

static int write_calibration(struct session *s, const struct calibration *c, struct err *e) {
    struct query *q;
    int rc = store_query(
        s->store, "INSERT INTO calibration VALUES (1,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)", &q,
        e);
    if (rc < 0)
        return rc;
    int at = 0;
    query_bind_text(q, at++, c->model);
    query_bind_text(q, at++, c->serial);
    query_bind_int(q, at++, c->pixels);
    query_bind_int(q, at++, c->dark_first);
    query_bind_int(q, at++, c->dark_last);
    query_bind_int(q, at++, c->active_first);
    query_bind_int(q, at++, c->active_last);
    for (int i = 0; i < 4; i++)
        query_bind_double(q, at++, c->wavelength[i]);
    for (int i = 0; i < 8; i++)
        query_bind_double(q, at++, c->nonlinearity[i]);
    query_bind_int(q, at++, c->nonlinearity_order);
    query_bind_int(q, at++, c->nonlinearity_used);
    query_bind_int(q, at++, c->saturation);
    query_bind_double(q, at++, c->read_noise_counts);
    query_bind_double(q, at++, c->electrons_per_count);
    return query_insert(q, NULL, e);
}

int session_set_calibration(struct session *s, const struct calibration *c, struct err *e) {
    bool own;
    int rc = session_enter(s, &own, e);
    return rc < 0 ? rc : session_leave(s, own, write_calibration(s, c, e), e);
}

/* A dark needs no settled stage: it may be taken on the way. */
static int check_times(const struct session *s, const struct exposure *x, struct err *e) {
    bool settled = x->kind == EXPOSURE_DARK || x->settled_us < x->start_us;
    if (settled && x->start_us < x->end_us)
        return 0;
    return err_set(
        e, ERR_STATE,
        "%s: exposure of step %d refused: settled %lld us, start %lld us, end %lld us are not in this order",
        s->path, x->step, (long long)x->settled_us, (long long)x->start_us, (long long)x->end_us);
}

static int write_exposure(struct session *s, struct exposure *x, struct err *e) {
    struct query *q;
    int rc = check_times(s, x, e);
    if (rc == 0)
        rc = store_query(s->store,
                         "INSERT INTO exposure VALUES (NULL,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)",
                         &q, e);
    if (rc < 0)
        return rc;
    int at = 0;
    query_bind_int(q, at++, x->step);
    query_bind_int(q, at++, x->attempt);
    query_bind_text(q, at++, SESSION_KINDS[x->kind]);
    query_bind_int(q, at++, x->bracket);
    query_bind_int(q, at++, x->opens);
    query_bind_int(q, at++, x->control);
    query_bind_int(q, at++, x->theta_i_udeg);
    query_bind_int(q, at++, x->theta_v_udeg);
    query_bind_int(q, at++, x->mirrored);
    query_bind_int(q, at++, x->source_udeg);
    query_bind_int(q, at++, x->sample_udeg);
    query_bind_int(q, at++, x->holder_udeg);
    query_bind_int(q, at++, x->settled_us);
    query_bind_int(q, at++, x->start_us);
    query_bind_int(q, at++, x->end_us);
    query_bind_int(q, at++, x->utc_us);
    query_bind_int(q, at++, x->exposure_us);
    query_bind_int(q, at++, x->n_scans);
    query_bind_int(q, at++, x->pixels);
    query_bind_int(q, at++, x->saturated_pixels);
    query_bind_int(q, at++, x->lamp);
    query_bind_double(q, at++, x->temperature_c);
    query_bind_bytes(q, at++, x->counts, sizeof *x->counts * (size_t)x->n_scans * (size_t)x->pixels);
    return query_insert(q, &x->id, e);
}

int session_add_exposure(struct session *s, struct exposure *x, struct err *e) {
    bool own;
    int rc = session_enter(s, &own, e);
    return rc < 0 ? rc : session_leave(s, own, write_exposure(s, x, e), e);
}

double session_common_mean(const struct point *p) {
    double sum = 0;
    for (int k = 0; k < p->n_common; k++)
        sum += p->common[k].mean * p->common[k].mean;
    return sqrt(sum);
}

double session_common_band(const struct point *p, int band) {
    double sum = 0;
    for (int k = 0; k < p->n_common; k++)
        sum += p->common[k].sensitivity[band] * p->common[k].sensitivity[band];
    return sqrt(sum);
}

static int write_point_row(struct session *s, struct point *p, struct err *e) {
    struct query *q;
    int rc = store_query(s->store, "INSERT INTO point VALUES (NULL,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)", &q, e);
    if (rc < 0)
        return rc;
    int at = 0;
    if (p->supersedes)
        query_bind_int(q, at++, p->supersedes);
    else
        query_bind_null(q, at++);
    query_bind_int(q, at++, p->provisional);
    query_bind_int(q, at++, p->exposure_id);
    query_bind_int(q, at++, p->bracket);
    query_bind_double(q, at++, p->tau_us);
    query_bind_double(q, at++, p->tau_r_us);
    query_bind_int(q, at++, p->theta_i_udeg);
    query_bind_int(q, at++, p->theta_v_udeg);
    query_bind_int(q, at++, p->saturated);
    query_bind_double(q, at++, p->scan_f);
    query_bind_int(q, at++, p->noisy);
    query_bind_double(q, at++, p->mean);
    query_bind_double(q, at++, p->mean_u_ind);
    query_bind_double(q, at++, session_common_mean(p));
    return query_insert(q, &p->id, e);
}

static int write_band(struct session *s, const struct point *p, int band, struct err *e) {
    struct query *q;
    int rc = store_query(s->store, "INSERT INTO point_band VALUES (?,?,?,?,?,?,?)", &q, e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, p->id);
    query_bind_int(q, 1, band);
    query_bind_double(q, 2, p->beta[band]);
    query_bind_double(q, 3, p->u_ind[band]);
    query_bind_double(q, 4, session_common_band(p, band));
    query_bind_double(q, 5, p->cov_next[band]);
    return query_insert(q, NULL, e);
}

static int write_common(struct session *s, const struct point *p, int k, struct err *e) {
    struct query *q;
    int rc = store_query(s->store, "INSERT INTO point_common VALUES (?,?,?,?,?,?)", &q, e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, p->id);
    query_bind_int(q, 1, k);
    query_bind_text(q, 2, p->common[k].name);
    query_bind_double(q, 3, p->common[k].mean);
    query_bind_bytes(q, 4, p->common[k].sensitivity, sizeof p->common[k].sensitivity);
    return query_insert(q, NULL, e);
}

static int write_point(struct session *s, struct point *p, struct err *e) {
    int rc = write_point_row(s, p, e);
    for (int band = 0; rc == 0 && band < BANDS; band++)
        if (p->present[band])
            rc = write_band(s, p, band, e);
    for (int k = 0; rc == 0 && k < p->n_common; k++)
        rc = write_common(s, p, k, e);
    return rc;
}

int session_add_point(struct session *s, struct point *p, struct err *e) {
    bool own;
    int rc = session_enter(s, &own, e);
    return rc < 0 ? rc : session_leave(s, own, write_point(s, p, e), e);
}

static int write_bracket(struct session *s, const struct bracket *b, struct err *e) {
    struct query *q;
    int rc = store_query(s->store, "INSERT INTO bracket VALUES (NULL,?,?,?,?,?,?,?,?)", &q, e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, b->number);
    query_bind_int(q, 1, b->open_us);
    query_bind_int(q, 2, b->close_us);
    query_bind_double(q, 3, b->mean_rate);
    query_bind_text(q, 4, b->ended_by);
    query_bind_int(q, 5, b->last_exposure_id);
    query_bind_bytes(q, 6, b->rate, sizeof b->rate);
    return query_insert(q, NULL, e);
}

int session_add_bracket(struct session *s, const struct bracket *b, struct err *e) {
    bool own;
    int rc = session_enter(s, &own, e);
    return rc < 0 ? rc : session_leave(s, own, write_bracket(s, b, e), e);
}

static int write_estimation(struct session *s, int64_t now_us, int64_t last_point_id,
                            const struct estimate *m, int64_t *id, struct err *e) {
    struct query *q;
    int rc = store_query(
        s->store,
        "INSERT INTO estimation VALUES (NULL,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)", &q, e);
    if (rc < 0)
        return rc;
    const double numbers[] = {m->chi2, m->bic, m->r2, m->median_relative_error, m->specular_energy};
    const double ranges[] = {m->theta_i_low_deg, m->theta_i_high_deg, m->theta_v_low_deg,
                             m->theta_v_high_deg};
    int at = 0;
    query_bind_int(q, at++, now_us);
    query_bind_int(q, at++, last_point_id);
    query_bind_text(q, at++, m->model);
    query_bind_int(q, at++, m->converged);
    query_bind_int(q, at++, m->provisional);
    query_bind_text(q, at++, m->refusal);
    query_bind_int(q, at++, m->n_points);
    query_bind_int(q, at++, m->n_parameters);
    query_bind_double(q, at++, m->kappa);
    query_bind_double(q, at++, m->q);
    query_bind_int(q, at++, m->mean_low_nm);
    query_bind_int(q, at++, m->mean_high_nm);
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++)
        query_bind_double(q, at++, numbers[i]);
    query_bind_int(q, at++, m->has_spectrum);
    query_bind_int(q, at++, m->band_first);
    query_bind_int(q, at++, m->band_last);
    for (size_t i = 0; i < sizeof ranges / sizeof ranges[0]; i++)
        query_bind_double(q, at++, ranges[i]);
    query_bind_bytes(q, at++, m->statistical, sizeof m->statistical);
    query_bind_bytes(q, at++, m->common, sizeof m->common);
    return query_insert(q, id, e);
}

static int write_parameter(struct session *s, int64_t id, const struct estimate *m, int at, struct err *e) {
    struct query *q;
    int rc =
        store_query(s->store, "INSERT INTO estimation_parameter VALUES (?,?,?,?,?,?,?,?,?,?,?,?)", &q, e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, id);
    query_bind_int(q, 1, at);
    query_bind_double(q, 2, m->value[at]);
    query_bind_double(q, 3, sqrt(m->statistical[at][at]));
    query_bind_double(q, 4, sqrt(m->common[at][at]));
    query_bind_int(q, 5, m->at_bound[at]);
    query_bind_double(q, 6, m->limit_95[at]);
    query_bind_int(q, 7, m->not_identifiable[at]);
    query_bind_text(q, 8, m->gap[at].why);
    query_bind_double(q, 9, m->gap[at].has_next ? m->gap[at].next_theta_i_deg : NAN);
    query_bind_double(q, 10, m->gap[at].has_next ? m->gap[at].next_theta_v_deg : NAN);
    return query_insert(q, NULL, e);
}

static int write_s_lambda(struct session *s, int64_t id, const struct estimate *m, int band, struct err *e) {
    struct query *q;
    int rc = store_query(s->store, "INSERT INTO estimation_spectrum VALUES (?,?,?,?,?)", &q, e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, id);
    query_bind_int(q, 1, band);
    query_bind_double(q, 2, m->s_lambda[band]);
    query_bind_double(q, 3, m->u_s_lambda[band]);
    return query_insert(q, NULL, e);
}

static int write_warning(struct session *s, int64_t id, int at, const char *text, struct err *e) {
    struct query *q;
    int rc = store_query(s->store, "INSERT INTO estimation_warning VALUES (?,?,?,?)", &q, e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, id);
    query_bind_int(q, 1, at);
    query_bind_text(q, 2, text);
    return query_insert(q, NULL, e);
}

static int write_estimate(struct session *s, int64_t now_us, int64_t last_point_id, const struct estimate *m,
                          struct err *e) {
    int64_t id = 0;
    int rc = write_estimation(s, now_us, last_point_id, m, &id, e);
    for (int at = 0; rc == 0 && at < MATERIAL_PARAMETERS; at++)
        rc = write_parameter(s, id, m, at, e);
    for (int band = 0; rc == 0 && m->has_spectrum && band < BANDS; band++)
        rc = write_s_lambda(s, id, m, band, e);
    for (int at = 0; rc == 0 && at < m->n_warnings; at++)
        rc = write_warning(s, id, at, m->warning[at], e);
    return rc < 0 ? rc : session_write_figures(s, id, m, e);
}

int session_add_estimate(struct session *s, int64_t now_us, int64_t last_point_id, const struct estimate *m,
                         struct err *e) {
    bool own;
    int rc = session_enter(s, &own, e);
    return rc < 0 ? rc : session_leave(s, own, write_estimate(s, now_us, last_point_id, m, e), e);
}

static int write_slopes(struct session *s, const struct point_slope *slope, size_t n, struct err *e) {
    struct query *q;
    int64_t newest = 0;
    int rc = store_number(s->store, "SELECT max(id) FROM estimation", 0, &newest, e);
    if (rc == 0)
        rc = store_query(s->store, "INSERT INTO estimation_point VALUES (?,?,?,?,?)", &q, e);
    for (size_t i = 0; rc == 0 && i < n; i++) {
        query_bind_int(q, 0, newest);
        query_bind_int(q, 1, slope[i].point_id);
        query_bind_double(q, 2, slope[i].source_per_deg);
        query_bind_double(q, 3, slope[i].sample_per_deg);
        rc = query_insert(q, NULL, e);
    }
    return rc;
}

int session_add_slopes(struct session *s, const struct point_slope *slope, size_t n, struct err *e) {
    bool own;
    int rc = session_enter(s, &own, e);
    return rc < 0 ? rc : session_leave(s, own, write_slopes(s, slope, n, e), e);
}

static int write_event(struct session *s, int64_t now_us, const char *kind, const char *json, struct err *e) {
    struct query *q;
    int rc = store_query(s->store, "INSERT INTO event VALUES (NULL,?,?,?,?)", &q, e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, now_us);
    query_bind_text(q, 1, kind);
    query_bind_text(q, 2, json ? json : "");
    return query_insert(q, NULL, e);
}

int session_add_event(struct session *s, int64_t now_us, const char *kind, const char *json, struct err *e) {
    bool own;
    int rc = session_enter(s, &own, e);
    return rc < 0 ? rc : session_leave(s, own, write_event(s, now_us, kind, json, e), e);
}
