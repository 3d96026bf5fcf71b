#include <stdlib.h>
#include <string.h>

#include "daemon/plan_parts.h"
#include "proto/profile.h"
#include "proto/units.h"

#define CLEARANCE_UDEG 500000 /* how far from a zone's edge a way round it keeps */
#define COORDINATES (2 + 2 * CONFIG_ZONES)
#define CORNERS (COORDINATES * COORDINATES)

static bool overlaps(const double zone_deg[2], int32_t a_udeg, int32_t b_udeg) {
    int32_t low = a_udeg < b_udeg ? a_udeg : b_udeg, high = a_udeg < b_udeg ? b_udeg : a_udeg;
    return high >= udeg_from_deg(zone_deg[0]) && low <= udeg_from_deg(zone_deg[1]);
}

bool plan_in_zone(const struct planner *p, int32_t source_udeg, int32_t sample_udeg) {
    for (int i = 0; i < p->config->n_keep_out; i++)
        if (overlaps(p->config->keep_out[i].source_deg, source_udeg, source_udeg) &&
            overlaps(p->config->keep_out[i].sample_deg, sample_udeg, sample_udeg))
            return true;
    return false;
}

/* How far an axis may overshoot so that it arrives from its usual side (drivers/stage.c keeps the same margin). */
static int32_t overshoot_udeg(const struct planner *p, enum stage_axis axis, int32_t from_udeg,
                              int32_t to_udeg) {
    const struct profile *profile = p->devices->profile[axis];
    return profile && from_udeg != to_udeg ? abs(udeg_from_deg(profile->backlash_deg)) : 0;
}

static bool sweeps(const struct planner *p, enum stage_axis axis, const double zone_deg[2], int32_t from_udeg,
                   int32_t to_udeg) {
    int32_t more = overshoot_udeg(p, axis, from_udeg, to_udeg);
    int32_t low = from_udeg < to_udeg ? from_udeg : to_udeg, high = from_udeg < to_udeg ? to_udeg : from_udeg;
    return overlaps(zone_deg, low - more, high + more);
}

/* Axes that move together may pass any point of the rectangle between their ends: none may be forbidden. */
bool plan_way_clear(const struct planner *p, const struct plan_pose *from, const struct plan_pose *to) {
    for (int i = 0; i < p->config->n_keep_out; i++)
        if (sweeps(p, STAGE_SOURCE, p->config->keep_out[i].source_deg, from->source_udeg, to->source_udeg) &&
            sweeps(p, STAGE_SAMPLE, p->config->keep_out[i].sample_deg, from->sample_udeg, to->sample_udeg))
            return false;
    return true;
}

static int add_coordinate(const struct config_axis *axis, int32_t *coordinate, int n, int32_t udeg) {
    if (axis->kind == CONFIG_AXIS_MOTOR && udeg >= udeg_from_deg(axis->limits_deg[0]) &&
        udeg <= udeg_from_deg(axis->limits_deg[1]))
        coordinate[n++] = udeg;
    return n;
}

/* The places worth stopping at on the way: the ends, and just outside each zone. */
static int list_corners(const struct planner *p, const struct plan_pose *from, const struct plan_pose *to,
                        struct plan_pose corner[CORNERS]) {
    int32_t source[COORDINATES] = {from->source_udeg, to->source_udeg};
    int32_t sample[COORDINATES] = {from->sample_udeg, to->sample_udeg};
    int n_source = 2, n_sample = 2, n = 0;
    for (int i = 0; i < p->config->n_keep_out; i++)
        for (int side = 0; side < 2; side++) {
            const struct config_zone *zone = &p->config->keep_out[i];
            int32_t out = side ? CLEARANCE_UDEG : -CLEARANCE_UDEG;
            n_source = add_coordinate(&p->config->source, source, n_source,
                                      udeg_from_deg(zone->source_deg[side]) + out);
            n_sample = add_coordinate(&p->config->sample, sample, n_sample,
                                      udeg_from_deg(zone->sample_deg[side]) + out);
        }
    corner[n++] = *from;
    corner[n++] = *to;
    for (int i = 0; i < n_source; i++)
        for (int k = 0; k < n_sample; k++)
            if (n < CORNERS && !plan_in_zone(p, source[i], sample[k]))
                corner[n++] = (struct plan_pose){source[i], sample[k], 0};
    return n;
}

static int unwind(const struct plan_pose *corner, const int *before, struct stage_target via[PLAN_VIA]) {
    int stops = 0;
    for (int at = before[1]; at != 0; at = before[at])
        stops++;
    if (stops > PLAN_VIA)
        return -1;
    int i = stops;
    for (int at = before[1]; at != 0; at = before[at])
        via[--i] =
            (struct stage_target){{true, true, false}, {corner[at].source_udeg, corner[at].sample_udeg, 0}};
    return stops;
}

int plan_route(const struct planner *p, const struct plan_pose *from, const struct plan_pose *to,
               struct stage_target via[PLAN_VIA]) {
    struct plan_pose start = *from;
    if (p->config->sample.kind != CONFIG_AXIS_MOTOR)
        start.sample_udeg = to->sample_udeg; /* turned by hand before the source moves, or fixed */
    if (plan_way_clear(p, &start, to))
        return 0;
    struct plan_pose corner[CORNERS];
    int before[CORNERS], queue[CORNERS], head = 0, tail = 0;
    int n = list_corners(p, &start, to, corner);
    memset(before, -1, sizeof before);
    queue[tail++] = 0;
    before[0] = 0;
    /* Breadth first from 0 (the start) to 1 (the end): the fewest stops. */
    while (head < tail && before[1] < 0) {
        int at = queue[head++];
        for (int next = 1; next < n; next++)
            if (before[next] < 0 && plan_way_clear(p, &corner[at], &corner[next])) {
                before[next] = at;
                queue[tail++] = next;
            }
    }
    return before[1] < 0 ? -1 : unwind(corner, before, via);
}

int plan_way(const struct config *config, const struct plan_devices *devices,
             const int32_t from_udeg[STAGE_AXES], const struct stage_target *to,
             struct stage_target via[PLAN_VIA]) {
    struct planner p = {.config = config, .devices = devices};
    struct plan_pose from = {from_udeg[STAGE_SOURCE], from_udeg[STAGE_SAMPLE], 0}, end = from;
    if (to->used[STAGE_SOURCE])
        end.source_udeg = to->udeg[STAGE_SOURCE];
    if (to->used[STAGE_SAMPLE])
        end.sample_udeg = to->udeg[STAGE_SAMPLE];
    int n = plan_route(&p, &from, &end, via);
    for (int i = 0; i < n; i++) /* what a person turns stands already */
        via[i].used[STAGE_SAMPLE] = config->sample.kind == CONFIG_AXIS_MOTOR;
    return n;
}
