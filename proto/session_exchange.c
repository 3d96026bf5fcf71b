#include "proto/session_internal.h"

#include <stdio.h>
#include <string.h>

/* Exchanges are the most frequent row of a session: ten a second and axis, for hours. A poll's request is
 * stored once and named by its id; the row itself holds two times, the result and the reply. */

static uint32_t hash_bytes(const uint8_t *bytes, size_t size) {
    uint32_t h = 2166136261u; /* FNV-1a, 32 bit */
    for (size_t i = 0; i < size; i++)
        h = (h ^ bytes[i]) * 16777619u;
    return h;
}

static struct kept_request *find_kept(struct session *s, const char *link, const void *bytes, size_t size,
                                      uint32_t hash) {
    for (int i = 0; i < s->n_requests; i++) {
        struct kept_request *k = &s->request[i];
        if (k->hash == hash && k->size == size && strcmp(k->link, link) == 0 &&
            memcmp(k->bytes, bytes, size) == 0)
            return k;
    }
    return NULL;
}

static void keep(struct session *s, int64_t id, const char *link, const void *bytes, size_t size,
                 uint32_t hash) {
    struct kept_request *k = &s->request[s->next_request];
    if (size > sizeof k->bytes || strlen(link) >= sizeof k->link)
        return;
    k->id = id;
    k->hash = hash;
    k->size = size;
    snprintf(k->link, sizeof k->link, "%s", link);
    memcpy(k->bytes, bytes, size);
    s->next_request = (s->next_request + 1) % SESSION_REQUESTS_KEPT;
    if (s->n_requests < SESSION_REQUESTS_KEPT)
        s->n_requests++;
}

static int request_id(struct session *s, const char *link, const void *bytes, size_t size, int64_t *id,
                      struct err *e) {
    uint32_t hash = hash_bytes(bytes, size);
    const struct kept_request *kept = find_kept(s, link, bytes, size, hash);
    if (kept) {
        *id = kept->id;
        return 0;
    }
    struct query *q;
    int rc = store_query(s->store, "SELECT id FROM exchange_request WHERE link = ? AND request = ?", &q, e);
    if (rc < 0)
        return rc;
    query_bind_text(q, 0, link);
    query_bind_bytes(q, 1, bytes, size);
    rc = query_step(q, e);
    if (rc == 1)
        *id = query_int(q, 0);
    query_reset(q);
    if (rc == 0) {
        rc = store_query(s->store, "INSERT INTO exchange_request VALUES (NULL, ?, ?,?)", &q, e);
        if (rc < 0)
            return rc;
        query_bind_text(q, 0, link);
        query_bind_bytes(q, 1, bytes, size);
        rc = query_insert(q, id, e);
    }
    if (rc >= 0)
        keep(s, *id, link, bytes, size, hash);
    return rc < 0 ? rc : 0;
}

int session_add_exchange(struct session *s, int64_t sent_us, int64_t done_us, const char *link,
                         const void *request, size_t request_size, const void *reply, size_t reply_size,
                         int result, struct err *e) {
    bool own;
    int rc = session_enter(s, &own, e);
    if (rc < 0)
        return rc;
    int64_t id = 0;
    struct query *q;
    rc = request_id(s, link, request, request_size, &id, e);
    if (rc == 0)
        rc = store_query(s->store, "INSERT INTO exchange VALUES (NULL,?,?,?,?,?,?)", &q, e);
    if (rc == 0) {
        query_bind_int(q, 0, id);
        query_bind_int(q, 1, sent_us);
        query_bind_int(q, 2, done_us - sent_us);
        query_bind_int(q, 3, result);
        query_bind_bytes(q, 4, reply, reply_size);
        rc = query_insert(q, NULL, e);
    }
    return session_leave(s, own, rc, e);
}
