/*
 * plan_parts.h — what the files of the planner hand to each other; nobody else includes it.
 *
 * plan_geometry: job -> points that can be measured, and refusals, by the rules of plan_rules (spots,
 * certificate, reach). plan_order: the order that saves travel. plan_route: a way round keep-out zones.
 * plan_steps: points in order -> steps in brackets. plan_time: how long each takes. Angles are microdegrees
 * in the axes' user coordinates.
 * Checked    tests/unit/test_plan.c, tests/unit/test_plan_random.c
 */
#ifndef DAEMON_PLAN_PARTS_H
#define DAEMON_PLAN_PARTS_H

#include "daemon/plan.h"

#define PLAN_POINTS_MAX 20000
#define PLAN_WHY 256 /* bytes of a reason */

struct plan_point {                     /* one geometry on its way to become steps */
    int32_t theta_i_udeg, theta_v_udeg; /* as measured */
    int32_t source_udeg, sample_udeg;
    bool mirrored, reciprocal;
    uint32_t samples;   /* bit i: on job.sample[i] */
    int reference_step; /* every_geometry: its own reading of the diffuser */
};

struct plan_points {
    struct plan_point *item;
    int n, capacity;
};

#define PLAN_TRAVEL_UDEG 250000 /* resolution of the table of move times that orders points */
#define PLAN_TRAVEL (1440 + 2)

struct planner {
    const struct job *job;
    const struct config *config;
    const struct plan_devices *devices;
    struct plan *plan;
    struct err_list *errors;
    struct plan_points points;
    int n_darks;
    int64_t travel_us[2][PLAN_TRAVEL]; /* source, sample */
};

struct plan_pose { /* where everything stands */
    int32_t source_udeg, sample_udeg, holder_udeg;
};

/* plan_rules.c: each says why not. */
bool plan_spots_nest(const struct config *config, int32_t theta_i_udeg, int32_t theta_v_udeg,
                     char why[PLAN_WHY]);
bool plan_spot_on(const struct config *config, int32_t theta_i_udeg, int32_t theta_v_udeg,
                  const double size_mm[2], const char *surface, char why[PLAN_WHY]); /* the inner spot */
bool plan_certified(const struct planner *p, int32_t theta_i_udeg, int32_t theta_v_udeg, char why[PLAN_WHY]);
bool plan_reach(const struct planner *p, int32_t theta_i_udeg, int32_t theta_v_udeg, bool mirrored,
                struct plan_point *point, char why[PLAN_WHY]);

/* plan_geometry.c */
bool plan_resolve(const struct planner *p, int32_t theta_i_udeg, int32_t theta_v_udeg,
                  struct plan_point *point, char why[PLAN_WHY]);
/* The control geometry of points of this incidence. */
bool plan_control(const struct planner *p, int32_t theta_i_udeg, struct plan_point *point,
                  char why[PLAN_WHY]);
int plan_list_geometries(struct planner *p);

/* plan_time.c */
int64_t plan_axis_time_us(const struct planner *p, enum stage_axis axis, int32_t distance_udeg);
int64_t plan_move_time_us(const struct planner *p, const struct plan_pose *from, const struct plan_pose *to);
/* One set of scans after a change of state: `average` kept, the model's discards, idle cycles, read-outs. */
int64_t plan_set_time_us(const struct planner *p, double exposure_us);
int64_t plan_reading_time_us(const struct planner *p); /* a set at the middle exposure */
int64_t plan_hold_time_us(void);
bool plan_spans(const struct planner *p); /* the job's exposures differ enough for a test of linearity */
void plan_travel_table(struct planner *p);
void plan_costs(struct planner *p); /* totals: time with interval, exposures, bytes */

/* plan_order.c: per incidence and by angles turned to by hand where those apply, else freely. */
int plan_order(const struct planner *p, struct plan_point *point, int n);

/* plan_route.c */
bool plan_in_zone(const struct planner *p, int32_t source_udeg, int32_t sample_udeg);
bool plan_way_clear(const struct planner *p, const struct plan_pose *from, const struct plan_pose *to);
/* Fills via where the straight way touches a zone; the number of stops, or -1 where there is no way. */
int plan_route(const struct planner *p, const struct plan_pose *from, const struct plan_pose *to,
               struct stage_target via[PLAN_VIA]);

/* plan_steps.c: p->points in order -> plan->step. */
int plan_build_steps(struct planner *p);

#endif
