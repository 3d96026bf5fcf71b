#include "daemon/plan_forecast.h"

#include <math.h>
#include <stdlib.h>

#include "daemon/instruments.h"
#include "daemon/reduce.h"
#include "fit/forecast.h"
#include "fit/spot.h"
#include "proto/profile.h"
#include "proto/units.h"

#define FULL_SCALE 65535.0
#define SPREAD_NM 650.0   /* what a grating for the visible puts on the pixels: 350 to 1000 nm */
#define LAMP_LEVEL 0.5    /* of its peak, over the mean's range: a halogen lamp between 400 and 700 nm */
#define COLOUR_LEVEL 0.33 /* of its brightest band, the mean of a paint's diffuse part: Hooker's Green */
#define MODEL "composite" /* of the published sets */

struct points {
    size_t n;
    double *theta_i_deg, *theta_v_deg;
    double *middle_us; /* [n_steps] since the plan began */
    bool *mirrored;
    int *step, *interval; /* [n] of the plan; of darks */
    int *listed;          /* [n] bracket by bracket, as tau_us and tau_r_us */
    double *tau_us, *tau_r_us;
    struct estimate_bracket *bracket;
    double *control; /* [n_controls * n] */
    size_t n_brackets, n_controls;
};

static bool is_point(const struct step *step) {
    return step->kind == STEP_SAMPLE && step->sample == 0;
}

static bool is_control(const struct step *step) {
    return step->kind == STEP_REFERENCE && step->control;
}

static int allocate(struct points *p, const struct plan *plan, struct err *e) {
    const size_t n = (size_t)plan->n_steps + 1;
    for (int i = 0; i < plan->n_steps; i++)
        p->n_controls += is_control(&plan->step[i]);
    p->theta_i_deg = calloc(n, sizeof(double));
    p->theta_v_deg = calloc(n, sizeof(double));
    p->middle_us = calloc(n, sizeof(double));
    p->mirrored = calloc(n, sizeof(bool));
    p->step = calloc(n, sizeof(int));
    p->interval = calloc(n, sizeof(int));
    p->listed = calloc(n, sizeof(int));
    p->tau_us = calloc(n, sizeof(double));
    p->tau_r_us = calloc(n, sizeof(double));
    p->bracket = calloc(n, sizeof *p->bracket);
    p->control = calloc(n * (p->n_controls + 1), sizeof(double));
    return p->theta_i_deg && p->theta_v_deg && p->middle_us && p->mirrored && p->step && p->interval &&
                   p->listed && p->tau_us && p->tau_r_us && p->bracket && p->control
               ? 0
               : err_set(e, ERR_NOMEM, "no memory for a forecast");
}

static void free_points(struct points *p) {
    free(p->theta_i_deg);
    free(p->theta_v_deg);
    free(p->middle_us);
    free(p->mirrored);
    free(p->step);
    free(p->interval);
    free(p->listed);
    free(p->tau_us);
    free(p->tau_r_us);
    free(p->bracket);
    free(p->control);
}

static int take_points(struct points *p, const struct plan *plan, const struct job *job, struct err *e) {
    int rc = allocate(p, plan, e);
    double begun_us = 0;
    for (int i = 0; rc == 0 && i < plan->n_steps; i++) {
        p->middle_us[i] = begun_us + (double)plan->step[i].estimate_us / 2;
        begun_us += (double)plan->step[i].estimate_us;
        if (is_point(&plan->step[i])) {
            p->theta_i_deg[p->n] = deg_from_udeg(plan->step[i].theta_i_udeg);
            p->theta_v_deg[p->n] = deg_from_udeg(plan->step[i].theta_v_udeg);
            p->mirrored[p->n] = plan->step[i].mirrored;
            p->interval[p->n] = (int)(p->middle_us[i] / (job->exposure.dark_every_min * US_PER_MIN));
            p->step[p->n++] = i;
        }
    }
    return rc;
}

/* One bracket, between the control readings of two steps: what of each is in its points (reduce_point.c), and when they
 * were taken. */
static void take_bracket(struct points *p, const struct plan *plan, const int control[2], size_t nth,
                         size_t from, double rate, double u_reading) {
    struct estimate_bracket *b = &p->bracket[p->n_brackets];
    const double open_us = p->middle_us[control[0]], length_us = p->middle_us[control[1]] - open_us;
    *b = (struct estimate_bracket){.point = p->listed + from,
                                   .tau_us = p->tau_us + from,
                                   .tau_r_us = p->tau_r_us + from,
                                   .length_us = length_us,
                                   .rate = rate};
    for (size_t i = 0; i < p->n; i++) {
        const struct step *step = &plan->step[p->step[i]];
        const bool own = step->reference >= 0 && !is_control(&plan->step[step->reference]);
        if (step->bracket != plan->step[control[0]].opens)
            continue;
        const double tau_us = p->middle_us[p->step[i]] - open_us;
        const double tau_r_us = own ? p->middle_us[step->reference] - open_us : 0;
        const double f = tau_us / length_us, f_r = tau_r_us / length_us;
        p->control[nth * p->n + i] = u_reading * ((1 - f) - (own ? 1 - f_r : 0));
        p->control[(nth + 1) * p->n + i] = u_reading * (f - (own ? f_r : 0));
        p->listed[from + b->n] = (int)i;
        p->tau_us[from + b->n] = tau_us;
        p->tau_r_us[from + b->n++] = tau_r_us;
    }
    p->n_brackets += b->n > 0;
}

