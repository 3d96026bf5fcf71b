#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/plan_parts.h"
#include "daemon/plan_walk.h"
#include "proto/units.h"

#define REPEATED 20 /* measurement.md 9: about 5 % of the points once more at the end */

struct set { /* samples that are mounted together */
    int n;
    int sample[JOB_SAMPLES];
    int block; /* geometries read on one surface before the next comes */
};

#define BLOCK_MAX 20 /* geometries between a reading of the diffuser and that of the sample there */

/* How many geometries are read on one surface before the next one comes: all of a bracket where a person
 * changes it; else so many that turning the holder costs no more than moving between them. */
static int block_size(const struct plan_walk *w, const struct set *set) {
    const struct planner *p = w->p;
    int surfaces = set->n + (p->job->reference.mode == REFERENCE_EVERY_GEOMETRY);
    if (surfaces == 1 || plan_walk_by_hand(w, set->sample[0]))
        return PLAN_POINTS_MAX;
    int64_t way_us = 0, swap_us = plan_walk_swap_us(p, PLAN_REFERENCE, set->sample[0]);
    for (int i = 1; i < p->points.n; i++) {
        const struct plan_point *a = &p->points.item[i - 1], *b = &p->points.item[i];
        way_us += plan_move_time_us(p, &(struct plan_pose){a->source_udeg, a->sample_udeg, 0},
                                    &(struct plan_pose){b->source_udeg, b->sample_udeg, 0});
    }
    int64_t leg_us = way_us / p->points.n + 1, size = swap_us / leg_us + 1;
    return size > BLOCK_MAX ? BLOCK_MAX : (int)size;
}

/* A block: the diffuser at each geometry where it is read everywhere, then each sample, always in the same
 * direction: the way back hides behind the change of the surface. */
static void block(struct plan_walk *w, const struct set *set, struct plan_point *point, int n, bool repeat) {
    if (w->p->job->reference.mode == REFERENCE_EVERY_GEOMETRY)
        for (int i = 0; i < n; i++)
            point[i].reference_step = plan_walk_reference(w, &point[i], false, repeat);
    for (int k = 0; k < set->n; k++)
        for (int i = 0; i < n; i++)
            plan_walk_sample(w, set->sample[k], &point[i], repeat);
}

static void body(struct plan_walk *w, const struct set *set, struct plan_point *point, int n, bool repeat) {
    for (int first = 0; first < n; first += set->block)
        block(w, set, point + first, n - first < set->block ? n - first : set->block, repeat);
}

/* Time from the opening to the closing reading of a bracket that holds n points; nothing is kept. */
static int64_t bracket_us(const struct plan_walk *w, const struct set *set, struct plan_point *point, int n,
                          const struct plan_point *control, bool repeat) {
    struct plan_walk trial = *w;
    int n_steps = w->p->plan->n_steps;
    body(&trial, set, point, n, repeat);
    plan_walk_close(&trial, control);
    w->p->plan->n_steps = n_steps;
    return trial.now_us - trial.open_us;
}

/* How many of n points fit into a bracket: doubled until it is too long, then halved in. */
static int how_many(const struct plan_walk *w, const struct set *set, struct plan_point *point, int n,
                    const struct plan_point *control, bool repeat) {
    int64_t longest = llround(w->p->job->reference.bracket_min * US_PER_MIN);
    int fits = 0, too_many = n + 1;
    for (int attempt = 1; too_many - fits > 1;) {
        if (bracket_us(w, set, point, attempt, control, repeat) <= longest)
            fits = attempt;
        else
            too_many = attempt;
        attempt = too_many > n && 2 * fits <= n && fits > 0 ? 2 * fits : (fits + too_many) / 2;
    }
    return fits;
}

static int too_short(struct plan_walk *w, const struct set *set, struct plan_point *point,
                     const struct plan_point *control) {
    double need_min = (double)bracket_us(w, set, point, 1, control, false) / US_PER_MIN;
    job_complain(
        w->p->job, w->p->errors, "reference.bracket_min",
        "a bracket of %g min is too short: one geometry between two readings of the diffuser takes %.1f min",
        w->p->job->reference.bracket_min, need_min);
    return -ERR_INPUT;
}

static int same_incidence(const struct planner *p, const struct plan_point *point, int n) {
    int count = 1;
    bool apart = p->job->reference.mode == REFERENCE_PER_INCIDENCE;
    while (count < n && (!apart || point[count].theta_i_udeg == point[0].theta_i_udeg))
        count++;
    return count;
}

