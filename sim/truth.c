#include "sim/truth.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "proto/units.h"
#include "sim/diffuser.h"
#include "sim/draw.h"
#include "sim/measured.h"

/* One moment of the bench. */
struct moment {
    const struct truth_mount *mount; /* NULL: nothing in the beam */
    double theta_i_deg, theta_v_deg, level;
    bool lit;
};

const char *const truth_roles[TRUTH_ROLES] = {"source", "sample", "holder"};

static double draw(const struct sim_config *c, const char *what, const char *which) {
    return c->quiet ? 0 : draw_normal(draw_fold(draw_fold(c->seed, draw_word(what)), draw_word(which)));
}

static void init_axes(struct truth *t, const struct sim_config *c) {
    for (int r = 0; r < TRUTH_ROLES; r++)
        t->axis[r].direction = 1;
    for (int i = 0; i < c->n_axes; i++)
        for (int r = 0; r < TRUTH_ROLES; r++) {
            const struct sim_axis_config *a = &c->axis[i];
            if (strcmp(a->role, truth_roles[r]) != 0)
                continue;
            t->axis[r].direction = a->direction < 0 ? -1 : 1;
            t->axis[r].stated_zero_deg = a->zero_deg;
            t->axis[r].zero_deg = a->zero_deg + a->u_zero_deg * draw(c, "zero", a->role);
        }
}

static void init_mounts(struct truth *t, const struct sim_config *c) {
    t->n_mounts = c->n_positions;
    for (int i = 0; i < c->n_positions; i++) {
        t->mount[i].position = c->position[i];
        if (strcmp(c->position[i].name, "reference") == 0)
            t->mount[i].kind = TRUTH_DIFFUSER;
    }
}

static void init_white(struct truth *t) {
    const struct detector *d = &t->detector;
    double peak = 0;
    for (int p = 0; p < d->model->pixels; p++) {
        t->band_at[p] = (d->lambda_nm[p] - BAND_FIRST_NM) / BAND_STEP_NM;
        t->white[p] = d->response[p] * lamp_spectrum(d->lambda_nm[p]);
        peak = fmax(peak, t->white[p]);
    }
    for (int p = 0; p < d->model->pixels; p++)
        t->white[p] *= 65535 / TRUTH_FULL_SCALE_US / peak;
}

int truth_init(struct truth *t, const struct sim_config *c, const struct detector_model *model,
               struct err *e) {
    memset(t, 0, sizeof *t);
    t->visits_capacity = 1024;
    t->visit = calloc(t->visits_capacity, sizeof *t->visit);
    if (!t->visit)
        return err_set(e, ERR_NOMEM, "no memory for the simulated bench");
    t->key = c->seed;
    t->quiet = c->quiet;
    t->optics = (struct optics){c->beam_mm, c->view_mm};
    t->stray_light = c->stray_light;
    t->halo = c->halo;
    t->polarisation = c->polarisation + c->u_polarisation * draw(c, "polarisation", "optics");
    spread_fill(&t->source, c->source_width_deg);
    spread_fill(&t->sensor, c->sensor_width_deg);
    t->diffuser_factor = 1 + c->certificate_u_rel * draw(c, "certificate", "diffuser");
    lamp_init(&t->lamp, draw_fold(c->seed, draw_word("lamp")), c->quiet ? 0 : c->lamp_drift_rate,
              c->quiet ? 0 : c->lamp_warm_up_min);
    detector_init(&t->detector, model, draw_fold(c->seed, draw_word("detector")), c->quiet);
    detector_bend(&t->detector, c->bend);
    init_axes(t, c);
    init_mounts(t, c);
    init_white(t);
    return 0;
}

void truth_free(struct truth *t) {
    free(t->visit);
    t->visit = NULL;
}

const struct truth_mount *truth_mount_find(const struct truth *t, const char *name) {
    for (int i = 0; i < t->n_mounts; i++)
        if (strcmp(t->mount[i].position.name, name) == 0)
            return &t->mount[i];
    return NULL;
}

double truth_axis_deg(const struct truth *t, enum truth_role role, int64_t at_us) {
    const struct truth_axis *a = &t->axis[role];
    if (!a->unit)
        return a->manual_deg;
    const struct plant *p = &a->unit->plant;
    double aligned_deg = a->direction < 0 ? p->lost_motion_deg : 0; /* where the gear stood, approached so */
    return a->direction * (plant_table_deg(p, at_us) - aligned_deg) - a->zero_deg;
}

