#include "daemon/plan.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/instruments.h"
#include "daemon/plan_parts.h"
#include "proto/units.h"

#define REFUSALS_TOLD 10 /* in the error of a plan with nothing left; `gonioctl check` lists them all */

static void check_position(const struct planner *p, const char *path, const char *name) {
    const struct config_axis *holder = &p->config->holder;
    if (holder->kind != CONFIG_AXIS_MOTOR || config_position_find(holder, name))
        return;
    const char *names[CONFIG_POSITIONS + 1] = {NULL};
    char all[CONFIG_POSITIONS * 34] = "";
    for (int i = 0; i < holder->n_positions; i++) {
        size_t used = strlen(all);
        names[i] = holder->position[i].name;
        snprintf(all + used, sizeof all - used, "%s%s", i ? ", " : "", names[i]);
    }
    const char *near = yaml_nearest(name, names);
    job_complain(p->job, p->errors, path, "the holder has no position '%s'%s%s%s: it has %s", name,
                 near ? ", did you mean '" : "", near ? near : "", near ? "'" : "", all);
}

static void check_positions(const struct planner *p) {
    char path[64];
    for (int i = 0; i < p->job->n_samples; i++) {
        snprintf(path, sizeof path, "samples[%d].holder", i);
        check_position(p, path, p->job->sample[i].holder);
    }
    check_position(p, "reference.holder", p->job->reference.holder);
}

static void check_exposures(const struct planner *p) {
    const struct spectrometer_model *model = p->devices->spectrometer;
    double least_ms = (double)model->min_exposure_us / US_PER_MS,
           most_ms = (double)model->max_exposure_us / US_PER_MS;
    if (p->job->exposure.min_ms < least_ms)
        job_complain(p->job, p->errors, "exposure.min_ms", "%g ms is shorter than a %s can (%g ms)",
                     p->job->exposure.min_ms, model->title, least_ms);
    if (p->job->exposure.max_ms > most_ms)
        job_complain(p->job, p->errors, "exposure.max_ms", "%g ms is longer than a %s can (%g ms)",
                     p->job->exposure.max_ms, model->title, most_ms);
}

static void check_devices(const struct planner *p) {
    for (int axis = 0; axis < STAGE_AXES; axis++) {
        struct err e = {0};
        if (!p->plan->uses[axis] || p->devices->profile[axis])
            continue;
        err_set(&e, ERR_STATE, "no profile was loaded for the %s axis", stage_axis_name(axis));
        err_list_add(p->errors, &e);
    }
}

static void check_control(const struct planner *p) {
    struct plan_point control;
    char why[PLAN_WHY];
    if (p->job->reference.mode != REFERENCE_PER_INCIDENCE && !plan_control(p, 0, &control, why))
        job_complain(p->job, p->errors, "reference.geometry", "%s", why);
}

static void left_out(struct plan *plan, const char *format, ...) __attribute__((format(printf, 2, 3)));

static void left_out(struct plan *plan, const char *format, ...) {
    if (plan->n_left_out == (int)(sizeof plan->left_out / sizeof plan->left_out[0]))
        return;
    va_list args;
    va_start(args, format);
    vsnprintf(plan->left_out[plan->n_left_out++], sizeof plan->left_out[0], format, args);
    va_end(args);
}

static void say_left_out(struct planner *p) {
    const struct config *config = p->config;
    const struct job_reference *reference = &p->job->reference;
    if (config->sample.kind == CONFIG_AXIS_FIXED)
        left_out(p->plan, "sample axis: fixed at %g deg, no device is opened", config->sample.fixed_deg);
    if (config->sample.kind == CONFIG_AXIS_MANUAL)
        left_out(p->plan, "sample axis: turned by hand, no device is opened");
    if (config->holder.kind == CONFIG_AXIS_MANUAL)
        left_out(p->plan, "holder: sample and diffuser are changed by hand, no device is opened");
    if (config_position_find(&config->holder, "trap"))
        left_out(p->plan, "holder position trap: not visited, stray light is a stated common part");
    if (config->shutter == SHUTTER_MANUAL)
        left_out(p->plan,
                 "darks at each new exposure time: the shutter is worked by hand, they are asked for "
                 "together, once in dark_every_min and at the end");
    if (config->shutter == SHUTTER_NONE)
        left_out(p->plan, "darks: there is no shutter, only the electric dark of each scan is taken off");
    if (!plan_spans(p))
        left_out(
            p->plan,
            "linearity: exposures differ by less than a factor of %d, spectrometer.linearity_u_rel stands "
            "untested",
            PLAN_OVERLAP_SPAN);
    if (reference->size_mm == 0)
        left_out(p->plan, "footprint on the diffuser: not checked, reference.size_mm is not stated");
    if (reference->angular_u_rel > 0)
        left_out(p->plan,
                 "certificate at other angles: its angular dependence is uncertain by %g %%, a common part",
                 100 * reference->angular_u_rel);
    if (reference->accept_expired)
        left_out(p->plan, "expiry of the certificate (%s): accepted by the job",
                 p->job->certificate.valid_until);
}

