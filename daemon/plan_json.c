#include <jansson.h>

#include "daemon/plan.h"
#include "proto/units.h"

static json_t *target_json(const struct stage_target *target) {
    static const char *const names[STAGE_AXES] = {"source_deg", "sample_deg", "holder_deg"};
    json_t *json = json_object();
    for (int axis = 0; axis < STAGE_AXES; axis++)
        if (target->used[axis])
            json_object_set_new(json, names[axis], json_real(deg_from_udeg(target->udeg[axis])));
    return json;
}

static void add_reading(json_t *json, const struct step *step, const struct job *job) {
    if (step->sample >= 0)
        json_object_set_new(json, "sample", json_string(job->sample[step->sample].name));
    json_object_set_new(json, "theta_i_deg", json_real(deg_from_udeg(step->theta_i_udeg)));
    json_object_set_new(json, "theta_v_deg", json_real(deg_from_udeg(step->theta_v_udeg)));
    json_object_set_new(json, "mirrored", json_boolean(step->mirrored));
    json_object_set_new(json, "reciprocal", json_boolean(step->reciprocal));
    json_object_set_new(json, "bracket", json_integer(step->bracket));
    if (step->control)
        json_object_set_new(json, "opens", json_integer(step->opens));
    json_object_set_new(json, "control", json_boolean(step->control));
    json_object_set_new(json, "repeat", json_boolean(step->repeat));
    if (step->reference >= 0)
        json_object_set_new(json, "reference", json_integer(step->reference));
}

static json_t *step_json(const struct step *step, int index, const struct job *job) {
    json_t *json = json_object();
    json_object_set_new(json, "step", json_integer(index));
    json_object_set_new(json, "kind", json_string(step_kind_name(step->kind)));
    if (step->kind == STEP_REFERENCE || step->kind == STEP_SAMPLE || step->kind == STEP_TRAP ||
        step->kind == STEP_OVERLAP)
        add_reading(json, step, job);
    json_object_set_new(json, "target", target_json(&step->target));
    if (step->n_via > 0) {
        json_t *via = json_array();
        for (int i = 0; i < step->n_via; i++)
            json_array_append_new(via, target_json(&step->via[i]));
        json_object_set_new(json, "via", via);
    }
    json_object_set_new(json, "estimate_s", json_real((double)step->estimate_us / US_PER_S));
    if (step->text[0])
        json_object_set_new(json, "text", json_string(step->text));
    return json;
}

static json_t *refusal_json(const struct refusal *refusal, const struct job *job) {
    json_t *json = json_pack("{s:f, s:f, s:s}", "theta_i_deg", refusal->theta_i_deg, "theta_v_deg",
                             refusal->theta_v_deg, "why", refusal->why);
    if (refusal->sample >= 0)
        json_object_set_new(json, "sample", json_string(job->sample[refusal->sample].name));
    return json;
}

static json_t *seconds(int64_t us) {
    return json_real((double)us / US_PER_S);
}

struct json_t *plan_to_json(const struct plan *plan, const struct job *job) {
    json_t *steps = json_array(), *refusals = json_array(), *left_out = json_array(), *mounted = json_array();
    for (int i = 0; i < plan->n_steps; i++)
        json_array_append_new(steps, step_json(&plan->step[i], i, job));
    for (int i = 0; i < plan->n_refusals; i++)
        json_array_append_new(refusals, refusal_json(&plan->refusal[i], job));
    for (int i = 0; i < plan->n_left_out; i++)
        json_array_append_new(left_out, json_string(plan->left_out[i]));
    for (int i = 0; i < plan->n_mounted; i++)
        json_array_append_new(mounted, json_string(plan->mounted[i]));
    return json_pack("{s:s, s:s, s:i, s:i, s:i, s:i, s:i, s:f, s:o, s:o, s:o, s:o, s:o, s:o, s:o}", "job",
                     job->name, "mode", job_mode_name(job->reference.mode), "geometries", plan->n_geometries,
                     "points", plan->n_points, "brackets", plan->n_brackets, "holds", plan->n_holds,
                     "exposures", plan->n_exposures, "bytes", plan->bytes, "estimate_s",
                     seconds(plan->estimate_us), "estimate_low_s", seconds(plan->estimate_low_us),
                     "estimate_high_s", seconds(plan->estimate_high_us), "mounted", mounted, "left_out",
                     left_out, "refusals", refusals, "steps", steps);
}
