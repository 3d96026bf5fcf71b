#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/plan_parts.h"
#include "proto/units.h"

#define GRAZING_UDEG 89000000 /* as the job's own limit */
#define SEARCH_MAX 1e8        /* looks at a point; beyond it nobody would stand there to turn the sample */

/* Both axes negated is the same geometry mirrored; by reciprocity, so is the exchange of source and sensor.
 */
bool plan_resolve(const struct planner *p, int32_t theta_i_udeg, int32_t theta_v_udeg,
                  struct plan_point *point, char why[PLAN_WHY]) {
    char other[PLAN_WHY];
    if (plan_reach(p, theta_i_udeg, theta_v_udeg, false, point, why) ||
        plan_reach(p, theta_i_udeg, theta_v_udeg, true, point, other))
        return true;
    bool source_alone = p->config->sample.kind == CONFIG_AXIS_FIXED;
    if (!source_alone || !p->job->geometry.reciprocity)
        return false;
    int32_t swapped_i = abs(theta_v_udeg), swapped_v = theta_v_udeg < 0 ? -theta_i_udeg : theta_i_udeg;
    if (!plan_reach(p, swapped_i, swapped_v, false, point, other) &&
        !plan_reach(p, swapped_i, swapped_v, true, point, other))
        return false;
    point->reciprocal = true;
    return true;
}

static bool diffuser_fits(const struct planner *p, int32_t theta_i_udeg, int32_t theta_v_udeg,
                          char why[PLAN_WHY]) {
    double size = p->job->reference.size_mm > 0 ? p->job->reference.size_mm : INFINITY;
    return plan_spots_nest(p->config, theta_i_udeg, theta_v_udeg, why) &&
           plan_spot_on(p->config, theta_i_udeg, theta_v_udeg, (double[2]){size, size}, "the diffuser",
                        why) &&
           plan_certified(p, theta_i_udeg, theta_v_udeg, why);
}

bool plan_control(const struct planner *p, int32_t theta_i_udeg, struct plan_point *point,
                  char why[PLAN_WHY]) {
    const struct job_reference *reference = &p->job->reference;
    int32_t theta_v_udeg = udeg_from_deg(reference->theta_v_deg);
    if (reference->mode != REFERENCE_PER_INCIDENCE)
        theta_i_udeg = udeg_from_deg(reference->theta_i_deg);
    char cause[PLAN_WHY];
    /* The certificate speaks of the geometry as it is, not of its reciprocal. */
    if (plan_resolve(p, theta_i_udeg, theta_v_udeg, point, cause) && !point->reciprocal &&
        diffuser_fits(p, theta_i_udeg, theta_v_udeg, cause))
        return true;
    snprintf(why, PLAN_WHY, "the diffuser cannot be read at %g:%g: %.180s", deg_from_udeg(theta_i_udeg),
             deg_from_udeg(theta_v_udeg), cause);
    return false;
}

static int refuse(struct planner *p, int sample, int32_t theta_i_udeg, int32_t theta_v_udeg,
                  const char *why) {
    struct plan *plan = p->plan;
    struct refusal *grown = realloc(plan->refusal, (size_t)(plan->n_refusals + 1) * sizeof *grown);
    if (!grown)
        return -ERR_NOMEM;
    plan->refusal = grown;
    struct refusal *refusal = &grown[plan->n_refusals++];
    *refusal = (struct refusal){sample, deg_from_udeg(theta_i_udeg), deg_from_udeg(theta_v_udeg), ""};
    snprintf(refusal->why, sizeof refusal->why, "%s", why);
    return 0;
}

/* A point is divided by a reading of the diffuser: at its own geometry, or at that of its bracket. */
static bool has_reference(const struct planner *p, const struct plan_point *point, char why[PLAN_WHY]) {
    struct plan_point control;
    char cause[PLAN_WHY];
    if (p->job->reference.mode == REFERENCE_PER_INCIDENCE)
        return plan_control(p, point->theta_i_udeg, &control, why);
    if (p->job->reference.mode != REFERENCE_EVERY_GEOMETRY ||
        diffuser_fits(p, point->theta_i_udeg, point->theta_v_udeg, cause))
        return true;
    snprintf(why, PLAN_WHY, "no reading of the diffuser: %.180s", cause);
    return false;
}

