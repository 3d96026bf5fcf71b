#include "daemon/reduce.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/config.h"
#include "daemon/session_text.h"

/* Relative variance per second: 0.1 % in 1000 s, a halogen lamp on a good supply. */
#define DRIFT_RATE_PRIOR 1e-9
#define STRAY_LIGHT_REL 5e-4 /* spectrometer-ocean.md 7 */

void reduce_setup_stated(struct reduce_setup *setup, const struct job *job, const struct config *config) {
    *setup = (struct reduce_setup){.certificate = &job->certificate,
                                   .mode = job->reference.mode,
                                   .angular_u_rel = job->reference.angular_u_rel,
                                   .beam_in_view = config->optics.filling == FILLING_BEAM_IN_VIEW,
                                   .mean_nm = {job->mean_nm[0], job->mean_nm[1]},
                                   .without_dark = config->shutter == SHUTTER_NONE,
                                   .drift_rate_prior = DRIFT_RATE_PRIOR,
                                   .stray_light_rel = STRAY_LIGHT_REL,
                                   .linearity_rel = config->spectrometer.linearity_u_rel};
}

json_t *reduce_setup_to_json(const struct reduce_setup *s) {
    return json_pack("{s:s, s:f, s:b, s:b, s:[i,i], s:f, s:f, s:f, s:f, s:f}", "mode", job_mode_name(s->mode),
                     "angular_u_rel", s->angular_u_rel, "beam_in_view", s->beam_in_view, "without_dark",
                     s->without_dark, "mean_nm", s->mean_nm[0], s->mean_nm[1], "drift_rate_prior",
                     s->drift_rate_prior, "stray_light_rel", s->stray_light_rel, "linearity_rel",
                     s->linearity_rel, "bench_stray_beta", s->bench_stray_beta, "reference_snr_min",
                     s->reference_snr_min);
}

int reduce_setup_from_json(const json_t *json, struct reduce_setup *s, struct err *e) {
    const char *mode;
    json_error_t problem;
    int beam_in_view, without_dark;
    /* F takes whole numbers too: jansson prints 0.0 as a real, other writers may not. */
    if (json_unpack_ex(
            (json_t *)(uintptr_t)json, &problem, 0, "{s:s, s:F, s:b, s:b, s:[ii], s:F, s:F, s:F, s:F, s:F}",
            "mode", &mode, "angular_u_rel", &s->angular_u_rel, "beam_in_view", &beam_in_view, "without_dark",
            &without_dark, "mean_nm", &s->mean_nm[0], &s->mean_nm[1], "drift_rate_prior",
            &s->drift_rate_prior, "stray_light_rel", &s->stray_light_rel, "linearity_rel", &s->linearity_rel,
            "bench_stray_beta", &s->bench_stray_beta, "reference_snr_min", &s->reference_snr_min) < 0)
        return err_set(e, ERR_INPUT, "the setup of the reduction is incomplete: %s", problem.text);
    s->beam_in_view = beam_in_view;
    s->without_dark = without_dark;
    for (int i = REFERENCE_FIXED; i <= REFERENCE_START_END; i++)
        if (strcmp(mode, job_mode_name(i)) == 0) {
            s->mode = i;
            return 0;
        }
    return err_set(e, ERR_INPUT, "the setup of the reduction names the unknown reference mode '%s'", mode);
}

static int absent(const char *key, struct err *e) {
    return err_set(e, ERR_STATE, "the session holds no '%s'; its points cannot be derived again", key);
}

static int read_setup_text(struct session *s, struct reduce_setup *setup, struct err *e) {
    json_t *json;
    int rc = session_text_json(s, "reduce_setup", &json, e);
    if (rc == 0)
        rc = json ? reduce_setup_from_json(json, setup, e) : absent("reduce_setup", e);
    json_decref(json);
    return rc;
}

static int read_certificate(struct session *s, struct certificate *certificate, struct err *e) {
    char *text;
    struct err_list errors = {0};
    int rc = session_get_text(s, "certificate", &text, e);
    if (rc == 0 && !text)
        rc = absent("certificate", e);
    if (rc < 0)
        return rc;
    rc = certificate_read_text("certificate of the session", text, strlen(text), certificate, &errors);
    if (rc < 0 && errors.n) {
        char sentence[600];
        err_set(e, ERR_INPUT, "%.500s", err_format(&errors.item[0], sentence, sizeof sentence));
    }
    err_list_free(&errors);
    free(text);
    return rc;
}

int reduce_setup_from_session(struct session *s, struct reduce_setup *setup, struct certificate *certificate,
                              struct err *e) {
    memset(setup, 0, sizeof *setup);
    int rc = read_setup_text(s, setup, e);
    if (rc == 0)
        rc = session_get_calibration(s, &setup->calibration, e);
    if (rc == 0)
        rc = read_certificate(s, certificate, e);
    setup->certificate = certificate;
    return rc;
}

struct ends { /* of brackets that no closing reading ended */
    size_t n, capacity, next;
    struct end {
        int64_t after_exposure;
        char why[32];
    } * item;
};

static int note_end(void *arg, const struct bracket *b) {
    struct ends *ends = arg;
    if (strcmp(b->ended_by, "reference") == 0)
        return 0;
    if (ends->n == ends->capacity) {
        size_t capacity = ends->capacity ? 2 * ends->capacity : 8;
        struct end *grown = realloc(ends->item, capacity * sizeof *grown);
        if (!grown)
            return -ERR_NOMEM;
        ends->item = grown;
        ends->capacity = capacity;
    }
    struct end *end = &ends->item[ends->n++];
    end->after_exposure = b->last_exposure_id;
    snprintf(end->why, sizeof end->why, "%s", b->ended_by);
    return 0;
}

struct replay {
    struct reducer *r;
    const struct reduce_sink *sink;
    struct ends ends;
    struct err *e;
};

static int end_brackets(struct replay *replay, int64_t before_exposure) {
    struct ends *ends = &replay->ends;
    int rc = 0;
    while (rc == 0 && ends->next < ends->n && ends->item[ends->next].after_exposure < before_exposure)
        rc =
            reducer_end_bracket(replay->r, ends->item[ends->next++].why, replay->sink, NULL, NULL, replay->e);
    return rc;
}

static int replay_exposure(void *arg, const struct exposure *x) {
    struct replay *replay = arg;
    int rc = end_brackets(replay, x->id);
    return rc < 0 ? rc : reducer_add(replay->r, x, replay->sink, replay->e);
}

int reduce_replay(struct session *s, struct reducer *r, const struct reduce_sink *sink, struct err *e) {
    struct replay replay = {.r = r, .sink = sink, .e = e};
    int rc = session_each_bracket(s, note_end, &replay.ends, e);
    if (rc == 0)
        rc = session_each_exposure(s, replay_exposure, &replay, e);
    if (rc == 0)
        rc = end_brackets(&replay, INT64_MAX);
    free(replay.ends.item);
    return rc;
}

int reduce_anew(struct session *s, const struct reduce_sink *sink, struct err *e) {
    struct reduce_setup setup;
    struct certificate certificate = {0};
    struct reducer *r = NULL;
    int rc = reduce_setup_from_session(s, &setup, &certificate, e);
    if (rc == 0)
        rc = reducer_new(&r, &setup, e);
    if (rc == 0)
        rc = reduce_replay(s, r, sink, e);
    reducer_free(r);
    certificate_free(&certificate);
    return rc;
}