static void take_brackets(struct points *p, const struct plan *plan, double rate, double u_reading) {
    int control[2] = {-1, -1};
    size_t nth = 0, from = 0;
    for (int i = 0; i < plan->n_steps; i++) {
        if (!is_control(&plan->step[i]))
            continue;
        control[0] = control[1];
        control[1] = i;
        if (control[0] >= 0) {
            const size_t before = p->n_brackets;
            take_bracket(p, plan, control, nth++, from, rate, u_reading);
            from += p->n_brackets > before ? p->bracket[before].n : 0;
        }
    }
}

/* Of one reading at its target: the mean over the bands averages its pixels, but all of them are less one electric dark.
 * Its dark is another such reading. */
static struct forecast_noise noise_of(const struct job *job, const struct plan_devices *devices,
                                      const struct reduce_setup *setup) {
    const struct spectrometer_model *model = devices->spectrometer;
    const double range_nm = job->mean_nm[1] - job->mean_nm[0] + BAND_STEP_NM;
    const double pixels = (model->active_last - model->active_first + 1) * fmin(range_nm / SPREAD_NM, 1);
    const double readings = pixels * job->exposure.average;
    const double blind = (model->dark_last - model->dark_first + 1) * job->exposure.average;
    const double level = job->exposure.target * LAMP_LEVEL;
    const double counts = level * FULL_SCALE; /* of one pixel, one scan */
    const bool own = job->reference.mode == REFERENCE_EVERY_GEOMETRY;
    struct forecast_noise noise = {.relative = 1 / sqrt(readings * counts * model->electrons_per_count),
                                   .read = model->read_noise_counts / counts * sqrt(1 / readings + 1 / blind),
                                   .colour = COLOUR_LEVEL,
                                   .linearity = setup->linearity_rel * level};
    double us[2];
    plan_exposure_limits_us(job, model, us);
    noise.span = us[1] / us[0];
    noise.dark = setup->without_dark ? 0 : noise.read;
    noise.reference = own ? hypot(noise.relative, noise.read) : 0;
    return noise;
}

/* Mean relative u of the diffuser over the bands of mean_nm, at the job's reference geometry or a point's own. */
static double certificate_rel(const struct job *job, const struct points *p) {
    double beta[BANDS], u[BANDS], used = 0, sum = 0;
    bool covered[BANDS];
    int n = 0;
    const bool own = job->reference.mode == REFERENCE_EVERY_GEOMETRY && p->n > 0;
    const double i_deg = own ? p->theta_i_deg[0] : job->reference.theta_i_deg;
    const double v_deg = own ? p->theta_v_deg[0] : job->reference.theta_v_deg;
    if (certificate_at(&job->certificate, i_deg, v_deg, job->reference.angular_u_rel, beta, u, covered, &used,
                       NULL) < 0)
        return 0;
    for (int b = 0; b < BANDS; b++)
        if (covered[b] && band_nm(b) >= job->mean_nm[0] && band_nm(b) <= job->mean_nm[1]) {
            sum += u[b] / beta[b];
            n++;
        }
    return n ? hypot(sum / n, used) : 0;
}

static int take_angles(struct estimate_input *in, const struct points *p, const struct job *job,
                       const struct config *config, const struct plan_devices *devices, struct err *e) {
    *in = (struct estimate_input){
        .n = p->n,
        .theta_i_deg = p->theta_i_deg,
        .theta_v_deg = p->theta_v_deg,
        .mirrored = p->mirrored,
        .u_repeat_source_deg = instruments_u_repeat_deg(config, STAGE_SOURCE, devices->profile[STAGE_SOURCE]),
        .u_repeat_sample_deg = instruments_u_repeat_deg(config, STAGE_SAMPLE, devices->profile[STAGE_SAMPLE]),
        .u_zero_source_deg = config->source.u_zero_deg,
        .u_zero_sample_deg = config->sample.u_zero_deg,
        .source_width_deg = config->optics.source_width_deg,
        .sensor_width_deg = config->optics.sensor_width_deg,
        .polarisation = config->optics.polarisation_p,
        .u_polarisation = config->optics.u_polarisation,
        .kappa = 1,
        .n_bracket = p->n_brackets,
        .bracket = p->bracket,
        .mean_low_nm = job->mean_nm[0],
        .mean_high_nm = job->mean_nm[1],
        .model = MODEL};
    in->filling =
        config->optics.filling == FILLING_BEAM_IN_VIEW ? ESTIMATE_BEAM_IN_VIEW : ESTIMATE_VIEW_IN_BEAM;
    return spot_find_reference(job_mode_name(job->reference.mode), &in->reference, e);
}