static bool can_be_reached(const struct planner *p, const struct plan_point *point, char why[PLAN_WHY]) {
    struct plan_point control;
    if (p->config->n_keep_out == 0 || !plan_control(p, point->theta_i_udeg, &control, why))
        return p->config->n_keep_out == 0;
    struct stage_target via[PLAN_VIA];
    struct plan_pose from = {control.source_udeg, control.sample_udeg, 0};
    struct plan_pose to = {point->source_udeg, point->sample_udeg, 0};
    if (plan_route(p, &from, &to, via) >= 0)
        return true;
    snprintf(why, PLAN_WHY, "keep-out zone: no way round it from where the diffuser is read");
    return false;
}

static int sort_out(struct planner *p, int32_t theta_i_udeg, int32_t theta_v_udeg, struct plan_point *point) {
    char why[PLAN_WHY] = "";
    if (!plan_resolve(p, theta_i_udeg, theta_v_udeg, point, why) ||
        !plan_spots_nest(p->config, point->theta_i_udeg, point->theta_v_udeg, why) ||
        !has_reference(p, point, why) || !can_be_reached(p, point, why)) {
        point->samples = 0;
        return refuse(p, -1, theta_i_udeg, theta_v_udeg, why);
    }
    int rc = 0;
    for (int i = 0; i < p->job->n_samples; i++) {
        const struct job_sample *sample = &p->job->sample[i];
        if (plan_spot_on(p->config, point->theta_i_udeg, point->theta_v_udeg, sample->size_mm, sample->name,
                         why))
            point->samples |= 1u << i;
        else if (rc == 0)
            rc = refuse(p, i, theta_i_udeg, theta_v_udeg, why);
    }
    return rc;
}

static int add_asked(struct planner *p, double theta_i_deg, double theta_v_deg) {
    struct plan_points *points = &p->points;
    if (points->n == points->capacity) {
        int capacity = points->capacity ? 2 * points->capacity : 256;
        struct plan_point *grown = realloc(points->item, (size_t)capacity * sizeof *grown);
        if (!grown)
            return -ERR_NOMEM;
        points->item = grown;
        points->capacity = capacity;
    }
    points->item[points->n++] = (struct plan_point){.theta_i_udeg = udeg_from_deg(theta_i_deg),
                                                    .theta_v_udeg = udeg_from_deg(theta_v_deg)};
    return 0;
}

/* Around the mirror direction, where a glossy lobe needs smaller steps; not beyond the views asked for. */
static int add_refinement(struct planner *p, double theta_i_deg) {
    const struct job_geometry *g = &p->job->geometry;
    bool range = g->n_theta_v > 1;
    int32_t low = range ? udeg_from_deg(g->theta_v_deg[0]) : -GRAZING_UDEG;
    int32_t high = range ? udeg_from_deg(g->theta_v_deg[g->n_theta_v - 1]) : GRAZING_UDEG;
    int steps = (int)floor(g->mirror_half_width_deg / g->mirror_step_deg + 1e-9), rc = 0;
    for (int k = -steps; k <= steps && rc == 0; k++) {
        int32_t theta_v_udeg = udeg_from_deg(theta_i_deg + k * g->mirror_step_deg);
        if (theta_v_udeg >= low && theta_v_udeg <= high)
            rc = add_asked(p, theta_i_deg, deg_from_udeg(theta_v_udeg));
    }
    return rc;
}

static int list_asked(struct planner *p) {
    const struct job_geometry *g = &p->job->geometry;
    double per_incidence =
        g->n_theta_v + (g->mirror_step_deg > 0 ? 2 * g->mirror_half_width_deg / g->mirror_step_deg + 1 : 0);
    if (g->n_theta_i * per_incidence > PLAN_POINTS_MAX) {
        job_complain(p->job, p->errors, "geometry", "%.0f geometries are too many: a plan holds at most %d",
                     g->n_theta_i * per_incidence, PLAN_POINTS_MAX);
        return -ERR_INPUT;
    }
    int rc = 0;
    for (int i = 0; i < g->n_pairs && rc == 0; i++)
        rc = add_asked(p, g->pair_deg[i][0], g->pair_deg[i][1]);
    for (int i = 0; i < g->n_theta_i && rc == 0; i++) {
        for (int v = 0; v < g->n_theta_v && rc == 0; v++)
            rc = add_asked(p, g->theta_i_deg[i], g->theta_v_deg[v]);
        if (g->mirror_step_deg > 0 && rc == 0)
            rc = add_refinement(p, g->theta_i_deg[i]);
    }
    return rc;
}

