#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/plan_parts.h"
#include "proto/units.h"

/* A better order is looked for only as far as a plan is wanted within a second. */
#define NEAREST_MAX 2000
#define EXCHANGE_MAX 1500
#define EXCHANGE_REACH 80
#define EXCHANGE_PASSES 12
#define DETOUR_US (60 * US_PER_S) /* makes a leg that a keep-out zone blocks the last choice */

static int64_t travel_us(const struct planner *p, int axis, int32_t a_udeg, int32_t b_udeg) {
    int64_t index = (llabs((int64_t)a_udeg - b_udeg) + PLAN_TRAVEL_UDEG - 1) / PLAN_TRAVEL_UDEG;
    return p->travel_us[axis][index < PLAN_TRAVEL ? index : PLAN_TRAVEL - 1];
}

static int64_t leg_us(const struct planner *p, const struct plan_point *a, const struct plan_point *b) {
    int64_t source = travel_us(p, 0, a->source_udeg, b->source_udeg);
    int64_t sample = travel_us(p, 1, a->sample_udeg, b->sample_udeg);
    int64_t slower = source > sample ? source : sample;
    if (p->config->n_keep_out > 0 &&
        !plan_way_clear(p, &(struct plan_pose){a->source_udeg, a->sample_udeg, 0},
                        &(struct plan_pose){b->source_udeg, b->sample_udeg, 0}))
        slower += DETOUR_US;
    return slower;
}

static int64_t length_us(const struct planner *p, const struct plan_point *point, int n) {
    int64_t sum = 0;
    for (int i = 1; i < n; i++)
        sum += leg_us(p, &point[i - 1], &point[i]);
    return sum;
}

static int compare(int32_t a, int32_t b) {
    return (a > b) - (a < b);
}

/* At theta_i = 0 two mirror images stand at the same place. */
static int by_sample_then_view(const struct plan_point *x, const struct plan_point *y) {
    int order = compare(x->sample_udeg, y->sample_udeg);
    return order ? order : compare(x->theta_v_udeg, y->theta_v_udeg);
}

static int by_incidence(const void *a, const void *b) {
    const struct plan_point *x = a, *y = b;
    int order = compare(x->theta_i_udeg, y->theta_i_udeg);
    return order ? order : by_sample_then_view(x, y);
}

static int by_source(const void *a, const void *b) {
    const struct plan_point *x = a, *y = b;
    int order = compare(x->source_udeg, y->source_udeg);
    return order ? order : by_sample_then_view(x, y);
}

static int by_sample_then_source(const void *a, const void *b) {
    const struct plan_point *x = a, *y = b;
    int order = compare(x->sample_udeg, y->sample_udeg);
    if (order)
        return order;
    order = compare(x->source_udeg, y->source_udeg);
    return order ? order : compare(x->theta_v_udeg, y->theta_v_udeg);
}

static void reverse(struct plan_point *point, int first, int last) {
    for (; first < last; first++, last--) {
        struct plan_point held = point[first];
        point[first] = point[last];
        point[last] = held;
    }
}

static int32_t row_by_incidence(const struct plan_point *point) {
    return point->theta_i_udeg;
}

static int32_t row_by_source(const struct plan_point *point) {
    return point->source_udeg;
}

/* Sweeps, every other one backwards. */
static void sweep(struct plan_point *point, int n, int (*order)(const void *, const void *),
                  int32_t (*row)(const struct plan_point *)) {
    qsort(point, (size_t)n, sizeof *point, order);
    int number = 0;
    for (int first = 0, last; first < n; first = last + 1, number++) {
        for (last = first; last + 1 < n && row(&point[last + 1]) == row(&point[first]); last++)
            ;
        if (number % 2)
            reverse(point, first, last);
    }
}

static void nearest_neighbour(const struct planner *p, struct plan_point *point, int n) {
    for (int i = 1; i < n; i++) {
        int best = i;
        int64_t best_us = INT64_MAX;
        for (int k = i; k < n; k++) {
            int64_t us = leg_us(p, &point[i - 1], &point[k]);
            if (us < best_us) {
                best = k;
                best_us = us;
            }
        }
        struct plan_point held = point[i];
        point[i] = point[best];
        point[best] = held;
    }
}

/* 2-opt: turns a stretch round wherever that shortens the way. */
static bool exchange_once(const struct planner *p, struct plan_point *point, int n) {
    bool better = false;
    for (int i = 0; i + 2 < n; i++)
        for (int k = i + 2; k < n && k < i + EXCHANGE_REACH; k++) {
            int64_t now = leg_us(p, &point[i], &point[i + 1]);
            int64_t then = leg_us(p, &point[i], &point[k]);
            if (k + 1 < n) {
                now += leg_us(p, &point[k], &point[k + 1]);
                then += leg_us(p, &point[i + 1], &point[k + 1]);
            }
            if (then < now) {
                reverse(point, i + 1, k);
                better = true;
            }
        }
    return better;
}

static void keep_shorter(const struct planner *p, struct plan_point *best, struct plan_point *candidate,
                         int n, int64_t *best_us) {
    int64_t us = length_us(p, candidate, n);
    if (us >= *best_us)
        return;
    *best_us = us;
    memcpy(best, candidate, (size_t)n * sizeof *best);
}

static int order_freely(const struct planner *p, struct plan_point *point, int n) {
    struct plan_point *candidate = malloc((size_t)n * sizeof *candidate);
    if (!candidate)
        return -ERR_NOMEM;
    int64_t best_us = INT64_MAX;
    sweep(point, n, by_incidence, row_by_incidence);
    memcpy(candidate, point, (size_t)n * sizeof *point);
    best_us = length_us(p, point, n);
    sweep(candidate, n, by_source, row_by_source);
    keep_shorter(p, point, candidate, n, &best_us);
    if (n <= NEAREST_MAX) {
        qsort(candidate, (size_t)n, sizeof *candidate, by_incidence);
        nearest_neighbour(p, candidate, n);
        keep_shorter(p, point, candidate, n, &best_us);
    }
    for (int pass = 0; n <= EXCHANGE_MAX && pass < EXCHANGE_PASSES && exchange_once(p, point, n); pass++)
        ;
    free(candidate);
    return 0;
}

static int32_t row_by_sample(const struct plan_point *point) {
    return point->sample_udeg;
}

/* A person turns the sample: each angle once, and the source sweeps there and back. */
static int order_group(const struct planner *p, struct plan_point *point, int n) {
    if (p->config->sample.kind != CONFIG_AXIS_MANUAL)
        return order_freely(p, point, n);
    sweep(point, n, by_sample_then_source, row_by_sample);
    return 0;
}

int plan_order(const struct planner *p, struct plan_point *point, int n) {
    if (p->job->reference.mode != REFERENCE_PER_INCIDENCE)
        return order_group(p, point, n);
    qsort(point, (size_t)n, sizeof *point, by_incidence);
    int rc = 0;
    for (int first = 0, last; first < n && rc == 0; first = last + 1) {
        for (last = first; last + 1 < n && point[last + 1].theta_i_udeg == point[first].theta_i_udeg; last++)
            ;
        rc = order_group(p, point + first, last + 1 - first);
    }
    return rc;
}
