#include "proto/session_internal.h"

#include <math.h>
#include <stdio.h>

static void estimation_row(struct query *q, struct estimate *m) {
    double *const numbers[] = {&m->chi2, &m->bic, &m->r2, &m->median_relative_error, &m->specular_energy};
    double *const ranges[] = {&m->theta_i_low_deg, &m->theta_i_high_deg, &m->theta_v_low_deg,
                              &m->theta_v_high_deg};
    int at = 3;
    snprintf(m->model, sizeof m->model, "%s", query_text(q, at++));
    m->converged = query_int(q, at++) != 0;
    m->provisional = query_int(q, at++) != 0;
    snprintf(m->refusal, sizeof m->refusal, "%s", query_text(q, at++));
    m->n_points = (int)query_int(q, at++);
    m->n_parameters = (int)query_int(q, at++);
    m->kappa = query_double(q, at++);
    m->q = query_double(q, at++);
    m->mean_low_nm = (int)query_int(q, at++);
    m->mean_high_nm = (int)query_int(q, at++);
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++)
        *numbers[i] = query_double(q, at++);
    m->has_spectrum = query_int(q, at++) != 0;
    m->band_first = (int)query_int(q, at++);
    m->band_last = (int)query_int(q, at++);
    for (size_t i = 0; i < sizeof ranges / sizeof ranges[0]; i++)
        *ranges[i] = query_double(q, at++);
    session_take_doubles(q, at++, &m->statistical[0][0], MATERIAL_PARAMETERS * MATERIAL_PARAMETERS);
    session_take_doubles(q, at++, &m->common[0][0], MATERIAL_PARAMETERS * MATERIAL_PARAMETERS);
}

static void parameter_row(struct query *q, struct estimate *m) {
    int64_t at = query_int(q, 0);
    if (at < 0 || at >= MATERIAL_PARAMETERS)
        return;
    m->value[at] = query_double(q, 1);
    m->at_bound[at] = query_int(q, 2) != 0;
    m->limit_95[at] = query_double(q, 3);
    m->not_identifiable[at] = query_int(q, 4) != 0;
    struct material_gap *gap = &m->gap[at];
    snprintf(gap->why, sizeof gap->why, "%s", query_text(q, 5));
    gap->has_next = query_type(q, 6) != QUERY_NULL;
    gap->next_theta_i_deg = gap->has_next ? query_double(q, 6) : 0;
    gap->next_theta_v_deg = gap->has_next ? query_double(q, 7) : 0;
}

static void s_lambda_row(struct query *q, struct estimate *m) {
    int64_t band = query_int(q, 0);
    if (band < 0 || band >= BANDS)
        return;
    m->s_lambda[band] = query_double(q, 1);
    m->u_s_lambda[band] = query_double(q, 2);
}

static void warning_row(struct query *q, struct estimate *m) {
    if (m->n_warnings < MATERIAL_WARNINGS)
        snprintf(m->warning[m->n_warnings++], sizeof m->warning[0], "%s", query_text(q, 0));
}

static int each_of(struct session *s, const char *sql, int64_t id,
                   void (*row)(struct query *q, struct estimate *m), struct estimate *m, struct err *e) {
    struct query *q;
    int rc = store_query(s->store, sql, &q, e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, id);
    while ((rc = query_step(q, e)) == 1)
        row(q, m);
    query_reset(q);
    return rc;
}

static int read_details(struct session *s, int64_t id, struct estimate *m, struct err *e) {
    int rc = each_of(s,
                     "SELECT at, value, at_bound, limit_95, not_identifiable, why, next_theta_i_deg,"
                     " next_theta_v_deg FROM estimation_parameter"
                     " WHERE estimation_id = ?",
                     id, parameter_row, m, e);
    if (rc == 0)
        rc = each_of(s, "SELECT band, s, u_s FROM estimation_spectrum WHERE estimation_id = ?", id,
                     s_lambda_row, m, e);
    if (rc == 0)
        rc = each_of(s, "SELECT text FROM estimation_warning WHERE estimation_id = ? ORDER BY at", id,
                     warning_row, m, e);
    return rc < 0 ? rc : session_read_figures(s, id, m, e);
}

static int walk_estimates(struct session *s, const char *sql,
                          int (*seen)(void *arg, int64_t us, int64_t last_point_id, const struct estimate *m),
                          void *arg, struct err *e) {
    struct query *q;
    int rc = store_prepare(s->store, sql, &q, e);
    if (rc < 0)
        return rc;
    while ((rc = query_step(q, e)) == 1) {
        struct estimate m = {0};
        estimation_row(q, &m);
        rc = read_details(s, query_int(q, 0), &m, e);
        if (rc == 0)
            rc = seen(arg, query_int(q, 1), query_int(q, 2), &m);
        if (rc != 0)
            break;
    }
    query_free(q);
    return rc;
}

int session_each_estimate(struct session *s,
                          int (*seen)(void *arg, int64_t us, int64_t last_point_id, const struct estimate *m),
                          void *arg, struct err *e) {
    return walk_estimates(s, "SELECT * FROM estimation ORDER BY id", seen, arg, e);
}

struct last {
    struct estimate *estimate;
    bool found;
};

static int take_last(void *arg, int64_t us, int64_t last_point_id, const struct estimate *m) {
    (void)us;
    (void)last_point_id;
    struct last *last = arg;
    *last->estimate = *m;
    last->found = true;
    return 0;
}

int session_last_estimate(struct session *s, struct estimate *m, struct err *e) {
    struct last last = {.estimate = m};
    int rc = walk_estimates(s, "SELECT * FROM estimation ORDER BY id DESC LIMIT 1", take_last, &last, e);
    if (rc == 0 && !last.found)
        return err_set(e, ERR_STATE, "%s: holds no estimate yet", s->path);
    return rc;
}
