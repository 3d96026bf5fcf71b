/*
 * judgement.h — the final points of a session against the simulator's truth, in units of what they state.
 *
 * pull = (visible mean - true mean) / u, with u of the independent part, all common parts, the slope of the truth
 * times the angles' uncertainty (sim_config_default), and lamp drift within a bracket of 15 min.
 */
#ifndef TESTS_SUPPORT_JUDGEMENT_H
#define TESTS_SUPPORT_JUDGEMENT_H

#include "proto/session.h"
#include "sim/sim.h"

#define JUDGED_MAX 256

struct judgement {
    struct sim_surface surface; /* filled in before */
    int n, provisional;
    double sum, sum2, worst; /* of the pulls; worst in absolute value */
    double mean[JUDGED_MAX];
    int32_t at[JUDGED_MAX][2]; /* theta_i, theta_v from readbacks */
};

void judge_session(struct session *s, struct judgement *j);
/* The same against Hooker's Green as the simulator paints it; fills in the surface. */
void judge_green(struct session *s, const char *support, int water_percent, struct judgement *j);

#endif
