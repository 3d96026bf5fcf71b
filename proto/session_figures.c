/* What an estimate says of its instrument and of its own quality: tables that a file of an older goniod lacks. */
#include <math.h>
#include <string.h>

#include "proto/session_internal.h"

#define OF(member) offsetof(struct estimate, member)

/* In the order of the columns, behind estimation_id and beam_in_view. */
static const size_t INSTRUMENT[] = {OF(source_width_deg),
                                    OF(sensor_width_deg),
                                    OF(mirror_offset_deg),
                                    OF(u_mirror_offset_deg),
                                    OF(zero_source_deg),
                                    OF(zero_sample_deg),
                                    OF(polarisation),
                                    OF(u_polarisation),
                                    OF(polarisation_span.p_limit),
                                    OF(polarisation_span.n[0]),
                                    OF(polarisation_span.n[1]),
                                    OF(polarisation_span.beta_prime[0]),
                                    OF(polarisation_span.beta_prime[1])};
/* Likewise behind estimation_id, iterations and minimised; enum material_loss gives their order. */
static const size_t QUALITY[] = {OF(condition),
                                 OF(n_effective),
                                 OF(loio),
                                 OF(loss[MATERIAL_LOSS_ML]),
                                 OF(loss[MATERIAL_LOSS_OLS]),
                                 OF(loss[MATERIAL_LOSS_LOG]),
                                 OF(loss[MATERIAL_LOSS_CUBEROOT]),
                                 OF(loss[MATERIAL_LOSS_COSINE])};
#define LENGTH(list) (int)(sizeof(list) / sizeof *(list))

static double *figure(struct estimate *m, size_t offset) {
    return (double *)(void *)((char *)m + offset);
}

static void bind_figures(struct query *q, int at, const struct estimate *m, const size_t *offset, int n) {
    for (int i = 0; i < n; i++)
        query_bind_double(q, at + i, *(const double *)(const void *)((const char *)m + offset[i]));
}

static void take_figures(struct query *q, int at, struct estimate *m, const size_t *offset, int n) {
    for (int i = 0; i < n; i++)
        *figure(m, offset[i]) = query_double(q, at + i);
}

static int write_instrument(struct session *s, int64_t id, const struct estimate *m, struct err *e) {
    struct query *q;
    int rc = store_query(s->store,
                         "INSERT INTO estimation_instrument VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)", &q, e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, id);
    query_bind_int(q, 1, m->beam_in_view);
    bind_figures(q, 2, m, INSTRUMENT, LENGTH(INSTRUMENT));
    return query_insert(q, NULL, e);
}

static int write_quality(struct session *s, int64_t id, const struct estimate *m, struct err *e) {
    struct query *q;
    int rc = store_query(s->store, "INSERT INTO estimation_quality VALUES (?,?,?,?,?,?,?,?,?,?,?,?)", &q, e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, id);
    query_bind_int(q, 1, m->iterations);
    query_bind_text(q, 2, material_loss_name(m->minimised));
    bind_figures(q, 3, m, QUALITY, LENGTH(QUALITY));
    return query_insert(q, NULL, e);
}

int session_write_figures(struct session *s, int64_t id, const struct estimate *m, struct err *e) {
    int rc = write_instrument(s, id, m, e);
    return rc < 0 ? rc : write_quality(s, id, m, e);
}

static int read_instrument(struct session *s, int64_t id, struct estimate *m, struct err *e) {
    struct query *q;
    int rc = store_query(s->store, "SELECT * FROM estimation_instrument WHERE estimation_id = ?", &q, e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, id);
    if ((rc = query_step(q, e)) == 1) {
        m->beam_in_view = query_int(q, 1) != 0;
        take_figures(q, 2, m, INSTRUMENT, LENGTH(INSTRUMENT));
    }
    query_reset(q);
    return rc < 0 ? rc : 0;
}

static int read_quality(struct session *s, int64_t id, struct estimate *m, struct err *e) {
    struct query *q;
    int rc = store_query(s->store, "SELECT * FROM estimation_quality WHERE estimation_id = ?", &q, e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, id);
    if ((rc = query_step(q, e)) == 1) {
        m->iterations = (int)query_int(q, 1);
        const enum material_loss loss = material_loss_find(query_text(q, 2));
        m->minimised = loss < MATERIAL_LOSSES ? loss : MATERIAL_LOSS_ML;
        take_figures(q, 3, m, QUALITY, LENGTH(QUALITY));
    }
    query_reset(q);
    return rc < 0 ? rc : 0;
}

int session_read_figures(struct session *s, int64_t id, struct estimate *m, struct err *e) {
    for (int i = 0; i < MATERIAL_LOSSES; i++)
        m->loss[i] = NAN; /* not known: an older goniod did not keep them */
    if (!session_has_table(s, "estimation_quality"))
        return 0;
    int rc = read_instrument(s, id, m, e);
    return rc < 0 ? rc : read_quality(s, id, m, e);
}

/* ---- several models of the same points ---- */

static int write_models(struct session *s, const char *json, struct err *e) {
    struct query *q;
    int64_t newest = 0;
    int rc = store_number(s->store, "SELECT max(id) FROM estimation", 0, &newest, e);
    if (rc == 0)
        rc = store_query(s->store, "INSERT INTO estimation_models VALUES (?,?,?)", &q, e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, newest);
    query_bind_text(q, 1, json);
    return query_insert(q, NULL, e);
}

int session_add_models(struct session *s, const char *json, struct err *e) {
    bool own;
    int rc = session_enter(s, &own, e);
    return rc < 0 ? rc : session_leave(s, own, write_models(s, json, e), e);
}

int session_last_models(struct session *s, char **json, struct err *e) {
    struct query *q;
    *json = NULL;
    if (!session_has_table(s, "estimation_models"))
        return 0;
    int rc = store_query(s->store,
                         "SELECT json FROM estimation_models WHERE estimation_id = (SELECT max(id) FROM "
                         "estimation)",
                         &q, e);
    if (rc < 0)
        return rc;
    if ((rc = query_step(q, e)) == 1) {
        *json = strdup(query_text(q, 0));
        rc = *json ? 0 : err_set(e, ERR_NOMEM, "%s: out of memory", s->path);
    }
    query_reset(q);
    return rc;
}