static void say_mounted(struct planner *p) {
    struct plan *plan = p->plan;
    const struct config_axis *holder = &p->config->holder;
    if (holder->kind != CONFIG_AXIS_MOTOR)
        return; /* the first hold asks for it */
    snprintf(plan->mounted[plan->n_mounted++], sizeof plan->mounted[0],
             "the reference diffuser at holder position %s", p->job->reference.holder);
    for (int i = 0; i < p->job->n_samples; i++) {
        bool taken = strcmp(p->job->sample[i].holder, p->job->reference.holder) == 0;
        for (int k = 0; k < i; k++)
            taken = taken || strcmp(p->job->sample[i].holder, p->job->sample[k].holder) == 0;
        if (!taken) /* else a hold asks for it when its turn comes */
            snprintf(plan->mounted[plan->n_mounted++], sizeof plan->mounted[0],
                     "sample %s at holder position %s", p->job->sample[i].name, p->job->sample[i].holder);
    }
}

static void tell_refusals(const struct planner *p, int sample) {
    int told = 0;
    for (int i = 0; i < p->plan->n_refusals && told < REFUSALS_TOLD; i++) {
        const struct refusal *refusal = &p->plan->refusal[i];
        if (refusal->sample >= 0 && refusal->sample != sample)
            continue;
        struct err e = {0};
        err_set(&e, ERR_INPUT, "refused %g:%g: %s", refusal->theta_i_deg, refusal->theta_v_deg, refusal->why);
        err_list_add(p->errors, &e);
        told++;
    }
}

static void check_something_left(const struct planner *p) {
    for (int i = 0; i < p->job->n_samples; i++) {
        bool found = false;
        for (int k = 0; k < p->points.n && !found; k++)
            found = p->points.item[k].samples & 1u << i;
        if (found)
            continue;
        job_complain(p->job, p->errors, "geometry",
                     "no geometry is left for sample %s: each was refused, as follows",
                     p->job->sample[i].name);
        tell_refusals(p, i);
    }
}

/* What can be said before any geometry is looked at. */
static void check_all(struct planner *p) {
    check_positions(p);
    check_exposures(p);
    check_devices(p);
    check_control(p);
    if (p->devices->utc_s > 0)
        job_check_expiry(p->job, p->devices->utc_s, p->errors);
}

static int make(struct planner *p) {
    int rc = plan_list_geometries(p);
    if (rc < 0)
        return rc;
    check_something_left(p);
    if (p->errors->n > 0)
        return -ERR_INPUT;
    plan_travel_table(p);
    rc = plan_order(p, p->points.item, p->points.n);
    return rc < 0 ? rc : plan_build_steps(p);
}

int plan_make(const struct job *job, const struct config *config, const struct plan_devices *devices,
              struct plan *plan, struct err_list *errors) {
    *plan = (struct plan){.start_utc_s = devices->utc_s, .free_bytes = devices->free_bytes};
    plan->uses[STAGE_SOURCE] = config->source.kind == CONFIG_AXIS_MOTOR;
    plan->uses[STAGE_SAMPLE] = config->sample.kind == CONFIG_AXIS_MOTOR;
    plan->uses[STAGE_HOLDER] = config->holder.kind == CONFIG_AXIS_MOTOR;
    struct err_list found = {0};
    struct planner planner = {
        .job = job, .config = config, .devices = devices, .plan = plan, .errors = &found};
    check_all(&planner);
    int rc = found.n > 0 ? -ERR_INPUT : make(&planner);
    if (rc == 0) {
        plan->n_geometries = planner.points.n;
        say_left_out(&planner);
        say_mounted(&planner);
        plan_costs(&planner);
    } else if (found.n == 0) {
        err_list_add(&found, &(struct err){.code = ERR_NOMEM, .text = "no memory left for the plan"});
    }
    for (size_t i = 0; i < found.n; i++)
        err_list_add(errors, &found.item[i]);
    err_list_free(&found);
    free(planner.points.item);
    return rc;
}

void plan_free(struct plan *plan) {
    free(plan->step);
    free(plan->refusal);
    *plan = (struct plan){0};
}

const char *step_kind_name(enum step_kind kind) {
    static const char *const names[] = {
        [STEP_WARM_UP] = "warm-up", [STEP_HOLD] = "hold", [STEP_REFERENCE] = "reference",
        [STEP_SAMPLE] = "sample",   [STEP_TRAP] = "trap", [STEP_OVERLAP] = "overlap",
        [STEP_PARK] = "park",
    };
    return names[kind];
}
