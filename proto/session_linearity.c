#include "proto/session_linearity.h"

#include <stdio.h>

#include "proto/session_internal.h"

static int write_linearity(struct session *s, struct linearity *l, struct err *e) {
    struct query *q;
    int rc =
        store_query(s->store, "INSERT INTO linearity VALUES (NULL,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?,?)", &q, e);
    if (rc < 0)
        return rc;
    const double numbers[] = {l->ratio,     l->u_ratio,     l->level_long, l->level_short,
                              l->error_rel, l->u_error_rel, l->prior_rel,  l->used_rel};
    int at = 0;
    query_bind_int(q, at++, l->step);
    query_bind_int(q, at++, l->long_id);
    query_bind_int(q, at++, l->short_id);
    query_bind_int(q, at++, l->long_us);
    query_bind_int(q, at++, l->short_us);
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++)
        query_bind_double(q, at++, numbers[i]);
    query_bind_double(q, at++, l->pull);
    query_bind_int(q, at++, l->beyond);
    return query_insert(q, &l->id, e);
}

int session_add_linearity(struct session *s, struct linearity *l, struct err *e) {
    bool own;
    int rc = session_enter(s, &own, e);
    return rc < 0 ? rc : session_leave(s, own, write_linearity(s, l, e), e);
}

static struct linearity linearity_row(struct query *q) {
    return (struct linearity){.id = query_int(q, 0),
                              .step = (int)query_int(q, 1),
                              .long_id = query_int(q, 2),
                              .short_id = query_int(q, 3),
                              .long_us = (int)query_int(q, 4),
                              .short_us = (int)query_int(q, 5),
                              .ratio = query_double(q, 6),
                              .u_ratio = query_double(q, 7),
                              .level_long = query_double(q, 8),
                              .level_short = query_double(q, 9),
                              .error_rel = query_double(q, 10),
                              .u_error_rel = query_double(q, 11),
                              .prior_rel = query_double(q, 12),
                              .used_rel = query_double(q, 13),
                              .pull = query_double(q, 14),
                              .beyond = query_int(q, 15) != 0};
}

int session_each_linearity(struct session *s, int (*seen)(void *arg, const struct linearity *l), void *arg,
                           struct err *e) {
    struct query *q;
    if (!session_has_table(s, "linearity"))
        return 0;
    int rc = store_prepare(s->store, "SELECT * FROM linearity ORDER BY id", &q, e);
    if (rc < 0)
        return rc;
    while ((rc = query_step(q, e)) == 1) {
        struct linearity l = linearity_row(q);
        if ((rc = seen(arg, &l)) != 0)
            break;
    }
    query_free(q);
    return rc;
}

void session_print_linearity(void *file, const struct linearity *l) {
    fprintf(file, "linearity\tid=%lld\tstep=%d\tlong_id=%lld\tshort_id=%lld\tlong_us=%d\tshort_us=%d",
            (long long)l->id, l->step, (long long)l->long_id, (long long)l->short_id, l->long_us,
            l->short_us);
    fprintf(file, "\tratio=%.17g\tu_ratio=%.17g\tlevel_long=%.17g\tlevel_short=%.17g", l->ratio, l->u_ratio,
            l->level_long, l->level_short);
    fprintf(file, "\terror_rel=%.17g\tu_error_rel=%.17g\tprior_rel=%.17g\tused_rel=%.17g", l->error_rel + 0.0,
            l->u_error_rel, l->prior_rel, l->used_rel);
    fprintf(file, "\tpull=%.17g\tbeyond=%d\n", l->pull + 0.0, l->beyond);
}
