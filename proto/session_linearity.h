/*
 * session_linearity.h — the linearity of the light path, as one geometry read at two exposure times shows it.
 *
 * error_rel is the error that makes the rates of both readings agree in all bands, if a count of level L (share of full
 * scale) reads (1 + error_rel L) times too much. ratio = 1 + error_rel (level_long - level_short) is the rate of the
 * long reading over that of the short one where the light is: 1 for a path that is linear in level and time.
 *
 * u          counting and read noise of both sets and their darks, and the lamp's drift between them.
 * pull       error_rel over what its u and the prior together allow.
 * used_rel   what the reduction takes from here on as u of the linearised counts at full scale: the prior, or what
 *            was seen beyond its own noise where that is more.
 * Errors     as in session.h
 * Checked    tests/unit/test_reduce_linearity.c, tests/scenario/test_overlap.c
 */
#ifndef PROTO_SESSION_LINEARITY_H
#define PROTO_SESSION_LINEARITY_H

#include "proto/session.h"

struct linearity {
    int64_t id;
    int step;
    int64_t long_id, short_id; /* exposures */
    int long_us, short_us;
    double ratio, u_ratio;
    double level_long, level_short; /* share of full scale, averaged over the light */
    double error_rel, u_error_rel;  /* at full scale */
    double prior_rel, used_rel;
    double pull;
    bool beyond; /* more than the prior and chance explain: a warning */
};

int session_add_linearity(struct session *s, struct linearity *l, struct err *e);
int session_each_linearity(struct session *s, int (*seen)(void *arg, const struct linearity *l), void *arg,
                           struct err *e);
/* The line that session_dump prints for such a row. */
void session_print_linearity(void *file, const struct linearity *l);

#endif
