#include "daemon/replay_private.h"

#include <libgen.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "daemon/session_text.h"

static int need_text(struct session *s, const char *key, char **text, struct err *e) {
    int rc = session_get_text(s, key, text, e);
    if (rc == 0 && !*text)
        rc = err_set(e, ERR_INPUT, "the session holds no \"%s\": it cannot be measured once more", key);
    return rc;
}

static int need_json(struct session *s, const char *key, json_t **json, struct err *e) {
    int rc = session_text_json(s, key, json, e);
    if (rc == 0 && !*json)
        rc = err_set(e, ERR_INPUT, "the session holds no \"%s\": it cannot be measured once more", key);
    return rc;
}

static void copy_name(const json_t *json, const char *key, char *to, size_t size) {
    const char *text = json_string_value(json_object_get(json, key));
    snprintf(to, size, "%s", text ? text : "");
}

/* ---- what the campaign was told ---- */

static int read_names(struct recording *r, struct session *s, struct err *e) {
    json_t *files = NULL, *sample = NULL;
    int rc = need_json(s, "files", &files, e);
    if (rc == 0)
        rc = need_json(s, "sample", &sample, e);
    copy_name(files, "job", r->job_file, sizeof r->job_file);
    copy_name(files, "certificate", r->certificate_file, sizeof r->certificate_file);
    copy_name(sample, "name", r->sample, sizeof r->sample);
    json_decref(files);
    json_decref(sample);
    return rc;
}

/* A session measured on real instruments has no seed; any bench will do for it. */
static int read_seed(struct recording *r, struct session *s, struct err *e) {
    char *seed = NULL;
    int rc = session_get_text(s, "seed", &seed, e);
    r->seed = seed && *seed ? strtoull(seed, NULL, 10) : 1;
    free(seed);
    return rc;
}

static int read_setup(struct recording *r, struct session *s, struct err *e) {
    json_t *setup = NULL;
    int rc = need_json(s, "fit_setup", &setup, e);
    const json_t *mean = json_object_get(setup, "mean_nm");
    for (int i = 0; i < 2; i++)
        r->mean_nm[i] = (int)json_integer_value(json_array_get(mean, i));
    r->u_repeat_deg[0] = json_number_value(json_object_get(setup, "u_repeat_source_deg"));
    r->u_repeat_deg[1] = json_number_value(json_object_get(setup, "u_repeat_sample_deg"));
    r->u_zero_deg[0] = json_number_value(json_object_get(setup, "u_zero_source_deg"));
    r->u_zero_deg[1] = json_number_value(json_object_get(setup, "u_zero_sample_deg"));
    const char *filling = json_string_value(json_object_get(setup, "filling"));
    r->form = (struct aperture_form){
        .source_width_deg = json_number_value(json_object_get(setup, "source_width_deg")),
        .sensor_width_deg = json_number_value(json_object_get(setup, "sensor_width_deg")),
        .beam_in_view = filling && strcmp(filling, "beam-in-view") == 0};
    json_decref(setup);
    return rc;
}

static int note_begin(void *arg, int64_t us, const char *kind, const char *text) {
    struct recording *r = arg;
    json_t *json = strcmp(kind, "begin") == 0 ? json_loads(text, 0, NULL) : NULL;
    if (json)
        r->utc_start_us = json_integer_value(json_object_get(json, "utc_us")) - us;
    json_decref(json);
    return 0;
}

/* ---- what stood there ---- */

static int own_surface(struct session *s, enum replay_surface which, struct simulate_surface *surface,
                       struct estimate *m, struct err *e) {
    json_t *truth = NULL;
    if (which == REPLAY_ESTIMATE) {
        if (session_last_estimate(s, m, NULL) < 0)
            return err_set(e, ERR_INPUT, "the session has no fitted estimate: there is nothing to mount");
        return simulate_surface_from_estimate(m, surface, e);
    }
    int rc = session_text_json(s, "truth", &truth, e);
    if (rc == 0)
        rc = truth ? simulate_surface_from_json(truth, surface, e)
                   : err_set(e, ERR_INPUT,
                             "the session has no recorded truth: it was not measured on the simulated bench, "
                             "or not of a known paint");
    json_decref(truth);
    return rc;
}

/* The other samples of the job stood there too; theirs do no more than fill the same time, so one whose session is
 * elsewhere is stood in for by the sample itself. */
static void sibling_surface(struct recording *r, const char *path, enum replay_surface which) {
    struct session *s;
    json_t *sample = NULL;
    struct estimate estimate;
    struct simulate_surface *surface = &r->surface[r->n_surfaces].surface;
    if (access(path, F_OK) != 0 || session_open(&s, path, true, NULL) < 0)
        return;
    if (session_text_json(s, "sample", &sample, NULL) == 0 &&
        own_surface(s, which, surface, &estimate, NULL) == 0) {
        copy_name(sample, "name", r->surface[r->n_surfaces].sample, sizeof r->surface[0].sample);
        r->n_surfaces += strcmp(r->surface[r->n_surfaces].sample, r->sample) != 0;
    }
    json_decref(sample);
    session_close(s, NULL);
}

static void sibling_surfaces(struct recording *r, struct session *s, enum replay_surface which) {
    json_t *names = NULL;
    char folder[PATH_MAX], path[PATH_MAX];
    snprintf(folder, sizeof folder, "%s", r->path);
    char *dir = dirname(folder);
    if (session_text_json(s, "siblings", &names, NULL) < 0)
        return;
    for (size_t i = 0; i < json_array_size(names) && r->n_surfaces < JOB_SAMPLES; i++) {
        const char *name = json_string_value(json_array_get(names, i));
        if (name && snprintf(path, sizeof path, "%s/%s.gonio", dir, name) < (int)sizeof path)
            sibling_surface(r, path, which);
    }
    json_decref(names);
}

static int read_all(struct recording *r, struct session *s, enum replay_surface which, struct err *e) {
    int rc = need_text(s, "job", &r->job, e);
    if (rc == 0)
        rc = need_text(s, "certificate", &r->certificate, e);
    if (rc == 0)
        rc = need_text(s, "config", &r->config, e);
    if (rc == 0)
        rc = read_names(r, s, e);
    if (rc == 0)
        rc = read_seed(r, s, e);
    if (rc == 0)
        rc = read_setup(r, s, e);
    if (rc == 0)
        rc = session_each_event(s, note_begin, r, e);
    if (rc == 0)
        rc = own_surface(s, which, &r->surface[0].surface, &r->estimate, e);
    if (rc < 0)
        return rc;
    snprintf(r->surface[0].sample, sizeof r->surface[0].sample, "%s", r->sample);
    r->n_surfaces = 1;
    sibling_surfaces(r, s, which);
    return 0;
}

int recording_read(struct recording *r, const char *path, enum replay_surface which, struct err *e) {
    struct session *s;
    memset(r, 0, sizeof *r);
    snprintf(r->path, sizeof r->path, "%s", path);
    int rc = session_open(&s, path, true, e);
    if (rc < 0)
        return rc;
    rc = read_all(r, s, which, e);
    session_close(s, NULL);
    return rc;
}

void recording_free(struct recording *r) {
    free(r->job);
    free(r->certificate);
    free(r->config);
}
