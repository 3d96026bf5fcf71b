#include <math.h>
#include <stdlib.h>

#include "daemon/plan_parts.h"
#include "proto/units.h"

/* A person walks to the bench, changes or turns something, and says so. Taken from the habit of optical
 * laboratories: a minute, less for two who wait for it, three when the door has to be unlocked. */
#define HOLD_US (60 * US_PER_S)
#define HOLD_LOW 0.5
#define HOLD_HIGH 3.0
/* A glossy lobe saturates about every fourth set of a sweep once; it is then read again, shorter. */
#define SETS_REPEATED 0.25
#define MOVES_HIGH 1.1 /* the share the real-time campaign may exceed its model by */

/* Rows of a session: a set of scans with its row, a point with 81 bands of value, u, covariance and common
 * parts, provisional and final, an estimate with S(lambda), and two exchanges a quarter of a second (the
 * slowest poll that feeds a drive's watchdog of 1 s, stage-modbus.md 3). */
#define EXPOSURE_BYTES 400
#define POINT_BYTES (2 * 9000)
#define ESTIMATE_BYTES 4000
#define EXCHANGE_BYTES_S (8 * 120)

int64_t plan_axis_time_us(const struct planner *p, enum stage_axis axis, int32_t distance_udeg) {
    const struct profile *profile = p->devices->profile[axis];
    return profile && distance_udeg != 0 ? axis_move_time_us(profile, distance_udeg) : 0;
}

int64_t plan_move_time_us(const struct planner *p, const struct plan_pose *from, const struct plan_pose *to) {
    int64_t source = plan_axis_time_us(p, STAGE_SOURCE, to->source_udeg - from->source_udeg);
    int64_t sample = plan_axis_time_us(p, STAGE_SAMPLE, to->sample_udeg - from->sample_udeg);
    int64_t holder = plan_axis_time_us(p, STAGE_HOLDER, to->holder_udeg - from->holder_udeg);
    int64_t slower = source > sample ? source : sample;
    return slower > holder ? slower : holder;
}

static double clamp(double value, double low, double high) {
    return value < low ? low : value > high ? high : value;
}

void plan_exposure_limits_us(const struct job *job, const struct spectrometer_model *model, double us[2]) {
    us[0] = clamp(job->exposure.min_ms * US_PER_MS, model->min_exposure_us, model->max_exposure_us);
    us[1] = clamp(job->exposure.max_ms * US_PER_MS, model->min_exposure_us, model->max_exposure_us);
}

/* Exposures spread over orders of magnitude: their middle is the geometric mean of the limits, and the
 * interval the middle of either half. */
static void exposure_times_us(const struct planner *p, double *low, double *middle, double *high) {
    double us[2];
    plan_exposure_limits_us(p->job, p->devices->spectrometer, us);
    *middle = sqrt(us[0] * us[1]);
    *low = sqrt(us[0] * *middle);
    *high = sqrt(*middle * us[1]);
}

int64_t plan_set_time_us(const struct planner *p, double exposure_us) {
    const struct spectrometer_model *model = p->devices->spectrometer;
    int frames = p->job->exposure.average + model->discards;
    return llround((frames + model->idle_cycles) * exposure_us + (double)frames * model->readout_us);
}

bool plan_spans(const struct planner *p) {
    double us[2];
    plan_exposure_limits_us(p->job, p->devices->spectrometer, us);
    return us[1] >= PLAN_OVERLAP_SPAN * us[0];
}

int64_t plan_reading_time_us(const struct planner *p) {
    double low, middle, high;
    exposure_times_us(p, &low, &middle, &high);
    return plan_set_time_us(p, middle);
}

int64_t plan_hold_time_us(void) {
    return HOLD_US;
}

/* A move against the backlash approach takes longer; for the order of points the mean of both ways counts. */
void plan_travel_table(struct planner *p) {
    for (int axis = 0; axis < 2; axis++)
        for (int i = 0; i < PLAN_TRAVEL; i++)
            p->travel_us[axis][i] = (plan_axis_time_us(p, (enum stage_axis)axis, i * PLAN_TRAVEL_UDEG) +
                                     plan_axis_time_us(p, (enum stage_axis)axis, -i * PLAN_TRAVEL_UDEG)) /
                                    2;
}

static void estimate_interval(struct planner *p, int64_t sets) {
    struct plan *plan = p->plan;
    double low, middle, high;
    exposure_times_us(p, &low, &middle, &high);
    double reading = (double)plan_set_time_us(p, middle), holds = (double)plan->n_holds * HOLD_US;
    double warm_up = p->config->lamp_warm_up_min * US_PER_MIN;
    double moves = (double)plan->estimate_us - sets * reading - holds - warm_up;
    plan->estimate_low_us =
        llround(warm_up + moves + holds * HOLD_LOW + sets * (double)plan_set_time_us(p, low));
    plan->estimate_high_us = llround(warm_up + moves * MOVES_HIGH + holds * HOLD_HIGH +
                                     sets * (1 + SETS_REPEATED) * (double)plan_set_time_us(p, high));
}

void plan_costs(struct planner *p) {
    struct plan *plan = p->plan;
    int64_t readings = 0;
    for (int i = 0; i < plan->n_steps; i++) {
        const struct step *step = &plan->step[i];
        plan->estimate_us += step->estimate_us;
        readings += step->kind == STEP_SAMPLE || step->kind == STEP_REFERENCE;
        readings += step->kind == STEP_OVERLAP ? 2 : 0;
        plan->n_points += step->kind == STEP_SAMPLE;
        plan->n_holds += step->kind == STEP_HOLD;
    }
    int64_t sets = readings + p->n_darks;
    int n_motors = plan->uses[STAGE_SOURCE] + plan->uses[STAGE_SAMPLE] + plan->uses[STAGE_HOLDER];
    plan->n_exposures = (int)(sets * p->job->exposure.average);
    plan->bytes = sets * EXPOSURE_BYTES + plan->n_exposures * 2.0 * p->devices->spectrometer->pixels +
                  plan->n_points * (double)(POINT_BYTES + ESTIMATE_BYTES) +
                  (double)plan->estimate_us / US_PER_S * n_motors * EXCHANGE_BYTES_S;
    estimate_interval(p, sets);
}
