#include "sim/axis_plant.h"

#include <math.h>
#include <string.h>

#include "sim/draw.h"

static struct plant_segment *at(struct plant *p, int i) {
    return &p->segment[i % PLANT_SEGMENTS];
}

static double duration_s(const struct plant_segment *s) {
    return s->t_ramp + s->t_plateau + s->t_fall;
}

static int64_t end_us(const struct plant_segment *s) {
    return s->start_us + llround(duration_s(s) * 1e6);
}

/* Way covered since the start of a segment. */
static double way(const struct plant_segment *s, double t) {
    if (t <= 0)
        return 0;
    if (t < s->t_ramp)
        return s->v0 * t + s->accel * t * t / 2;
    double covered = (s->v0 + s->vp) / 2 * s->t_ramp;
    t -= s->t_ramp;
    if (t < s->t_plateau)
        return covered + s->vp * t;
    covered += s->vp * s->t_plateau;
    t = fmin(t - s->t_plateau, s->t_fall);
    return covered + s->vp * t - s->decel * t * t / 2;
}

static double motor(const struct plant_segment *s, int64_t at_us) {
    if (at_us >= end_us(s))
        return s->x1;
    return s->x0 + s->direction * way(s, (double)(at_us - s->start_us) * 1e-6);
}

static double speed(const struct plant_segment *s, int64_t at_us) {
    double t = (double)(at_us - s->start_us) * 1e-6;
    if (t < 0 || at_us >= end_us(s))
        return 0;
    if (t < s->t_ramp)
        return s->direction * (s->v0 + s->accel * t);
    t -= s->t_ramp + s->t_plateau;
    return s->direction * (t <= 0 ? s->vp : fmax(0, s->vp - s->decel * t));
}

/* The play of the gear: the motor carries the table along only where it has taken up the lost motion. */
static double table(const struct plant *p, const struct plant_segment *s, int64_t at_us) {
    double motor_deg = motor(s, at_us) / PLANT_STEPS_PER_DEG;
    if (s->direction < 0)
        return fmin(s->table0_deg, motor_deg + p->lost_motion_deg);
    return s->direction > 0 ? fmax(s->table0_deg, motor_deg) : s->table0_deg;
}

static const struct plant_segment *find(const struct plant *p, int64_t at_us) {
    int oldest = p->n > PLANT_SEGMENTS ? p->n - PLANT_SEGMENTS : 0, i = p->n - 1;
    while (i > oldest && p->segment[i % PLANT_SEGMENTS].start_us > at_us)
        i--;
    return &p->segment[i % PLANT_SEGMENTS];
}

/* Orders still to begin are replaced by the new one. */
static void forget_after(struct plant *p, int64_t from_us) {
    while (p->n > 1 && at(p, p->n - 1)->start_us > from_us)
        p->n--;
}

static void append(struct plant *p, struct plant_segment *s) {
    const struct plant_segment *before = find(p, s->start_us);
    s->table0_deg = table(p, before, s->start_us);
    *at(p, p->n++) = *s;
}

static int visit_of(struct plant *p, int32_t target_steps, int add) {
    int i = 0;
    while (i < p->n_visits && p->visit[i].target_steps != target_steps)
        i++;
    if (i == PLANT_VISITS)
        return 0;
    if (i == p->n_visits)
        p->visit[p->n_visits++] = (struct plant_visit){.target_steps = target_steps};
    int earlier = p->visit[i].count;
    p->visit[i].count += add;
    return earlier;
}

void plant_init(struct plant *p, uint64_t key, double u_repeat_deg, double lost_motion_deg,
                int32_t at_steps) {
    memset(p, 0, sizeof *p);
    p->key = key;
    p->u_repeat_deg = u_repeat_deg;
    p->lost_motion_deg = lost_motion_deg;
    p->target_steps = at_steps;
    p->n = 1;
    p->segment[0] = (struct plant_segment){.start_us = INT64_MIN / 2,
                                           .x0 = at_steps,
                                           .x1 = at_steps,
                                           .table0_deg = at_steps / (double)PLANT_STEPS_PER_DEG};
}

/* From speed v >= 0 along direction to rest at distance d >= v^2 / (2 decel). */
static void shape(struct plant_segment *s, double d, const struct plant_order *o) {
    double reachable = sqrt((2 * o->accel * o->decel * d + o->decel * s->v0 * s->v0) / (o->accel + o->decel));
    s->vp = fmin(o->speed, reachable);
    s->accel = s->vp >= s->v0 ? o->accel : -o->decel;
    s->decel = o->decel;
    s->t_ramp = (s->vp - s->v0) / s->accel;
    s->t_fall = s->vp / o->decel;
    double ramps = (s->v0 + s->vp) / 2 * s->t_ramp + s->vp / 2 * s->t_fall;
    s->t_plateau = s->vp > 0 ? fmax(0, (d - ramps) / s->vp) : 0;
}