int32_t truth_raw_steps(const struct truth *t, enum truth_role role, double user_deg) {
    const struct truth_axis *a = &t->axis[role];
    return (int32_t)lround(a->direction * (user_deg + a->stated_zero_deg) * PLANT_STEPS_PER_DEG);
}

static const struct truth_mount *in_beam(const struct truth *t, int64_t at_us) {
    if (!t->axis[TRUTH_HOLDER].unit)
        return t->n_mounts ? &t->mount[t->held] : NULL;
    double holder_deg = truth_axis_deg(t, TRUTH_HOLDER, at_us);
    for (int i = 0; i < t->n_mounts; i++)
        if (fabs(remainder(holder_deg - t->mount[i].position.deg, 360)) <= TRUTH_PLACE_DEG)
            return &t->mount[i];
    return NULL;
}

static void look(const struct truth *t, int64_t at_us, struct moment *m) {
    double source_deg = truth_axis_deg(t, TRUTH_SOURCE, at_us);
    m->theta_v_deg = truth_axis_deg(t, TRUTH_SAMPLE, at_us);
    m->theta_i_deg = source_deg - m->theta_v_deg;
    if (m->theta_i_deg < 0) {
        m->theta_i_deg = -m->theta_i_deg;
        m->theta_v_deg = -m->theta_v_deg;
    }
    m->mount = in_beam(t, at_us);
    m->lit = lamp_is_on(&t->lamp, at_us);
    m->level = m->lit ? lamp_level(&t->lamp, at_us) : 0;
}

/* Light of every band value through its spline, onto the pixels. */
static void add_bands(const struct truth *t, const double beta[BANDS], double scale, double *rate) {
    double spline[BANDS];
    surface_spline(beta, spline);
    for (int p = 0; p < t->detector.model->pixels; p++)
        rate[p] += scale * t->white[p] * surface_between(spline, t->band_at[p]);
}

/* One direction of the source and one of the sensor. */
static void add_direction(const struct truth *t, struct truth_sight *s, double share, double theta_i_deg,
                          double theta_v_deg) {
    double through = share * optics_throughput(&t->optics, theta_i_deg, theta_v_deg), beta[BANDS];
    s->through += through;
    if (through == 0 || s->mount->kind != TRUTH_SURFACE)
        return;
    if (s->mount->surface.measured) {
        double side = theta_i_deg < 0 ? -1 : 1;
        measured_at(s->mount->surface.measured, side * theta_i_deg, side * theta_v_deg, beta);
        for (int k = 0; k < BANDS; k++)
            s->beta[k] += through * beta[k];
        return;
    }
    struct surface_factors f;
    surface_factors(&s->mount->surface, t->polarisation, theta_i_deg, theta_v_deg, &f);
    s->factors.l1 += through * f.l1;
    s->factors.l2 += through * f.l2;
    s->factors.specular += through * f.specular;
}

static void sight(struct truth *t, const struct moment *m) {
    struct truth_sight *s = &t->sight;
    if (s->mount == m->mount && s->theta_i_deg == m->theta_i_deg && s->theta_v_deg == m->theta_v_deg)
        return;
    *s =
        (struct truth_sight){.mount = m->mount, .theta_i_deg = m->theta_i_deg, .theta_v_deg = m->theta_v_deg};
    for (int a = 0; a < t->source.n; a++)
        for (int b = 0; b < t->sensor.n; b++)
            add_direction(t, s, t->source.share[a] * t->sensor.share[b], m->theta_i_deg + t->source.by_deg[a],
                          m->theta_v_deg + t->sensor.by_deg[b]);
}

static void add_surface(const struct truth *t, double light, double *rate) {
    const struct surface_factors *f = &t->sight.factors;
    for (int p = 0; p < t->detector.model->pixels; p++) {
        double s = surface_between(t->sight.mount->spline, t->band_at[p]);
        rate[p] += light * t->white[p] * (s * f->l1 + s * s * f->l2 + f->specular);
    }
}

static void add_moment(struct truth *t, const struct moment *m, double weight, double *rate) {
    double beta[BANDS], light = weight * m->level;
    if (!m->lit)
        return;
    for (int p = 0; p < t->detector.model->pixels && t->halo > 0; p++)
        rate[p] += light * t->halo * t->white[p];
    if (!m->mount || m->mount->kind == TRUTH_NOTHING)
        return;
    sight(t, m);
    if (m->mount->kind == TRUTH_DIFFUSER) {
        diffuser_certified(m->theta_i_deg, m->theta_v_deg, beta);
        add_bands(t, beta, light * t->sight.through * t->diffuser_factor, rate);
    } else if (m->mount->surface.measured) {
        add_bands(t, t->sight.beta, light, rate);
    } else {
        add_surface(t, light, rate);
    }
}

