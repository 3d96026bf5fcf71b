/* What the campaign asks `goniofit --serve` (fit/serve.h): the present points of a sample after new ones have come,
 * always the newest state and one question at a time; at the end all final points, and none that is provisional. */
#include "daemon/campaign_private.h"

#include <stdio.h>
#include <string.h>

/* A thousand times faster than real, a fit takes seconds. In virtual time measuring goes on meanwhile, as it does in real
 * time, and a new question waits until the points have grown by this factor. */
#define VIRTUAL_FIT_US (20 * US_PER_S)
#define VIRTUAL_GROWTH 1.25

struct fit_point {
    int64_t id, exposure_id;
    bool provisional, usable;
    int bracket;
    double tau_us, tau_r_us;
    int n_common;
    struct {
        int cause;
        double mean;
    } common[POINT_COMMON_MAX];
    double (*band)[BANDS]; /* [n_common] change of each band; NAN = missing */
    char *json;            /* as the final question holds it, but for its end; written once */
    int online;            /* of it: what an online question holds */
};

struct fit_bracket {
    int number;
    double length_us, rate; /* length 0: not closed */
};

struct fit_points {
    int n, capacity, n_causes, n_brackets, n_fitted;
    struct fit_point *point;
    char (*cause)[40];
    struct fit_bracket *bracket;
    bool *mirrored;            /* by exposure id */
    struct point_slope *asked; /* [n_asked] the points of the open question, in its order */
    int n_asked;
    int64_t n_exposures;
};

/* ---- the present state of the points ---- */

struct fit_points *fit_points_new(void) {
    return calloc(1, sizeof(struct fit_points));
}

static void clear_point(struct fit_point *p) {
    free(p->json);
    free(p->band);
}

void fit_points_free(struct fit_points *f) {
    if (!f)
        return;
    for (int i = 0; i < f->n; i++)
        clear_point(&f->point[i]);
    free(f->point);
    free(f->cause);
    free(f->bracket);
    free(f->mirrored);
    free(f->asked);
    free(f);
}

int fit_points_exposure(struct fit_points *f, int64_t id, bool mirrored) {
    bool *larger = realloc(f->mirrored, (id + 1) * sizeof *larger);
    if (!larger)
        return -ERR_NOMEM;
    f->mirrored = larger;
    for (; f->n_exposures < id; f->n_exposures++)
        larger[f->n_exposures] = false;
    larger[id] = mirrored;
    f->n_exposures = id + 1;
    return 0;
}

static void put_bands(FILE *out, const double *value) {
    for (int k = 0; k < BANDS; k++)
        if (isfinite(value[k]))
            fprintf(out, "%c%.9g", k ? ',' : '[', value[k]);
        else
            fprintf(out, "%cnull", k ? ',' : '[');
    fputc(']', out);
}

/* The covariances of neighbouring bands come last: the joint fit alone asks for them, at the end. */
static char *point_json(const struct fit_points *f, const struct point *p, int *online) {
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    if (!out)
        return NULL;
    bool mirrored = p->exposure_id < f->n_exposures && f->mirrored[p->exposure_id];
    fprintf(out, "{\"theta_i_deg\":%.6f,\"theta_v_deg\":%.6f,\"provisional\":%s,\"mirrored\":%s",
            deg_from_udeg(p->theta_i_udeg), deg_from_udeg(p->theta_v_udeg), p->provisional ? "true" : "false",
            mirrored ? "true" : "false");
    fprintf(out, ",\"beta\":%.17g,\"u_ind\":%.17g", p->mean, p->mean_u_ind);
    fputs(",\"bands\":", out);
    put_bands(out, p->beta);
    fputs(",\"bands_u\":", out);
    put_bands(out, p->u_ind);
    *online = (int)ftell(out);
    fputs(",\"bands_cov_next\":", out);
    put_bands(out, p->cov_next);
    return fclose(out) == 0 ? text : (free(text), NULL);
}

static int cause_of(struct fit_points *f, const char *name) {
    for (int i = 0; i < f->n_causes; i++)
        if (!strcmp(f->cause[i], name))
            return i;
    char(*larger)[40] = realloc(f->cause, (f->n_causes + 1) * sizeof *larger);
    if (!larger)
        return -1;
    f->cause = larger;
    snprintf(f->cause[f->n_causes], sizeof *f->cause, "%s", name);
    return f->n_causes++;
}

static struct fit_point *place_of(struct fit_points *f, const struct point *p) {
    for (int i = f->n - 1; i >= 0 && p->supersedes; i--)
        if (f->point[i].id == p->supersedes)
            return &f->point[i];
    if (f->n == f->capacity) {
        int capacity = f->capacity ? 2 * f->capacity : 64;
        struct fit_point *larger = realloc(f->point, capacity * sizeof *larger);
        if (!larger)
            return NULL;
        f->point = larger;
        f->capacity = capacity;
    }
    f->point[f->n] = (struct fit_point){0};
    return &f->point[f->n++];
}

