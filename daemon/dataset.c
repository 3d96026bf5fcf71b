#include "daemon/dataset.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/session_text.h"
#include "fit/aperture.h"
#include "proto/units.h"

struct exposure_time {
    int64_t start_us, end_us;
    int scans;
};

struct loading {
    struct dataset *d;
    int point_capacity, fit_capacity;
    struct exposure_time *exposure;
    int n_exposures, exposure_capacity;
    struct err *e;
};

/* Room for one more of `size` bytes, doubling; NULL leaves the old block as it was. */
static void *grown(void *block, int n, int *capacity, size_t size) {
    if (n < *capacity)
        return block;
    int more = *capacity ? 2 * *capacity : 64;
    void *larger = realloc(block, (size_t)more * size);
    if (larger)
        *capacity = more;
    return larger;
}

static int no_memory(struct loading *l) {
    return err_set(l->e, ERR_NOMEM, "no memory for the session %s", l->d->name);
}

static int take_point(void *arg, const struct point *p) {
    struct loading *l = arg;
    struct point *grew = grown(l->d->point, l->d->n, &l->point_capacity, sizeof *p);
    if (!grew)
        return no_memory(l);
    l->d->point = grew;
    l->d->point[l->d->n++] = *p;
    return 0;
}

static int take_exposure(void *arg, const struct exposure *x) {
    struct loading *l = arg;
    struct exposure_time *grew = grown(l->exposure, l->n_exposures, &l->exposure_capacity, sizeof *grew);
    if (!grew)
        return no_memory(l);
    bool *mirrored = realloc(l->d->mirrored, (size_t)l->exposure_capacity * sizeof *mirrored);
    l->exposure = grew;
    if (!mirrored)
        return no_memory(l);
    l->d->mirrored = mirrored;
    l->d->mirrored[l->d->n_exposures++] = x->mirrored;
    l->exposure[l->n_exposures++] = (struct exposure_time){x->start_us, x->end_us, x->n_scans};
    return 0;
}

double dataset_u(const struct estimate *m, int k) {
    return sqrt(m->statistical[k][k] + m->common[k][k]);
}

static int take_fit(void *arg, int64_t us, int64_t last_point_id, const struct estimate *m) {
    struct loading *l = arg;
    (void)last_point_id;
    if (!m->converged)
        return 0;
    struct dataset_fit *grew = grown(l->d->fit, l->d->n_fits, &l->fit_capacity, sizeof *grew);
    if (!grew)
        return no_memory(l);
    l->d->fit = grew;
    struct dataset_fit *f = &grew[l->d->n_fits++];
    *f = (struct dataset_fit){.provisional = m->provisional};
    for (int i = 0; i < l->n_exposures && l->exposure[i].end_us <= us; i++)
        f->exposures += l->exposure[i].scans;
    f->elapsed_s = l->n_exposures ? (double)(us - l->exposure[0].start_us) / US_PER_S : 0;
    for (int k = 0; k < MATERIAL_PARAMETERS; k++) {
        f->value[k] = m->value[k];
        f->u[k] = dataset_u(m, k);
    }
    l->d->estimate = *m;
    l->d->has_estimate = true;
    return 0;
}

static void copy_text(char *to, size_t size, const json_t *object, const char *key) {
    const char *text = json_string_value(json_object_get(object, key));
    snprintf(to, size, "%s", text ? text : "");
}

static void read_sample(struct dataset *d, const json_t *sample) {
    const json_t *water = json_object_get(sample, "water_percent");
    copy_text(d->sample, sizeof d->sample, sample, "name");
    copy_text(d->paint, sizeof d->paint, sample, "paint");
    copy_text(d->support, sizeof d->support, sample, "support");
    copy_text(d->series, sizeof d->series, sample, "series");
    d->has_water = json_is_number(water);
    d->water_percent = json_number_value(water);
}

static void read_truth(struct dataset *d, const json_t *truth) {
    d->has_truth = truth != NULL;
    for (int k = 0; truth && k < DATASET_PARAMETERS; k++) {
        const json_t *value = json_object_get(truth, material_parameter_name("composite", k));
        d->truth[k] = json_number_value(value);
        d->has_truth = d->has_truth && json_is_number(value);
    }
    d->truth_q = json_number_value(json_object_get(truth, "q"));
}