/* Light scattered inside the spectrometer: evenly over the active pixels. */
static void add_stray(const struct truth *t, double *rate) {
    const struct detector_model *m = t->detector.model;
    double sum = 0;
    for (int p = m->active_first; p <= m->active_last; p++)
        sum += rate[p];
    double stray = t->stray_light * sum / (m->active_last - m->active_first + 1);
    for (int p = m->active_first; p <= m->active_last; p++)
        rate[p] += stray;
}

uint64_t truth_state(const struct truth *t, const int32_t steps[TRUTH_ROLES], bool lamp,
                     uint32_t exposure_us) {
    uint64_t state = draw_fold(t->key, draw_word("frame"));
    for (int r = 0; r < TRUTH_ROLES; r++)
        state = draw_fold(state, (uint32_t)steps[r]);
    return draw_fold(draw_fold(state, lamp), exposure_us) | 1;
}

static struct truth_visit *slot(struct truth_visit *table, size_t capacity, uint64_t state) {
    size_t i = (state >> 1) & (capacity - 1);
    while (table[i].state && table[i].state != state)
        i = (i + 1) & (capacity - 1);
    return &table[i];
}

static void grow(struct truth *t) {
    struct truth_visit *wider = calloc(2 * t->visits_capacity, sizeof *wider);
    if (!wider)
        return;
    for (size_t i = 0; i < t->visits_capacity; i++)
        if (t->visit[i].state)
            *slot(wider, 2 * t->visits_capacity, t->visit[i].state) = t->visit[i];
    free(t->visit);
    t->visit = wider;
    t->visits_capacity *= 2;
}

int truth_add_visits(struct truth *t, uint64_t state, int visits) {
    if (2 * t->visits >= t->visits_capacity)
        grow(t);
    if (t->visits + 1 >= t->visits_capacity)
        return 0;
    struct truth_visit *v = slot(t->visit, t->visits_capacity, state);
    t->visits += v->state == 0;
    v->state = state;
    v->count += visits;
    return v->count - visits;
}

static bool still(const struct truth *t, int64_t from_us, int64_t to_us) {
    for (int r = 0; r < TRUTH_ROLES; r++)
        if (t->axis[r].unit && !plant_steady(&t->axis[r].unit->plant, from_us, to_us))
            return false;
    return lamp_steady(&t->lamp, from_us, to_us);
}

static uint64_t still_key(struct truth *t, int64_t at_us, uint32_t exposure_us) {
    int32_t steps[TRUTH_ROLES];
    for (int r = 0; r < TRUTH_ROLES; r++) {
        const struct truth_axis *a = &t->axis[r];
        steps[r] = a->unit ? (int32_t)lround(plant_motor_steps(&a->unit->plant, at_us))
                           : truth_raw_steps(t, r, r == TRUTH_HOLDER ? t->held : a->manual_deg);
    }
    uint64_t state = truth_state(t, steps, lamp_is_on(&t->lamp, at_us), exposure_us);
    if (state != t->last_state) {
        t->last_state = state;
        t->last_visit = truth_add_visits(t, state, 1);
        t->nth = 0;
    }
    return draw_fold(draw_fold(state, (uint64_t)t->last_visit), (uint64_t)t->nth++);
}

void truth_frame(struct truth *t, int64_t from_us, int64_t to_us, uint32_t exposure_us, uint16_t *counts) {
    double rate[DETECTOR_PIXELS_MAX] = {0};
    int64_t middle_us = from_us + (to_us - from_us) / 2;
    uint64_t key =
        draw_fold(draw_fold(draw_fold(t->key, draw_word("blend")), (uint64_t)from_us), (uint64_t)to_us);
    int substeps = TRUTH_SUBSTEPS;
    if (still(t, from_us, to_us)) {
        key = still_key(t, middle_us, exposure_us);
        substeps = 1;
    }
    for (int i = 0; i < substeps; i++) {
        struct moment m;
        look(t, from_us + (int64_t)((to_us - from_us) * (i + 0.5) / substeps), &m);
        add_moment(t, &m, 1.0 / substeps, rate);
    }
    if (t->stray_light > 0)
        add_stray(t, rate);
    detector_expose(&t->detector, rate, exposure_us, middle_us, key, counts);
}
