#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/render/spread.h"
#include "fit/render/verbs.h"
#include "proto/session.h"

#define SEED 20051 /* any: the same draws for every picture, so that pictures can be compared */

/* Why there is none goes to why. */
static bool find_joint(const struct paint *paint, struct joint *joint, char *why, size_t size) {
    struct session *session;
    struct err e = {0}, unused;
    if (paint->sha256[0] == 0) {
        snprintf(why, size, "it is given by parameters");
        return false;
    }
    int status = session_open(&session, paint->source, true, &e);
    if (!status) {
        status = session_last_joint(session, joint, &e);
        session_close(session, &unused);
    }
    if (status) {
        snprintf(why, size, "%s", e.text);
        return false;
    }
    if (joint->n == 0 || strcmp(joint->model, paint->estimate.model) != 0) {
        snprintf(why, size, "the joint fit of %s is of %s, %s", paint->source, joint->model,
                 joint->n == 0 ? joint->refusal : "not of the estimate's model");
        joint_free(joint);
        return false;
    }
    return true;
}

static json_t *find_joints(const struct scene *scene, struct joint *joint, const struct joint **known) {
    json_t *unknown = json_array();
    for (int p = 0; p < scene->n_paints; p++) {
        char why[512];
        if (find_joint(&scene->paint[p], &joint[p], why, sizeof why)) {
            known[p] = &joint[p];
            continue;
        }
        fprintf(stderr, "warning: material %s counts as exactly known: %s\n", scene->paint[p].name, why);
        json_array_append_new(unknown, json_string(scene->paint[p].name));
    }
    return unknown;
}

static int write_spread(const char *path, const struct spread *s, json_t *unknown, json_t *origin,
                        struct err *e) {
    json_t *json = json_pack("{s:s,s:i,s:I,s:i,s:f,s:f,s:f,s:f,s:f,s:f,s:f,s:O}", "file", path, "draws",
                             SPREAD_DRAWS, "seed", (json_int_t)SEED, "renderings", s->renderings,
                             "median_of_medians", s->typical_median, "median_of_p95", s->typical_p95,
                             "p95_of_p95", s->worst_p95, "median_of_sampling", s->typical_sampling,
                             "p95_of_sampling", s->worst_sampling, "median_of_noise_y", s->typical_noise,
                             "p95_of_noise_y", s->worst_noise, "exactly_known", unknown);
    json_object_set_new(origin, "uncertainty", json);
    char *text = json_dumps(origin, JSON_COMPACT);
    int status = text ? spread_save(path, s, text, e) : err_set(e, ERR_NOMEM, "no memory for the origin");
    free(text);
    if (!status) {
        printf("uncertainty: %s; CIEDE2000 of the paints in a typical pixel: median %.2g, 95 %% at most "
               "%.2g; 95 "
               "%% at most %.2g in 19 of 20 pixels\n",
               path, s->typical_median, s->typical_p95, s->worst_p95);
        if (s->renderings > 0) {
            printf("slopes:      of all paths by %d more renderings\n", s->renderings);
        }
        printf("sampling:    CIEDE2000 %.2g in a typical pixel, at most %.2g in 19 of 20\n",
               s->typical_sampling, s->worst_sampling);
        if (s->worst_noise > 0) {
            printf("noise:       Y +- %.2g in a typical pixel, at most %.2g in 19 of 20, by what was drawn "
                   "at random\n",
                   s->typical_noise, s->worst_noise);
        }
    }
    return status;
}

int verb_uncertainty(const char *path, const struct scene *scene, const struct render_options *options,
                     json_t *origin, struct err *e) {
    struct joint *joint = calloc(SCENE_PAINTS, sizeof *joint);
    const struct joint *known[SCENE_PAINTS] = {NULL};
    struct spread spread;
    if (!joint) {
        return err_set(e, ERR_NOMEM, "no memory for covariances");
    }
    json_t *unknown = find_joints(scene, joint, known);
    int status = spread_make(scene, known, SEED, options, &spread, e);
    if (!status) {
        status = write_spread(path, &spread, unknown, origin, e);
        spread_free(&spread);
    }
    for (int p = 0; p < scene->n_paints; p++) {
        joint_free(&joint[p]);
    }
    json_decref(unknown);
    free(joint);
    return status;
}