int fit_points_add(struct fit_points *f, const struct point *p) {
    struct fit_point *to = place_of(f, p);
    if (!to)
        return -ERR_NOMEM;
    clear_point(to);
    *to = (struct fit_point){.id = p->id,
                             .exposure_id = p->exposure_id,
                             .provisional = p->provisional,
                             .usable = !p->saturated && isfinite(p->mean) && isfinite(p->mean_u_ind),
                             .bracket = p->bracket,
                             .tau_us = p->tau_us,
                             .tau_r_us = p->tau_r_us,
                             .n_common = p->n_common,
                             .band = malloc((size_t)(p->n_common + 1) * sizeof *to->band)};
    if (!to->band)
        return -ERR_NOMEM;
    for (int i = 0; i < p->n_common; i++) {
        to->common[i].cause = cause_of(f, p->common[i].name);
        to->common[i].mean = p->common[i].mean;
        for (int k = 0; k < BANDS; k++)
            to->band[i][k] = p->present[k] ? p->common[i].sensitivity[k] : NAN;
        if (to->common[i].cause < 0)
            return -ERR_NOMEM;
    }
    to->json = to->usable ? point_json(f, p, &to->online) : NULL;
    return to->usable && !to->json ? -ERR_NOMEM : 0;
}

/* Points of a bracket that ended without its closing reading are measured again: they count no more. */
static void drop_provisional(struct fit_points *f, int bracket) {
    for (int i = 0; i < f->n; i++)
        if (f->point[i].bracket == bracket && f->point[i].provisional)
            f->point[i].usable = false;
}

void fit_points_bracket(struct fit_points *f, const struct bracket *b) {
    if (strcmp(b->ended_by, "reference") != 0)
        drop_provisional(f, b->number);
    struct fit_bracket *larger = realloc(f->bracket, (f->n_brackets + 1) * sizeof *larger);
    if (!larger)
        return; /* its points then enter as of an open bracket, with the larger variance */
    f->bracket = larger;
    f->bracket[f->n_brackets++] =
        (struct fit_bracket){b->number, (double)(b->close_us - b->open_us), b->mean_rate};
}

/* ---- the question ---- */

struct question {
    bool final;
    const struct fit_points *f;
    const struct reducer *reducer;
    int n;
    int *use; /* [n] index into f->point */
};

static int choose(struct question *q) {
    q->use = calloc(q->f->n + 1, sizeof *q->use);
    if (!q->use)
        return -ERR_NOMEM;
    for (int i = 0; i < q->f->n; i++)
        if (q->f->point[i].usable && !(q->final && q->f->point[i].provisional))
            q->use[q->n++] = i;
    return 0;
}

static void put_points(FILE *out, const struct question *q) {
    fputs("\"points\":[", out);
    for (int i = 0; i < q->n; i++) {
        const struct fit_point *p = &q->f->point[q->use[i]];
        fprintf(out, "%s%.*s}", i ? "," : "", q->final ? -1 : p->online, p->json);
    }
    fputc(']', out);
}

/* Which of point i's common parts a cause is; -1 = it does not touch the point. */
static int part_of(const struct question *q, int i, int cause) {
    const struct fit_point *p = &q->f->point[q->use[i]];
    int k = p->n_common - 1;
    while (k >= 0 && p->common[k].cause != cause)
        k--;
    return k;
}

static void put_parts(FILE *out, const struct question *q, int cause, const char *name,
                      void (*put)(FILE *out, const struct fit_point *p, int i, int part)) {
    char glue = '[';
    fprintf(out, "\"%s\":", name);
    for (int i = 0; i < q->n; i++) {
        int part = part_of(q, i, cause);
        if (part < 0)
            continue;
        fputc(glue, out);
        put(out, &q->f->point[q->use[i]], i, part);
        glue = ',';
    }
    fputc(']', out);
}

static void put_index(FILE *out, const struct fit_point *p, int i, int part) {
    (void)p;
    (void)part;
    fprintf(out, "%d", i);
}

static void put_mean(FILE *out, const struct fit_point *p, int i, int part) {
    (void)i;
    fprintf(out, "%.17g", p->common[part].mean);
}

static void put_part_bands(FILE *out, const struct fit_point *p, int i, int part) {
    (void)i;
    put_bands(out, p->band[part]);
}