static json_t *named(const double *value) {
    json_t *json = json_object();
    for (int p = 0; p < MATERIAL_PARAMETERS; p++) {
        const char *name = material_parameter_name(MODEL, p);
        if (name)
            json_object_set_new(json, name, isfinite(value[p]) ? json_real(value[p]) : json_null());
    }
    return json;
}

static json_t *set_json(const struct published *set, const struct forecast *f) {
    json_t *gaps = json_array();
    for (int p = 0; p < MATERIAL_PARAMETERS; p++)
        if (f->not_identifiable[p])
            json_array_append_new(gaps, json_pack("{s:s, s:s, s:{s:f, s:f}}", "parameter",
                                                  material_parameter_name(MODEL, p), "why", f->why[p],
                                                  "measure_next", "theta_i_deg", f->next[p].theta_i_deg,
                                                  "theta_v_deg", f->next[p].theta_v_deg));
    return json_pack("{s:s, s:s, s:o, s:o, s:o, s:o, s:o}", "name", set->name, "description",
                     set->description, "parameters", named(set->value), "std", named(f->u), "std_statistical",
                     named(f->statistical), "std_common", named(f->common), "not_identifiable", gaps);
}

static json_t *forecast_points(struct points *p, const struct plan *plan, const struct job *job,
                               const struct config *config, const struct plan_devices *devices,
                               struct err *e) {
    struct estimate_input in;
    struct reduce_setup setup;
    reduce_setup_stated(&setup, job, config);
    struct forecast_noise noise = noise_of(job, devices, &setup);
    const double scale = certificate_rel(job, p);
    take_brackets(p, plan, setup.drift_rate_prior, hypot(noise.relative, noise.read));
    noise.interval = p->interval;
    noise.control = p->control;
    noise.n_controls = p->n_controls;
    int rc = take_angles(&in, p, job, config, devices, e);
    json_t *sets = json_array();
    for (int i = 0; i < PUBLISHED_SETS && rc == 0; i++) {
        struct forecast f;
        rc = forecast_make(&in, &noise, scale, published[i].value, &f, e);
        if (rc == 0)
            json_array_append_new(sets, set_json(&published[i], &f));
    }
    if (rc < 0) {
        json_decref(sets);
        return NULL;
    }
    return json_pack(
        "{s:s, s:i, s:f, s:f, s:o}", "sample", job->sample[0].name, "points", (int)p->n, "noise_relative",
        sqrt(noise.relative * noise.relative + noise.read * noise.read + noise.reference * noise.reference),
        "certificate_relative", scale, "sets", sets);
}

json_t *plan_forecast(const struct plan *plan, const struct job *job, const struct config *config,
                      const struct plan_devices *devices, struct err *e) {
    struct points p = {0};
    json_t *json =
        take_points(&p, plan, job, e) == 0 ? forecast_points(&p, plan, job, config, devices, e) : NULL;
    free_points(&p);
    return json;
}

static void print_set(const json_t *set, FILE *out) {
    const json_t *values = json_object_get(set, "parameters"), *std = json_object_get(set, "std");
    fprintf(out, "  %-10s", json_string_value(json_object_get(set, "name")));
    for (int p = 0; p < MATERIAL_PARAMETERS; p++) {
        const char *name = material_parameter_name(MODEL, p);
        const json_t *u = name ? json_object_get(std, name) : NULL;
        if (json_is_number(u))
            fprintf(out, " %8.2g %%",
                    100 * json_number_value(u) / json_number_value(json_object_get(values, name)));
        else if (name)
            fprintf(out, " %10s", "unknown");
    }
    fputc('\n', out);
}

static void print_gaps(const json_t *set, FILE *out) {
    const json_t *gap;
    size_t i;
    json_array_foreach(json_object_get(set, "not_identifiable"), i, gap) {
        const json_t *next = json_object_get(gap, "measure_next");
        fprintf(out, "  not identifiable on %s: %s: %s; measure next at incidence %g deg, viewing %g deg\n",
                json_string_value(json_object_get(set, "name")),
                json_string_value(json_object_get(gap, "parameter")),
                json_string_value(json_object_get(gap, "why")),
                json_number_value(json_object_get(next, "theta_i_deg")),
                json_number_value(json_object_get(next, "theta_v_deg")));
    }
}

void plan_forecast_print(const json_t *forecast, FILE *out) {
    const json_t *sets = json_object_get(forecast, "sets"), *set;
    size_t i;
    fprintf(out,
            "To be expected of the published paints at these %d points, u by noise (%.2g of a mean), "
            "darks, drift,\nlinearity, axes, zeros, polarisation and certificate (%.2g); stray light, "
            "and what colour adds, come on top:\n  %-10s",
            (int)json_integer_value(json_object_get(forecast, "points")),
            json_number_value(json_object_get(forecast, "noise_relative")),
            json_number_value(json_object_get(forecast, "certificate_relative")), "");
    for (int p = 0; p < MATERIAL_PARAMETERS; p++)
        if (material_parameter_name(MODEL, p))
            fprintf(out, " %10s", material_parameter_name(MODEL, p));
    fputc('\n', out);
    json_array_foreach(sets, i, set) {
        print_set(set, out);
    }
    json_array_foreach(sets, i, set) {
        print_gaps(set, out);
    }
}