static int64_t brake(struct plant *p, int64_t start_us, double x, double v, double decel, double repeat_deg) {
    struct plant_segment s = {.start_us = start_us,
                              .x0 = x,
                              .v0 = fabs(v),
                              .vp = fabs(v),
                              .decel = decel,
                              .t_fall = fabs(v) / decel,
                              .direction = v > 0 ? 1 : -1,
                              .repeat_deg = repeat_deg};
    s.x1 = x + s.direction * v * v / (2 * decel);
    append(p, &s);
    return end_us(&s);
}

void plant_move(struct plant *p, int64_t start_us, const struct plant_order *o) {
    if (o->target_steps == p->target_steps && !plant_moving(p, start_us) && plant_end_us(p) <= start_us)
        return; /* it stands there already: nothing turns, nothing is drawn anew */
    int visit = visit_of(p, o->target_steps, 1);
    uint64_t key = draw_fold(draw_fold(p->key, (uint32_t)o->target_steps), (uint64_t)visit);
    double repeat_deg = p->u_repeat_deg > 0 ? p->u_repeat_deg * draw_normal(key) : 0;
    forget_after(p, start_us);
    p->target_steps = o->target_steps;
    double x = plant_motor_steps(p, start_us), v = plant_speed(p, start_us), d = o->target_steps - x;
    if (v != 0 && (v * d < 0 || v * v / (2 * o->decel) > fabs(d))) {
        start_us = brake(p, start_us, x, v, o->decel, repeat_deg);
        x = plant_motor_steps(p, start_us);
        v = 0;
        d = o->target_steps - x;
    }
    struct plant_segment s = {.start_us = start_us,
                              .x0 = x,
                              .x1 = o->target_steps,
                              .v0 = fabs(v),
                              .direction = d > 0   ? 1
                                           : d < 0 ? -1
                                                   : 0,
                              .repeat_deg = repeat_deg};
    shape(&s, fabs(d), o);
    append(p, &s);
}

void plant_stop(struct plant *p, int64_t now_us, double decel) {
    forget_after(p, now_us);
    double v = plant_speed(p, now_us), repeat_deg = find(p, now_us)->repeat_deg;
    if (v == 0) { /* also an order that had not begun to turn anything: it is forgotten */
        p->target_steps = (int32_t)lround(plant_motor_steps(p, now_us));
        return;
    }
    brake(p, now_us, plant_motor_steps(p, now_us), v, decel, repeat_deg);
    p->target_steps = (int32_t)lround(at(p, p->n - 1)->x1);
    at(p, p->n - 1)->x1 = p->target_steps;
}

int64_t plant_halt_at(struct plant *p, int64_t from_us, double limit_steps) {
    int64_t low = from_us, high = plant_end_us(p);
    double side = plant_motor_steps(p, low) - limit_steps;
    if (high <= low || side * (plant_motor_steps(p, high) - limit_steps) >= 0)
        return INT64_MAX;
    while (high - low > 1) {
        int64_t middle = low + (high - low) / 2;
        if (side * (plant_motor_steps(p, middle) - limit_steps) > 0)
            low = middle;
        else
            high = middle;
    }
    double repeat_deg = find(p, high)->repeat_deg;
    forget_after(p, high);
    struct plant_segment s = {
        .start_us = high, .x0 = limit_steps, .x1 = limit_steps, .repeat_deg = repeat_deg};
    append(p, &s);
    p->target_steps = (int32_t)lround(limit_steps);
    return high;
}

void plant_add_visits(struct plant *p, int32_t target_steps, int visits) {
    visit_of(p, target_steps, visits);
}

double plant_motor_steps(const struct plant *p, int64_t at_us) {
    return motor(find(p, at_us), at_us);
}

double plant_speed(const struct plant *p, int64_t at_us) {
    return speed(find(p, at_us), at_us);
}

double plant_table_deg(const struct plant *p, int64_t at_us) {
    const struct plant_segment *s = find(p, at_us);
    return table(p, s, at_us) + s->repeat_deg;
}

int64_t plant_end_us(const struct plant *p) {
    return end_us(&p->segment[(p->n - 1) % PLANT_SEGMENTS]);
}

bool plant_moving(const struct plant *p, int64_t at_us) {
    const struct plant_segment *s = find(p, at_us);
    return s->direction != 0 && at_us < end_us(s);
}

bool plant_steady(const struct plant *p, int64_t from_us, int64_t to_us) {
    int oldest = p->n > PLANT_SEGMENTS ? p->n - PLANT_SEGMENTS : 0;
    for (int i = p->n - 1; i >= oldest; i--) {
        const struct plant_segment *s = &p->segment[i % PLANT_SEGMENTS];
        if (s->start_us < to_us && (i > 0 && end_us(s) > from_us) && s->direction != 0)
            return false;
        if (s->start_us <= from_us)
            return true;
    }
    return true;
}