static int by_geometry(const void *a, const void *b) {
    const struct plan_point *x = a, *y = b;
    if (x->theta_i_udeg != y->theta_i_udeg)
        return x->theta_i_udeg < y->theta_i_udeg ? -1 : 1;
    if (x->theta_v_udeg != y->theta_v_udeg)
        return x->theta_v_udeg < y->theta_v_udeg ? -1 : 1;
    return x->reciprocal - y->reciprocal;
}

/* Sorted by geometry, each once; a point asked for directly stays before its reciprocal twin. */
static void sort_unique(struct plan_points *points) {
    qsort(points->item, (size_t)points->n, sizeof *points->item, by_geometry);
    int kept = 0;
    for (int i = 0; i < points->n; i++) {
        const struct plan_point *last = kept > 0 ? &points->item[kept - 1] : NULL;
        if (!last || last->theta_i_udeg != points->item[i].theta_i_udeg ||
            last->theta_v_udeg != points->item[i].theta_v_udeg)
            points->item[kept++] = points->item[i];
    }
    points->n = kept;
}

/* Of the angles a person may turn the sample to, the one at which most of the open points can be measured. */
static int32_t best_angle(const struct planner *p, const bool *open, const int32_t *angle, int n_angles) {
    int best = -1, best_count = 0;
    for (int a = 0; a < n_angles; a++) {
        int count = 0;
        for (int i = 0; i < p->points.n; i++)
            count += open[i] && abs(p->points.item[i].theta_v_udeg) == abs(angle[a]) &&
                     plan_reach(p, p->points.item[i].theta_i_udeg, p->points.item[i].theta_v_udeg,
                                p->points.item[i].theta_v_udeg != angle[a], &(struct plan_point){0},
                                (char[PLAN_WHY]){0});
        if (count > best_count) {
            best = a;
            best_count = count;
        }
    }
    return best < 0 ? INT32_MIN : angle[best];
}

static void take_angle(struct planner *p, bool *open, int32_t angle_udeg) {
    for (int i = 0; i < p->points.n; i++) {
        struct plan_point *point = &p->points.item[i], turned;
        bool mirrored = point->theta_v_udeg != angle_udeg;
        if (!open[i] || abs(point->theta_v_udeg) != abs(angle_udeg) ||
            !plan_reach(p, point->theta_i_udeg, point->theta_v_udeg, mirrored, &turned, (char[PLAN_WHY]){0}))
            continue;
        turned.samples = point->samples;
        *point = turned;
        open[i] = false;
    }
}

static int by_angle(const void *a, const void *b) {
    int32_t x = *(const int32_t *)a, y = *(const int32_t *)b;
    if (abs(x) != abs(y))
        return abs(x) < abs(y) ? -1 : 1;
    return (x < y) - (x > y); /* of two mirror images the positive one first */
}

/* A sample turned by hand to +v also shows, mirrored, the geometries of -v: half the holds. */
static int need_few_holds(struct planner *p) {
    int n = p->points.n, n_angles = 0;
    int32_t *angle = malloc((size_t)(2 * n + 1) * sizeof *angle);
    bool *open = malloc((size_t)n + 1);
    if (!angle || !open) {
        free(angle);
        free(open);
        return -ERR_NOMEM;
    }
    for (int i = 0; i < n; i++) {
        open[i] = true;
        angle[2 * i] = p->points.item[i].theta_v_udeg;
        angle[2 * i + 1] = -p->points.item[i].theta_v_udeg;
    }
    qsort(angle, (size_t)(2 * n), sizeof *angle, by_angle);
    for (int i = 0; i < 2 * n; i++)
        if (n_angles == 0 || angle[i] != angle[n_angles - 1])
            angle[n_angles++] = angle[i];
    int32_t next;
    bool worth_it = (double)n_angles * n_angles * n < SEARCH_MAX;
    while (worth_it && (next = best_angle(p, open, angle, n_angles)) != INT32_MIN)
        take_angle(p, open, next);
    free(angle);
    free(open);
    return 0;
}

int plan_list_geometries(struct planner *p) {
    int rc = list_asked(p);
    if (rc < 0)
        return rc;
    sort_unique(&p->points);
    int kept = 0;
    for (int i = 0; i < p->points.n && rc == 0; i++) {
        struct plan_point point = {0};
        rc = sort_out(p, p->points.item[i].theta_i_udeg, p->points.item[i].theta_v_udeg, &point);
        if (point.samples)
            p->points.item[kept++] = point;
    }
    p->points.n = kept;
    sort_unique(&p->points);
    if (rc == 0 && p->config->sample.kind == CONFIG_AXIS_MANUAL)
        rc = need_few_holds(p);
    return rc;
}