static int brackets(struct plan_walk *w, const struct set *set, struct plan_point *point, int n,
                    bool repeat) {
    char why[PLAN_WHY];
    for (int first = 0; first < n && w->rc == 0;) {
        struct plan_point control;
        if (!plan_control(w->p, point[first].theta_i_udeg, &control, why))
            return -ERR_INPUT;
        int together = same_incidence(w->p, point + first, n - first);
        plan_walk_open(w, &control);
        int fits = how_many(w, set, point + first, together, &control, repeat);
        if (fits == 0)
            return too_short(w, set, point + first, &control);
        body(w, set, point + first, fits, repeat);
        plan_walk_close(w, &control);
        first += fits;
    }
    return w->rc;
}

static bool measured_on(const struct plan_point *point, const struct set *set) {
    for (int k = 0; k < set->n; k++)
        if (point->samples & 1u << set->sample[k])
            return true;
    return false;
}

/* Those of the points that a set of samples is measured at, and of these every twentieth once more. */
static int choose(const struct planner *p, const struct set *set, struct plan_point *point, bool repeats) {
    int n = 0;
    for (int i = 0; i < p->points.n; i++)
        if (measured_on(&p->points.item[i], set))
            point[n++] = p->points.item[i];
    if (!repeats)
        return n;
    int again = (n + REPEATED / 2) / REPEATED;
    for (int k = 0; k < again; k++)
        point[k] = point[(int)((2LL * k + 1) * n / (2 * again))];
    return again;
}

static int measure_set(struct plan_walk *w, const struct set *set, struct plan_point *point) {
    bool one_bracket = w->p->job->reference.mode == REFERENCE_START_END;
    for (int pass = 0; pass < 2; pass++) {
        int n = choose(w->p, set, point, pass == 1), rc = w->rc;
        if (rc == 0 && one_bracket)
            body(w, set, point, n, pass == 1);
        else if (rc == 0)
            rc = brackets(w, set, point, n, pass == 1);
        if (rc < 0)
            return rc;
    }
    return w->rc;
}

/* Samples stand together where each has a place of its own beside the diffuser's; without a motor at the
 * holder, one at a time. */
static int mount_sets(const struct planner *p, struct set sets[JOB_SAMPLES]) {
    int n_sets = 0;
    for (int i = 0; i < p->job->n_samples; i++) {
        int place = plan_walk_place(p, i), chosen = -1;
        for (int s = 0; s < n_sets && chosen < 0; s++) {
            bool free_place = p->config->holder.kind == CONFIG_AXIS_MOTOR && place != plan_walk_place(p, -1);
            for (int k = 0; k < sets[s].n; k++)
                free_place = free_place && plan_walk_place(p, sets[s].sample[k]) != place;
            chosen = free_place && plan_walk_place(p, sets[s].sample[0]) != plan_walk_place(p, -1) ? s : -1;
        }
        if (chosen < 0) {
            chosen = n_sets++;
            sets[chosen].n = 0;
        }
        sets[chosen].sample[sets[chosen].n++] = i;
    }
    return n_sets;
}

static int measure_all(struct plan_walk *w, const struct set *sets, int n_sets, struct plan_point *point) {
    struct plan_point control;
    char why[PLAN_WHY];
    bool one_bracket = w->p->job->reference.mode == REFERENCE_START_END;
    if (!plan_control(w->p, point[0].theta_i_udeg, &control, why))
        return -ERR_INPUT;
    plan_walk_start(w, &control);
    if (plan_spans(w->p))
        plan_walk_overlap(w, &control);
    if (one_bracket)
        plan_walk_open(w, &control);
    int rc = 0;
    for (int s = 0; s < n_sets && rc == 0; s++)
        rc = measure_set(w, &sets[s], point);
    if (rc == 0 && one_bracket)
        plan_walk_close(w, &control);
    plan_walk_park(w);
    return rc < 0 ? rc : w->rc;
}

int plan_build_steps(struct planner *p) {
    struct set sets[JOB_SAMPLES] = {0};
    struct plan_walk walk;
    struct plan_point *point = malloc((size_t)p->points.n * sizeof *point);
    if (!point)
        return -ERR_NOMEM;
    int n_sets = mount_sets(p, sets);
    choose(p, &sets[0], point, false);
    plan_walk_init(&walk, p, sets[0].sample, sets[0].n);
    for (int k = 0; k < n_sets; k++)
        sets[k].block = block_size(&walk, &sets[k]);
    int rc = measure_all(&walk, sets, n_sets, point);
    free(point);
    p->n_darks = walk.n_darks;
    p->plan->n_brackets = walk.bracket;
    return rc;
}
