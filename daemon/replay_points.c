#include "daemon/replay_private.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/reduce.h"

struct geometry { /* of an exposure */
    int32_t theta_i_udeg, theta_v_udeg;
    bool mirrored;
    int step;
};

struct deriving {
    struct derived *d;
    struct geometry *of; /* [n_of] by exposure id */
    int64_t n_of;
    FILE *rows;
    int64_t n_points, n_brackets;
    struct bracket *bracket;
};

static int note_geometry(void *arg, const struct exposure *x) {
    struct deriving *g = arg;
    if (x->id >= g->n_of) {
        int64_t n = 2 * x->id + 64;
        struct geometry *larger = realloc(g->of, n * sizeof *larger);
        if (!larger)
            return -ERR_NOMEM;
        memset(larger + g->n_of, 0, (n - g->n_of) * sizeof *larger);
        g->of = larger;
        g->n_of = n;
    }
    g->of[x->id] = (struct geometry){x->theta_i_udeg, x->theta_v_udeg, x->mirrored, x->step};
    return 0;
}

static bool same_geometry(const struct derived_point *p, const struct geometry *g) {
    return p->theta_i_udeg == g->theta_i_udeg && p->theta_v_udeg == g->theta_v_udeg &&
           p->mirrored == g->mirrored;
}

static int cause_of(struct derived *d, const char *name) {
    for (int i = 0; i < d->n_causes; i++)
        if (!strcmp(d->cause[i], name))
            return i;
    char(*larger)[40] = realloc(d->cause, (d->n_causes + 1) * sizeof *larger);
    if (!larger)
        return -ERR_NOMEM;
    d->cause = larger;
    snprintf(d->cause[d->n_causes], sizeof *d->cause, "%s", name);
    return d->n_causes++;
}

static int add_commons(struct derived *d, struct derived_point *to, const struct point *p) {
    for (int i = 0; i < p->n_common; i++) {
        if (strcmp(p->common[i].name, "certificate") == 0)
            continue;
        int cause = cause_of(d, p->common[i].name);
        if (cause < 0)
            return cause;
        to->common[to->n_common].cause = cause;
        to->common[to->n_common++].mean = p->common[i].mean;
    }
    return 0;
}

static int add_point(struct deriving *g, const struct point *p) {
    struct derived *d = g->d;
    const struct geometry *at = &g->of[p->exposure_id];
    if (d->n == d->capacity) {
        int capacity = d->capacity ? 2 * d->capacity : 128;
        struct derived_point *larger = realloc(d->point, capacity * sizeof *larger);
        if (!larger)
            return -ERR_NOMEM;
        d->point = larger;
        d->capacity = capacity;
    }
    struct derived_point *to = &d->point[d->n];
    *to = (struct derived_point){.theta_i_udeg = at->theta_i_udeg,
                                 .theta_v_udeg = at->theta_v_udeg,
                                 .mirrored = at->mirrored,
                                 .step = at->step,
                                 .bracket = p->bracket,
                                 .exposure_id = p->exposure_id,
                                 .mean = p->mean,
                                 .variance = p->mean_u_ind * p->mean_u_ind,
                                 .tau_us = p->tau_us,
                                 .tau_r_us = p->tau_r_us};
    for (int i = 0; i < d->n; i++)
        to->nth += same_geometry(&d->point[i], at);
    d->n++;
    return add_commons(d, to, p);
}

static int take_point(void *arg, struct point *p, struct err *e) {
    static const char *const TABLES[] = {"point", "point_band", "point_common"};
    struct deriving *g = arg;
    p->id = ++g->n_points;
    for (int i = 0; i < 3; i++)
        session_print_point(g->rows, TABLES[i], p);
    if (p->provisional || p->saturated || !isfinite(p->mean) || !isfinite(p->mean_u_ind))
        return 0;
    return add_point(g, p) < 0 ? err_set(e, ERR_NOMEM, "no memory for the points") : 0;
}

static int take_bracket(void *arg, const struct bracket *b, struct err *e) {
    struct deriving *g = arg;
    struct bracket *larger = realloc(g->bracket, (g->n_brackets + 1) * sizeof *larger);
    if (!larger)
        return err_set(e, ERR_NOMEM, "no memory for the brackets");
    g->bracket = larger;
    g->bracket[g->n_brackets++] = *b;
    session_print_bracket(g->rows, g->n_brackets, b);
    return 0;
}

static void note_brackets(struct deriving *g) {
    for (int i = 0; i < g->d->n; i++)
        for (int64_t b = 0; b < g->n_brackets; b++) {
            struct derived_point *p = &g->d->point[i];
            const struct bracket *of = &g->bracket[b];
            if (of->number != p->bracket || !isfinite(of->mean_rate))
                continue;
            p->rate = of->mean_rate;
            p->length_us = (double)(of->close_us - of->open_us);
        }
}

static int derive(struct deriving *g, struct session *s, struct err *e) {
    struct reduce_sink sink = {.arg = g, .point = take_point, .bracket = take_bracket};
    int rc = session_each_exposure(s, note_geometry, g, e);
    if (rc == 0)
        rc = reduce_anew(s, &sink, e);
    if (rc == 0)
        note_brackets(g);
    return rc;
}

int derived_read(struct derived *d, const char *path, struct err *e) {
    struct session *s;
    struct deriving g = {.d = d};
    memset(d, 0, sizeof *d);
    int rc = session_open(&s, path, true, e);
    if (rc < 0)
        return rc;
    g.rows = open_memstream(&d->rows, &d->size);
    rc = g.rows ? derive(&g, s, e) : err_set(e, ERR_NOMEM, "no memory for the derived rows");
    if (g.rows)
        fclose(g.rows);
    session_close(s, NULL);
    free(g.of);
    free(g.bracket);
    return rc;
}

void derived_free(struct derived *d) {
    free(d->point);
    free(d->cause);
    free(d->rows);
}
