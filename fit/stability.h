/*
 * stability.h — made-up measurements that are stiff, extreme or broken, and what the estimation makes of each.
 *
 * A case is a surface, the angles it is seen at, a noise, and something to spoil the points with. It is estimated in
 * a process of its own under a limit of seconds, so that a case can neither hang nor take the others along.
 * Judgement  GOOD: an estimate whose identifiable parameters lie within STABILITY_LIE_U of their stated u, and whose
 *            one-sided limits do not exclude the truth by more than three times their own length; or a parameter outside the
 *            bounds is said to be at one. REFUSED: no
 *            estimate, with the reason. LIES: neither. HANGS, CRASHES: what the child's end says.
 * Promises   the same seed gives the same points; the order of cases does not matter.
 * Errors     -ERR_NOMEM, -ERR_IO (no process could be started).
 * Source     reflection-model.md 2.3, 3; rendering.md 4.4 for the extremes of the parameters.
 * Checked    tests/unit/test_stability.c
 */
#ifndef FIT_STABILITY_H
#define FIT_STABILITY_H

#include "fit/dice.h"
#include "fit/estimate.h"

#define STABILITY_LIE_U 5

struct stability_points { /* [n], owned */
    size_t n;
    double *theta_i_deg, *theta_v_deg, *beta, *u;
};

struct stability_case {
    const char *group; /* "gamma against step" */
    char name[64];
    double value[MATERIAL_PARAMETERS]; /* the surface */
    double truth[MATERIAL_PARAMETERS]; /* what the points show: the surface, but where they were replaced */
    bool replaced;
    double theta_i_low_deg, theta_i_high_deg, theta_i_step_deg;
    double theta_v_first_deg, theta_v_step_deg; /* up to 80 */
    double noise_relative, noise_absolute;      /* sd of a point; the stated u is that of its noisy value */
    bool wide;                                  /* bounds far outside the usual ones */
    size_t n_max;                               /* of the points, drawn at random; 0: all */
    size_t n_times;                             /* each point so many times, with noise of its own; 0: once */
    void (*spoil)(struct stability_points *p, struct dice *dice);
};

enum stability_verdict {
    STABILITY_GOOD,
    STABILITY_REFUSED,
    STABILITY_LIES,
    STABILITY_HANGS,
    STABILITY_CRASHES
};

struct stability_result {
    enum stability_verdict verdict;
    struct estimate estimate;
    size_t n;
    char why[256];  /* a refusal's reason, or which parameter lies and how */
    double worst_u; /* largest |error| over u of what is claimed; NaN: nothing is */
    int worst;      /* its parameter, -1 */
    double apart_u; /* how far the two solvers end from each other, in stated u; NaN where none converged */
};

/* The cases, million points among them where large. Owned by the caller (free). */
int stability_cases(bool large, struct stability_case **cases, size_t *n, struct err *e);
int stability_run(const struct stability_case *c, uint64_t seed, unsigned limit_s,
                  struct stability_result *result, struct err *e);
const char *stability_word(enum stability_verdict verdict);

/* The parts of stability_run. */
int stability_points_make(const struct stability_case *c, uint64_t seed, struct stability_points *p,
                          struct err *e);
void stability_points_free(struct stability_points *p);
void stability_judge(const struct stability_case *c, struct stability_result *result);

#endif
