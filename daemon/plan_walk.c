#include "daemon/plan_walk.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "proto/units.h"

#define NO_DARK INT64_MIN

int plan_walk_place(const struct planner *p, int surface) {
    const struct config_axis *holder = &p->config->holder;
    if (holder->kind != CONFIG_AXIS_MOTOR)
        return 0;
    const char *name = surface < 0 ? p->job->reference.holder : p->job->sample[surface].holder;
    const struct config_position *position = config_position_find(holder, name);
    return position ? (int)(position - holder->position) : -1;
}

void plan_walk_init(struct plan_walk *w, struct planner *p, const int *sample, int n) {
    *w = (struct plan_walk){.p = p, .last_dark_us = NO_DARK};
    for (int i = 0; i < CONFIG_POSITIONS; i++)
        w->mounted[i] = PLAN_NOTHING;
    if (p->config->sample.kind == CONFIG_AXIS_FIXED) {
        w->pose.sample_udeg = udeg_from_deg(p->config->sample.fixed_deg);
        w->turned = true;
    }
    if (p->config->holder.kind != CONFIG_AXIS_MOTOR)
        return;
    for (int k = 0; k < n; k++)
        w->mounted[plan_walk_place(p, sample[k])] = sample[k];
    w->mounted[plan_walk_place(p, PLAN_REFERENCE)] = PLAN_REFERENCE;
}

bool plan_walk_by_hand(const struct plan_walk *w, int sample) {
    return plan_walk_place(w->p, sample) == plan_walk_place(w->p, PLAN_REFERENCE);
}

int64_t plan_walk_swap_us(const struct planner *p, int from, int to) {
    const struct config_axis *holder = &p->config->holder;
    if (holder->kind != CONFIG_AXIS_MOTOR)
        return 0;
    double deg =
        holder->position[plan_walk_place(p, to)].deg - holder->position[plan_walk_place(p, from)].deg;
    return plan_axis_time_us(p, STAGE_HOLDER, udeg_from_deg(deg));
}

static struct step *add_step(struct plan_walk *w, enum step_kind kind) {
    struct plan *plan = w->p->plan;
    /* Grows by doubling at each power of two; a trial that was put back has its room already. */
    if ((plan->n_steps & (plan->n_steps - 1)) == 0) {
        size_t capacity = plan->n_steps ? 2 * (size_t)plan->n_steps : 1;
        struct step *grown = realloc(plan->step, capacity * sizeof *grown);
        if (!grown) {
            w->rc = -ERR_NOMEM;
            return &w->spare;
        }
        plan->step = grown;
    }
    struct step *step = &plan->step[plan->n_steps++];
    *step = (struct step){.kind = kind, .sample = -1, .reference = -1, .bracket = w->bracket};
    return step;
}

static void surface_name(const struct planner *p, int surface, char *name, size_t size) {
    if (surface == PLAN_REFERENCE)
        snprintf(name, size, "the reference diffuser");
    else
        snprintf(name, size, "sample %s", p->job->sample[surface].name);
}

static bool needs_turning(const struct plan_walk *w, const struct plan_point *point) {
    return w->p->config->sample.kind == CONFIG_AXIS_MANUAL &&
           !(w->turned && w->pose.sample_udeg == point->sample_udeg);
}

static void say_mount(const struct planner *p, int surface, int place, char *text, size_t size) {
    char name[80];
    surface_name(p, surface, name, sizeof name);
    if (p->config->holder.kind == CONFIG_AXIS_MOTOR)
        snprintf(text, size, "mount %s at holder position %s", name, p->config->holder.position[place].name);
    else
        snprintf(text, size, "put %s into the holder", name);
}

/* What a person has to do before this surface can be read at this point, in one hold. */
static void hold_if_needed(struct plan_walk *w, int surface, const struct plan_point *point) {
    int place = plan_walk_place(w->p, surface);
    bool mount = w->mounted[place] != surface, turn = needs_turning(w, point);
    if (!mount && !turn)
        return;
    char what[120] = "";
    if (mount)
        say_mount(w->p, surface, place, what, sizeof what);
    struct step *step = add_step(w, STEP_HOLD);
    step->sample = surface < 0 ? -1 : surface;
    step->mounts = mount;
    step->estimate_us = plan_hold_time_us();
    if (turn) {
        step->target.used[STAGE_SAMPLE] = true;
        step->target.udeg[STAGE_SAMPLE] = point->sample_udeg;
        snprintf(step->text, sizeof step->text, "%s%sturn the sample axis to %g deg", what, mount ? "; " : "",
                 deg_from_udeg(point->sample_udeg));
    } else {
        snprintf(step->text, sizeof step->text, "%s", what);
    }
    w->mounted[place] = surface;
    w->pose.sample_udeg = turn ? point->sample_udeg : w->pose.sample_udeg;
    w->turned = w->turned || turn;
    w->now_us += step->estimate_us;
    w->may_share = false;
}

static int64_t dark_if_due(struct plan_walk *w) {
    int64_t every = llround(w->p->job->exposure.dark_every_min * US_PER_MIN);
    if (w->last_dark_us != NO_DARK && w->now_us - w->last_dark_us < every)
        return 0;
    w->last_dark_us = w->now_us;
    w->n_darks++;
    return plan_reading_time_us(w->p);
}

