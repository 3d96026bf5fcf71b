#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "proto/session_internal.h"

static int write_head(struct session *s, int64_t id, const struct joint *j, struct err *e) {
    struct query *q;
    size_t size = joint_triangle(j->n) * sizeof(double);
    double *packed = malloc(2 * size + 1);
    int64_t at_bound = 0;
    int rc =
        packed ? store_query(s->store,
                             "INSERT INTO estimation_joint VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)", &q, e)
               : err_set(e, ERR_NOMEM, "%s: out of memory", s->path);
    if (rc < 0) {
        free(packed);
        return rc;
    }
    for (int p = 0; p < MATERIAL_PARAMETERS; p++)
        at_bound |= (int64_t)j->at_bound[p] << p;
    joint_pack(j->n, j->statistical, packed);
    joint_pack(j->n, j->common, packed + joint_triangle(j->n));
    int at = 0;
    query_bind_int(q, at++, id);
    query_bind_text(q, at++, j->model);
    query_bind_int(q, at++, j->converged);
    query_bind_text(q, at++, j->refusal);
    query_bind_int(q, at++, j->beta_prime_per_band);
    query_bind_int(q, at++, j->misfit);
    query_bind_int(q, at++, j->n_points);
    query_bind_int(q, at++, j->n_values);
    query_bind_int(q, at++, j->n_bands);
    query_bind_double(q, at++, j->kappa);
    query_bind_double(q, at++, j->chi2);
    query_bind_double(q, at++, j->chi2_expected);
    query_bind_int(q, at++, at_bound);
    query_bind_bytes(q, at++, j->value, sizeof j->value);
    query_bind_bytes(q, at++, packed, size);
    query_bind_bytes(q, at++, packed + joint_triangle(j->n), size);
    rc = query_insert(q, NULL, e);
    free(packed);
    return rc;
}

static double value_of(const struct joint *j, const struct joint_row *row) {
    return row->band < 0                  ? j->value[row->parameter]
           : row->parameter == MATERIAL_S ? j->s_lambda[row->band]
                                          : j->beta_prime[row->band];
}

static int write_joint_row(struct session *s, int64_t id, const struct joint *j, int i, struct err *e) {
    struct query *q;
    const struct joint_row *row = &j->row[i];
    size_t cell = (size_t)i * (size_t)(j->n + 1);
    int rc = store_query(s->store, "INSERT INTO estimation_joint_row VALUES (?,?,?,?,?,?,?,?)", &q, e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, id);
    query_bind_int(q, 1, i);
    query_bind_text(q, 2, material_parameter_name(j->model, row->parameter));
    if (row->band < 0)
        query_bind_null(q, 3);
    else
        query_bind_int(q, 3, row->band);
    query_bind_double(q, 4, value_of(j, row));
    query_bind_double(q, 5, j->statistical[cell]);
    query_bind_double(q, 6, j->common[cell]);
    return query_insert(q, NULL, e);
}

static void found_key(char key[40], int64_t id) {
    snprintf(key, 40, "joint_found/%lld", (long long)id);
}

/* What the fit found of the bench is a text of its own: the tables of this user_version have no column for it. */
static int write_found(struct session *s, int64_t id, const struct joint *j, struct err *e) {
    char key[40];
    found_key(key, id);
    json_t *json = joint_found_to_json(j);
    char *text = json_dumps(json, JSON_COMPACT | JSON_REAL_PRECISION(17));
    int rc = text ? session_set_text(s, key, text, e) : err_set(e, ERR_NOMEM, "%s: out of memory", s->path);
    free(text);
    json_decref(json);
    return rc;
}

static int read_found(struct session *s, int64_t id, struct joint *j, struct err *e) {
    char key[40], *text;
    found_key(key, id);
    int rc = session_get_text(s, key, &text, e);
    if (rc < 0 || !text)
        return rc;
    json_t *json = json_loads(text, 0, NULL);
    joint_found_from_json(json, j);
    json_decref(json);
    free(text);
    return 0;
}

static int write_joint(struct session *s, const struct joint *j, struct err *e) {
    int64_t newest = 0;
    int rc = store_number(s->store, "SELECT max(id) FROM estimation", 0, &newest, e);
    if (rc == 0)
        rc = write_head(s, newest, j, e);
    for (int i = 0; rc == 0 && i < j->n; i++)
        rc = write_joint_row(s, newest, j, i, e);
    if (rc == 0 && (j->u_mirror_offset_deg > 0 || j->u_polarisation > 0 || j->polarisation != 0))
        rc = write_found(s, newest, j, e);
    return rc;
}

int session_add_joint(struct session *s, const struct joint *joint, struct err *e) {
    bool own;
    int rc = session_enter(s, &own, e);
    return rc < 0 ? rc : session_leave(s, own, write_joint(s, joint, e), e);
}