/* By band in the final question only: online, a change in proportion to the mean is near enough. */
static void put_cause(FILE *out, const struct question *q, int cause) {
    fprintf(out, "{\"name\":\"%s\",", q->f->cause[cause]);
    put_parts(out, q, cause, "points", put_index);
    fputc(',', out);
    put_parts(out, q, cause, "mean", put_mean);
    if (q->final) {
        fputc(',', out);
        put_parts(out, q, cause, "bands", put_part_bands);
    }
    fputc('}', out);
}

static void put_commons(FILE *out, const struct question *q) {
    const char *comma = "";
    fputs(",\"common\":[", out);
    for (int cause = 0; cause < q->f->n_causes; cause++) {
        bool touches = false;
        for (int i = 0; i < q->n && !touches; i++)
            touches = part_of(q, i, cause) >= 0;
        if (!touches)
            continue;
        fputs(comma, out);
        put_cause(out, q, cause);
        comma = ",";
    }
    fputc(']', out);
}

static void put_list(FILE *out, const struct question *q, int bracket, const char *name, int which) {
    const char *comma = "";
    fprintf(out, "\"%s\":[", name);
    for (int i = 0; i < q->n; i++) {
        const struct fit_point *p = &q->f->point[q->use[i]];
        if (p->bracket != bracket)
            continue;
        fprintf(out, "%s%.17g", comma, which == 0 ? (double)i : which == 1 ? p->tau_us : p->tau_r_us);
        comma = ",";
    }
    fputs("],", out);
}

static bool has_points(const struct question *q, int bracket) {
    for (int i = 0; i < q->n; i++)
        if (q->f->point[q->use[i]].bracket == bracket)
            return true;
    return false;
}

/* One that has points; *glue goes before it. */
static void put_bracket(FILE *out, const struct question *q, const struct fit_bracket *b, const char **glue) {
    if (!has_points(q, b->number))
        return;
    fprintf(out, "%s{", *glue);
    put_list(out, q, b->number, "bracket_points", 0);
    put_list(out, q, b->number, "tau_us", 1);
    put_list(out, q, b->number, "tau_r_us", 2);
    fprintf(out, "\"T_us\":%.17g,\"rate\":%.17g}", b->length_us, b->rate);
    *glue = ",";
}

static void put_drift(FILE *out, const struct question *q) {
    const char *glue = "";
    struct bracket open;
    fputs(",\"drift\":[", out);
    for (int b = 0; b < q->f->n_brackets; b++)
        put_bracket(out, q, &q->f->bracket[b], &glue);
    if (reducer_open_bracket(q->reducer, &open))
        put_bracket(out, q, &(struct fit_bracket){open.number, 0, open.mean_rate}, &glue);
    fputc(']', out);
}

static char *question_text(struct campaign *c, const struct question *q) {
    char *text = NULL;
    size_t size = 0;
    json_t *setup = campaign_fit_setup(c);
    char *settings = json_dumps(setup, JSON_COMPACT);
    FILE *out = settings ? open_memstream(&text, &size) : NULL;
    json_decref(setup);
    if (out) {
        fprintf(out, "{\"id\":%d,\"final\":%s,", ++c->fit_number, q->final ? "true" : "false");
        put_points(out, q);
        put_commons(out, q);
        put_drift(out, q);
        fprintf(out, ",%s", settings + 1); /* the members of the settings, and the closing brace */
        fclose(out);
    }
    free(settings);
    return text;
}

/* ---- asking and being answered ---- */

static int remember_points(struct fit_points *f, const struct question *q) {
    struct point_slope *asked = realloc(f->asked, (size_t)(q->n + 1) * sizeof *asked);
    if (!asked)
        return -ERR_NOMEM;
    for (int i = 0; i < q->n; i++)
        asked[i] = (struct point_slope){.point_id = f->point[q->use[i]].id};
    f->asked = asked;
    f->n_asked = q->n;
    return 0;
}

/* The angular part of each point belongs to the estimate that it was derived from. */
static void store_slopes(struct campaign *c, struct measured *m, const json_t *slopes) {
    const json_t *source = json_object_get(slopes, "source"), *sample = json_object_get(slopes, "sample");
    struct fit_points *f = m->points;
    if (!slopes || (int)json_array_size(source) != f->n_asked || (int)json_array_size(sample) != f->n_asked)
        return;
    for (int i = 0; i < f->n_asked; i++) {
        f->asked[i].source_per_deg = json_number_value(json_array_get(source, i));
        f->asked[i].sample_per_deg = json_number_value(json_array_get(sample, i));
    }
    writer_slopes(c->writer, m->file, f->asked, f->n_asked);
}

static void store_joint(struct campaign *c, const struct measured *m, const json_t *reply) {
    struct joint joint;
    struct err wrong = {0};
    if (!reply)
        return;
    if (joint_from_json(reply, &joint, &wrong) < 0) {
        campaign_warn(c, "no joint fit of %s: %s", m->name, wrong.text);
        return;
    }
    writer_joint(c->writer, m->file, &joint);
    joint_free(&joint);
}