/* The moves of a step, with stops round a keep-out zone, and their time. */
static int64_t move(struct plan_walk *w, struct step *step, const struct plan_pose *to) {
    const enum config_axis_kind kinds[STAGE_AXES] = {w->p->config->source.kind, w->p->config->sample.kind,
                                                     w->p->config->holder.kind};
    const int32_t udeg[STAGE_AXES] = {to->source_udeg, to->sample_udeg, to->holder_udeg};
    for (int axis = 0; axis < STAGE_AXES; axis++) {
        step->target.used[axis] = kinds[axis] == CONFIG_AXIS_MOTOR || axis == STAGE_SAMPLE;
        step->target.udeg[axis] = step->target.used[axis] ? udeg[axis] : 0;
    }
    step->n_via = plan_route(w->p, &w->pose, to, step->via);
    if (step->n_via < 0) {
        err_list_add(w->p->errors, &(struct err){.code = ERR_RANGE,
                                                 .text = "no way round the keep-out zones "
                                                         "between two geometries: make the zones smaller"});
        w->rc = -ERR_RANGE;
        step->n_via = 0;
    }
    int64_t sum = 0;
    struct plan_pose at = w->pose;
    for (int i = 0; i < step->n_via; i++) {
        struct plan_pose stop = {step->via[i].udeg[STAGE_SOURCE], step->via[i].udeg[STAGE_SAMPLE],
                                 at.holder_udeg};
        sum += plan_move_time_us(w->p, &at, &stop);
        at = stop;
    }
    sum += plan_move_time_us(w->p, &at, to);
    w->pose = *to;
    return sum;
}

static int read_surface(struct plan_walk *w, enum step_kind kind, int surface,
                        const struct plan_point *point) {
    hold_if_needed(w, surface, point);
    struct step *step = add_step(w, kind);
    const struct config_axis *holder = &w->p->config->holder;
    struct plan_pose to = {point->source_udeg, point->sample_udeg, w->pose.holder_udeg};
    if (holder->kind == CONFIG_AXIS_MOTOR)
        to.holder_udeg = udeg_from_deg(holder->position[plan_walk_place(w->p, surface)].deg);
    step->sample = surface < 0 ? -1 : surface;
    step->theta_i_udeg = point->theta_i_udeg;
    step->theta_v_udeg = point->theta_v_udeg;
    step->mirrored = point->mirrored;
    step->reciprocal = point->reciprocal;
    step->estimate_us = dark_if_due(w) + move(w, step, &to) + plan_reading_time_us(w->p);
    w->now_us += step->estimate_us;
    w->may_share = false;
    return w->p->plan->n_steps - 1;
}

int plan_walk_reference(struct plan_walk *w, const struct plan_point *point, bool control, bool repeat) {
    int index = read_surface(w, STEP_REFERENCE, PLAN_REFERENCE, point);
    if (w->rc == 0) {
        w->p->plan->step[index].control = control;
        w->p->plan->step[index].repeat = repeat;
    }
    return index;
}

void plan_walk_overlap(struct plan_walk *w, const struct plan_point *control) {
    int index = read_surface(w, STEP_OVERLAP, PLAN_REFERENCE, control);
    int64_t second_us = 2 * plan_reading_time_us(w->p);
    if (w->rc < 0)
        return;
    w->n_darks++;
    w->now_us += second_us;
    w->p->plan->step[index].estimate_us += second_us;
}

void plan_walk_sample(struct plan_walk *w, int sample, const struct plan_point *point, bool repeat) {
    if (!(point->samples & 1u << sample))
        return;
    int index = read_surface(w, STEP_SAMPLE, sample, point);
    if (w->rc < 0)
        return;
    bool own = w->p->job->reference.mode == REFERENCE_EVERY_GEOMETRY;
    w->p->plan->step[index].reference = own ? point->reference_step : w->control_step;
    w->p->plan->step[index].repeat = repeat;
}

/* The reading that closed the last bracket opens the next, where it is of the same geometry. */
static bool shares(const struct plan_walk *w, const struct plan_point *control) {
    if (!w->may_share)
        return false;
    const struct step *last = &w->p->plan->step[w->p->plan->n_steps - 1];
    return last->theta_i_udeg == control->theta_i_udeg && last->theta_v_udeg == control->theta_v_udeg;
}

void plan_walk_open(struct plan_walk *w, const struct plan_point *control) {
    bool shared = shares(w, control);
    if (!shared) {
        hold_if_needed(w, PLAN_REFERENCE, control);
        w->bracket++;
        w->control_step = plan_walk_reference(w, control, true, false);
    } else {
        w->bracket++;
        w->control_step = w->p->plan->n_steps - 1;
    }
    if (w->rc == 0)
        w->p->plan->step[w->control_step].opens = w->bracket;
    w->open_us = w->now_us;
}

void plan_walk_close(struct plan_walk *w, const struct plan_point *control) {
    plan_walk_reference(w, control, true, false);
    w->may_share = true;
}

void plan_walk_start(struct plan_walk *w, const struct plan_point *control) {
    hold_if_needed(w, PLAN_REFERENCE, control);
    if (w->p->config->lamp_warm_up_min <= 0)
        return;
    struct step *step = add_step(w, STEP_WARM_UP);
    step->estimate_us = llround(w->p->config->lamp_warm_up_min * US_PER_MIN);
    snprintf(step->text, sizeof step->text, "let the lamp burn for %g min", w->p->config->lamp_warm_up_min);
    w->now_us += step->estimate_us;
}

void plan_walk_park(struct plan_walk *w) {
    struct step *step = add_step(w, STEP_PARK);
    step->bracket = 0;
}
