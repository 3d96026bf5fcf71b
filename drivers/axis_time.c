#include <math.h>
#include <stdlib.h>

#include "drivers/axis_inside.h"

int64_t axis_travel_us(const struct profile *p, int64_t distance_udeg) {
    double d = (double)llabs(distance_udeg) / UDEG_PER_DEG, v = p->speed_deg_s, a = p->accel_deg_s2;
    double s = d >= v * v / a ? d / v + v / a : 2 * sqrt(d / a);
    return llround(s * US_PER_S);
}

int64_t axis_move_time_us(const struct profile *p, int32_t distance_udeg) {
    if (distance_udeg == 0)
        return 0;
    int32_t backlash = udeg_from_deg(p->backlash_deg);
    bool against = backlash != 0 && (distance_udeg > 0) != (backlash > 0);
    int64_t travel = axis_travel_us(p, distance_udeg);
    if (against) /* past the target, and back on the side from which every position is reached */
        travel = axis_travel_us(p, llabs(distance_udeg) + llabs(backlash)) + axis_travel_us(p, backlash) +
                 p->poll.moving_ms * US_PER_MS / 2;
    return travel + (p->settle_ms + p->poll.moving_ms) * US_PER_MS;
}