static void read_head(struct query *q, struct joint *j, int64_t *id) {
    int at = 0;
    *id = query_int(q, at++);
    snprintf(j->model, sizeof j->model, "%s", query_text(q, at++));
    j->converged = query_int(q, at++) != 0;
    snprintf(j->refusal, sizeof j->refusal, "%s", query_text(q, at++));
    j->beta_prime_per_band = query_int(q, at++) != 0;
    j->misfit = query_int(q, at++) != 0;
    j->n_points = (int)query_int(q, at++);
    j->n_values = (int)query_int(q, at++);
    j->n_bands = (int)query_int(q, at++);
    j->kappa = query_double(q, at++);
    j->chi2 = query_double(q, at++);
    j->chi2_expected = query_double(q, at++);
    int64_t at_bound = query_int(q, at++);
    for (int p = 0; p < MATERIAL_PARAMETERS; p++)
        j->at_bound[p] = at_bound >> p & 1;
    session_take_doubles(q, at++, j->value, MATERIAL_PARAMETERS);
}

/* The rows' own values; S and beta' of a band that has no row are not known. */
static int read_rows(struct session *s, int64_t id, struct joint *j, int *n, struct err *e) {
    struct query *q;
    int rc = store_query(
        s->store,
        "SELECT parameter, band, value FROM estimation_joint_row WHERE estimation_id = ? ORDER BY at", &q, e);
    if (rc < 0)
        return rc;
    query_bind_int(q, 0, id);
    for (*n = 0; (rc = query_step(q, e)) == 1 && *n < JOINT_ROWS; ++*n) {
        struct joint_row *row = &j->row[*n];
        row->parameter = material_parameter_find(j->model, query_text(q, 0));
        if (row->parameter < 0) {
            query_reset(q);
            return err_set(e, ERR_INPUT,
                           "%s: its joint fit is damaged: a row names no parameter of its model", s->path);
        }
        row->band = query_type(q, 1) == QUERY_NULL ? -1 : (int)(query_int(q, 1) % BANDS);
        if (row->band >= 0)
            (row->parameter == MATERIAL_S ? j->s_lambda : j->beta_prime)[row->band] = query_double(q, 2);
    }
    query_reset(q);
    for (int b = 0; b < BANDS && !j->beta_prime_per_band; b++)
        j->beta_prime[b] = isfinite(j->s_lambda[b]) ? j->value[MATERIAL_BETA_PRIME] : NAN;
    return rc < 0 ? rc : 0;
}

static int read_matrices(struct session *s, int64_t id, struct joint *j, struct err *e) {
    struct query *q;
    double *packed = calloc(joint_triangle(j->n) + 1, sizeof *packed);
    int rc = packed ? store_query(s->store,
                                  "SELECT statistical, common FROM estimation_joint WHERE estimation_id = ?",
                                  &q, e)
                    : err_set(e, ERR_NOMEM, "%s: out of memory", s->path);
    if (rc == 0) {
        query_bind_int(q, 0, id);
        if ((rc = query_step(q, e)) == 1)
            for (int at = 0; at < 2; at++) {
                session_take_doubles(q, at, packed, joint_triangle(j->n));
                joint_unpack(j->n, packed, at ? j->common : j->statistical);
            }
        query_reset(q);
    }
    free(packed);
    return rc < 0 ? rc : 0;
}

static int read_newest(struct session *s, struct joint *j, int64_t *id, struct err *e) {
    struct query *q;
    int rc =
        store_prepare(s->store, "SELECT * FROM estimation_joint ORDER BY estimation_id DESC LIMIT 1", &q, e);
    if (rc < 0)
        return rc;
    if ((rc = query_step(q, e)) == 1)
        read_head(q, j, id);
    query_free(q);
    return rc;
}

int session_last_joint(struct session *s, struct joint *joint, struct err *e) {
    int64_t id = 0;
    int n = 0;
    *joint = (struct joint){0};
    for (int b = 0; b < BANDS; b++)
        joint->s_lambda[b] = joint->beta_prime[b] = NAN;
    int rc = session_has_table(s, "estimation_joint") ? read_newest(s, joint, &id, e) : 0;
    if (rc == 0)
        return err_set(e, ERR_STATE, "%s: holds no joint fit", s->path);
    if (rc < 0 || (rc = read_rows(s, id, joint, &n, e)) < 0 || (rc = read_found(s, id, joint, e)) < 0 ||
        (rc = joint_allocate(joint, n, e)) < 0)
        return rc;
    rc = read_matrices(s, id, joint, e);
    if (rc < 0)
        joint_free(joint);
    return rc;
}