static int read_texts(struct dataset *d, struct session *s, struct err *e) {
    json_t *sample = NULL, *truth = NULL;
    int rc = session_text_json(s, "sample", &sample, e);
    if (rc == 0)
        rc = session_text_json(s, "truth", &truth, e);
    if (rc == 0) {
        read_sample(d, sample);
        read_truth(d, truth);
    }
    json_decref(sample);
    json_decref(truth);
    return rc;
}

static int by_incidence(const void *a, const void *b) {
    const struct point *p = a, *q = b;
    return (p->theta_i_udeg > q->theta_i_udeg) - (p->theta_i_udeg < q->theta_i_udeg);
}

static int by_view(const void *a, const void *b) {
    const struct point *p = a, *q = b;
    return (p->theta_v_udeg > q->theta_v_udeg) - (p->theta_v_udeg < q->theta_v_udeg);
}

static int read_rows(struct loading *l, struct session *s) {
    int rc = session_each_point(s, false, take_point, l, l->e);
    if (rc == 0)
        rc = session_each_exposure(s, take_exposure, l, l->e);
    if (rc == 0)
        rc = session_each_estimate(s, take_fit, l, l->e);
    if (rc == 0 && l->d->n == 0)
        rc = err_set(l->e, ERR_STATE, "the session %s holds no point yet", l->d->name);
    return rc;
}

static void sort_points(struct dataset *d) {
    struct dataset_sweep sweep[DATASET_SWEEPS];
    qsort(d->point, (size_t)d->n, sizeof *d->point, by_incidence);
    int n = dataset_sweeps(d, sweep, DATASET_SWEEPS);
    for (int i = 0; i < n; i++)
        qsort(d->point + sweep[i].first, (size_t)sweep[i].n, sizeof *d->point, by_view);
}

int dataset_load(struct dataset *d, const char *path, struct err *e) {
    struct session *s;
    struct loading l = {.d = d, .e = e};
    const char *slash = strrchr(path, '/');
    memset(d, 0, sizeof *d);
    snprintf(d->name, sizeof d->name, "%s", slash ? slash + 1 : path);
    int rc = session_open(&s, path, true, e);
    if (rc != 0)
        return rc;
    rc = read_texts(d, s, e);
    if (rc == 0)
        rc = read_rows(&l, s);
    session_close(s, NULL);
    free(l.exposure);
    if (rc != 0)
        dataset_free(d);
    else
        sort_points(d);
    return rc;
}

void dataset_free(struct dataset *d) {
    free(d->point);
    free(d->fit);
    free(d->mirrored);
    memset(d, 0, sizeof *d);
}

bool dataset_mirrored(const struct dataset *d, const struct point *p) {
    return p->exposure_id > 0 && p->exposure_id <= d->n_exposures && d->mirrored[p->exposure_id - 1];
}

double dataset_u_total(const struct point *p) {
    return hypot(p->mean_u_ind, session_common_mean(p));
}

double dataset_u_band(const struct point *p, int band) {
    return hypot(p->u_ind[band], session_common_band(p, band));
}

#define SWEEP_WIDTH_UDEG (UDEG_PER_DEG / 4)

int dataset_sweeps(const struct dataset *d, struct dataset_sweep *sweep, int max) {
    int n = 0;
    for (int i = 0; i < d->n; i++) {
        bool near = i > 0 && d->point[i].theta_i_udeg - d->point[i - 1].theta_i_udeg < SWEEP_WIDTH_UDEG;
        if (!near && n == max)
            break;
        if (!near)
            sweep[n++] = (struct dataset_sweep){.first = i};
        struct dataset_sweep *s = &sweep[n - 1];
        s->n++;
        s->theta_i_deg += (deg_from_udeg(d->point[i].theta_i_udeg) - s->theta_i_deg) / s->n;
    }
    return n;
}

