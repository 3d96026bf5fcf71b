/*
 * plan_walk.h — one walk along the bench while steps are written down: what stands where, and what time it is.
 *
 * A walk knows the pose of the axes, which surface is mounted at each place of the holder, when the last dark
 * was taken and when the bracket was opened. It adds the holds that a reading needs first. A copy of a walk
 * goes on from there on its own: with plan->n_steps put back, a trial leaves no trace.
 * Checked    tests/unit/test_plan.c
 */
#ifndef DAEMON_PLAN_WALK_H
#define DAEMON_PLAN_WALK_H

#include "daemon/plan_parts.h"

#define PLAN_REFERENCE (-1) /* a surface: the diffuser; 0 and up are samples */
#define PLAN_NOTHING (-2)

struct plan_walk {
    struct planner *p;
    struct plan_pose pose;
    bool turned;                   /* pose.sample_udeg of a manual axis is known */
    int mounted[CONFIG_POSITIONS]; /* surface at each place; a manual holder has place 0 alone */
    int64_t now_us, last_dark_us, open_us;
    int n_darks;
    int bracket;       /* number of the last one opened */
    int control_step;  /* reading that opened it */
    bool may_share;    /* the last step is a closing reading */
    struct step spare; /* written to and forgotten when memory is out */
    int rc;            /* the first failure */
};

void plan_walk_init(struct plan_walk *w, struct planner *p, const int *sample, int n);
int plan_walk_place(const struct planner *p, int surface); /* -1: the holder has no such position */
/* Whether a person has to exchange the diffuser and this sample in every bracket. */
bool plan_walk_by_hand(const struct plan_walk *w, int sample);
/* Time a motorised holder needs from one surface to another. */
int64_t plan_walk_swap_us(const struct planner *p, int from, int to);
void plan_walk_start(struct plan_walk *w, const struct plan_point *control); /* first holds, warm-up */
/* Two readings of the diffuser there, with a dark of the second's exposure time. */
void plan_walk_overlap(struct plan_walk *w, const struct plan_point *control);
void plan_walk_open(struct plan_walk *w, const struct plan_point *control);
void plan_walk_close(struct plan_walk *w, const struct plan_point *control);
int plan_walk_reference(struct plan_walk *w, const struct plan_point *point, bool control, bool repeat);
void plan_walk_sample(struct plan_walk *w, int sample, const struct plan_point *point, bool repeat);
void plan_walk_park(struct plan_walk *w);

#endif