static void store_models(struct campaign *c, const struct measured *m, const json_t *models) {
    char *text = models ? json_dumps(models, JSON_COMPACT | JSON_REAL_PRECISION(17)) : NULL;
    if (text)
        writer_models(c->writer, m->file, text);
    free(text);
}

static void answered(void *arg, const json_t *reply, const struct err *e) {
    struct campaign *c = arg;
    struct measured *m = &c->measured[c->fit_sample];
    struct err wrong = {0};
    const char *error = json_string_value(json_object_get(reply, "error"));
    m->fit_failed = true;
    if (e || error) {
        campaign_warn(c, "no estimate of %s: %s", m->name, error ? error : e->text);
    } else if (estimate_from_json(json_object_get(reply, "estimate"), &m->estimate, &wrong) < 0) {
        campaign_warn(c, "no estimate of %s: %s", m->name, wrong.text);
    } else {
        m->fit_failed = false;
        m->has_estimate = true;
        writer_estimate(c->writer, m->file, campaign_now_us(c), c->fit_last_point, &m->estimate);
        store_slopes(c, m, json_object_get(reply, "axis_slopes"));
        store_joint(c, m, json_object_get(reply, "joint"));
        store_models(c, m, json_object_get(reply, "models"));
        campaign_event(
            c, "estimate", true,
            json_pack("{s:s, s:o}", "session", m->name, "estimate", estimate_to_json(&m->estimate)));
    }
    if (!c->fit_final)
        campaign_fit_next(c);
}

static int ask(struct campaign *c, int sample, bool final, struct err *e) {
    struct measured *m = &c->measured[sample];
    struct question q = {.f = m->points, .reducer = m->reducer, .final = final};
    char *text = choose(&q) == 0 && remember_points(m->points, &q) == 0 ? question_text(c, &q) : NULL;
    free(q.use);
    if (!text)
        return err_set(e, ERR_NOMEM, "no memory for a question to the estimator");
    m->fit_wanted = false;
    m->points->n_fitted = q.n;
    c->fit_sample = sample;
    c->fit_final = final;
    c->fit_last_point = m->last_point;
    return estimator_ask(c->estimator, text, final ? 0 : VIRTUAL_FIT_US, answered, c, e);
}

/* In real time every new point asks for a new estimate; only the newest state is ever fitted. */
void campaign_fit_point(struct campaign *c, struct measured *m) {
    if (!c->clock->is_virtual || m->points->n >= VIRTUAL_GROWTH * m->points->n_fitted)
        m->fit_wanted = true;
}

void campaign_fit_next(struct campaign *c) {
    for (int i = 1; !c->setup.without_estimates && i <= JOB_SAMPLES && estimator_idle(c->estimator); i++) {
        int sample = (c->fit_sample + i) % JOB_SAMPLES;
        struct err e = {0};
        if (!c->measured[sample].used || !c->measured[sample].fit_wanted)
            continue;
        if (ask(c, sample, false, &e) < 0 && !c->fit_warned) {
            c->fit_warned = true;
            campaign_warn(c, "no estimates while measuring: %s", e.text);
        }
    }
}

static int await_answer(struct campaign *c, struct err *e) {
    int result = bench_wait(c->bench, CLOCK_NEVER, estimator_idle, c->estimator, &c->cancel);
    return result < 0 ? err_set(e, -result, "stopped while waiting for the final estimate") : 0;
}

static int final_of(struct campaign *c, int sample, struct err *e) {
    struct measured *m = &c->measured[sample];
    struct err failed = {0};
    for (int i = 0; i <= ESTIMATOR_RESTARTS; i++) {
        if (ask(c, sample, true, &failed) < 0)
            break;
        int result = await_answer(c, e);
        if (result < 0 || !m->fit_failed)
            return result;
    }
    if (failed.code)
        campaign_warn(c, "no final estimate of %s: %s", m->name, failed.text);
    return 0;
}

/* A campaign is worth its points: an estimator that fails is said, and does not make it fail. */
int campaign_fit_final(struct campaign *c, struct err *e) {
    int result = campaign_store_drain(c, &c->cancel, e);
    if (result == 0)
        c->fit_final = true; /* no online question follows the one that may be open */
    if (result == 0)
        result = await_answer(c, e);
    for (int i = 0; i < c->job->n_samples && result == 0; i++)
        if (c->measured[i].used && !c->setup.without_estimates)
            result = final_of(c, i, e);
    return result == 0 ? campaign_store_drain(c, &c->cancel, e) : result;
}