struct dataset_sweep dataset_sweep_nearest(const struct dataset *d, double theta_i_deg) {
    struct dataset_sweep sweep[DATASET_SWEEPS];
    int n = dataset_sweeps(d, sweep, DATASET_SWEEPS), best = 0;
    for (int i = 1; i < n; i++)
        if (fabs(sweep[i].theta_i_deg - theta_i_deg) < fabs(sweep[best].theta_i_deg - theta_i_deg))
            best = i;
    return sweep[best];
}

struct look { /* what a surface is looked at through */
    struct aperture_form form;
    double polarisation;
};

static const struct look at_itself = {0};

/* Value and gradient by parameter (not by column); parameters the model lacks get 0. */
static int evaluate(const struct estimate *m, const struct look *look, double theta_i_deg, double theta_v_deg,
                    double *beta, double *gradient, struct err *e) {
    enum reflectance_model model;
    double column[MATERIAL_PARAMETERS];
    const struct reflectance_optics optics = {m->kappa, m->q, look->polarisation};
    int rc = reflectance_find(m->model, &model, e);
    if (rc == 0)
        rc = aperture_at(&look->form, theta_i_deg, theta_v_deg, model, m->value, &optics, beta, column, e);
    for (int k = 0; k < MATERIAL_PARAMETERS; k++)
        gradient[k] = 0;
    for (int c = 0; rc == 0 && c < reflectance_parameters(model); c++)
        gradient[reflectance_parameter(model, c)] = column[c];
    return rc;
}

static double spread(const struct estimate *m, const double *gradient) {
    double u2 = 0;
    for (int j = 0; j < MATERIAL_PARAMETERS; j++)
        for (int k = 0; k < MATERIAL_PARAMETERS; k++)
            u2 += gradient[j] * (m->statistical[j][k] + m->common[j][k]) * gradient[k];
    return u2 > 0 ? sqrt(u2) : 0;
}

static int evaluate_with_u(const struct estimate *m, const struct look *look, double theta_i_deg,
                           double theta_v_deg, double *beta, double *u, struct err *e) {
    double gradient[MATERIAL_PARAMETERS];
    int rc = evaluate(m, look, theta_i_deg, theta_v_deg, beta, gradient, e);
    if (rc == 0)
        *u = spread(m, gradient);
    return rc;
}

int dataset_model(const struct estimate *m, double theta_i_deg, double theta_v_deg, double *beta, double *u,
                  struct err *e) {
    return evaluate_with_u(m, &at_itself, theta_i_deg, theta_v_deg, beta, u, e);
}

int dataset_model_seen(const struct estimate *m, double theta_i_deg, double theta_v_deg, bool mirrored,
                       double *beta, double *u, struct err *e) {
    const struct look look = {{m->source_width_deg, m->sensor_width_deg, m->beam_in_view}, m->polarisation};
    const double sign = mirrored ? -1 : 1;
    return evaluate_with_u(m, &look, theta_i_deg + sign * (m->zero_source_deg - m->zero_sample_deg),
                           theta_v_deg + sign * m->zero_sample_deg, beta, u, e);
}

int dataset_model_ratio(const struct estimate *m, double theta_i_deg, double theta_v_deg,
                        double over_theta_v_deg, double *ratio, double *u, struct err *e) {
    double a, b, ga[MATERIAL_PARAMETERS], gb[MATERIAL_PARAMETERS];
    int rc = evaluate(m, &at_itself, theta_i_deg, theta_v_deg, &a, ga, e);
    if (rc == 0)
        rc = evaluate(m, &at_itself, theta_i_deg, over_theta_v_deg, &b, gb, e);
    if (rc == 0 && b == 0)
        rc = err_set(e, ERR_RANGE, "the model is 0 at theta_v = %g deg, so a ratio to it has no value",
                     over_theta_v_deg);
    if (rc != 0)
        return rc;
    *ratio = a / b;
    for (int k = 0; k < MATERIAL_PARAMETERS; k++)
        ga[k] = (ga[k] - *ratio * gb[k]) / b;
    *u = spread(m, ga);
    return 0;
}
