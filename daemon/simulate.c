#include "daemon/simulate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "proto/file.h"
#include "proto/session.h"
#include "proto/units.h"
#include "proto/yaml.h"
#include "sim/goniosim_config.h"
#include "sim/sim.h"

struct visit { /* a state of the bench and how often a resumed session has been in it */
    char position[32];
    int32_t source_udeg, sample_udeg;
    int exposure_us, count;
    bool lamp;
};

struct instead { /* what stands for a sample instead of its paint */
    char sample[48];
    struct simulate_surface surface;
    const struct measured *measured; /* NULL: the modelled surface */
};

struct simulate_bench {
    struct goniosim_config file;
    char *text;
};

struct simulate {
    struct sim_bench *bench;
    const struct simulate_bench *file; /* may be NULL */
    const struct config *config;
    char position[JOB_SAMPLES][32]; /* where something is mounted, and what */
    char mounted[JOB_SAMPLES][48];
    int n_positions;
    struct instead instead[JOB_SAMPLES];
    int n_instead;
    struct visit *visit;
    int n_visits;
};

/* ---- the bench file ---- */

int simulate_bench_read(struct simulate_bench **bench, const char *path, struct err_list *errors) {
    struct simulate_bench *b = calloc(1, sizeof *b);
    struct err e = {0};
    size_t size = 0;
    int result = b ? file_read(path, YAML_BYTES_MAX, &b->text, &size, &e)
                   : err_set(&e, ERR_NOMEM, "no memory for a bench");
    if (result < 0)
        err_list_add(errors, &e);
    else
        result = goniosim_config_read_text(path, b->text, size, &b->file, errors);
    if (result < 0) {
        simulate_bench_free(b);
        return result;
    }
    *bench = b;
    return 0;
}

void simulate_bench_free(struct simulate_bench *b) {
    if (!b)
        return;
    goniosim_config_free(&b->file);
    free(b->text);
    free(b);
}

const char *simulate_bench_text(const struct simulate_bench *b) {
    return b ? b->text : NULL;
}

uint64_t simulate_bench_seed(const struct simulate_bench *b) {
    return b->file.bench.seed;
}

/* What the file says of the surface at a place; NULL: nothing. */
static const struct sim_surface *surface_at(const struct simulate_bench *b, const char *position) {
    for (int i = 0; b && i < b->file.n_places; i++)
        if (b->file.place[i].has_surface && !strcmp(b->file.place[i].name, position))
            return &b->file.place[i].surface;
    return NULL;
}

/* ---- the bench of a config ---- */

/* The uncertainties are true where a bench file says so, else what the config states. */
static void set_axis(struct sim_axis_config *to, const struct config_axis *from, bool from_file) {
    to->unit = from->unit;
    to->direction = from->direction;
    to->zero_deg = from->zero_deg;
    if (from->u_zero_deg > 0 && !from_file)
        to->u_zero_deg = from->u_zero_deg;
    if (from->u_repeat_deg > 0 && !from_file)
        to->u_repeat_deg = from->u_repeat_deg;
}

static const struct sim_axis_config *find_axis(const struct sim_config *s, const char *role) {
    for (int k = 0; k < s->n_axes; k++)
        if (!strcmp(s->axis[k].role, role))
            return &s->axis[k];
    return NULL;
}

static void set_axes(struct sim_config *s, const struct config *config, bool from_file) {
    struct sim_config known = *s, built_in;
    sim_config_default(&built_in);
    s->n_axes = 0;
    for (int a = 0; a < STAGE_AXES; a++) {
        const struct config_axis *from = instruments_axis(config, a);
        const struct sim_axis_config *axis = find_axis(&known, stage_axis_name(a));
        if (from->kind != CONFIG_AXIS_MOTOR)
            continue;
        s->axis[s->n_axes] = axis ? *axis : *find_axis(&built_in, stage_axis_name(a));
        set_axis(&s->axis[s->n_axes++], from, axis && from_file);
    }
}

static void set_positions(struct sim_config *s, const struct config_axis *holder) {
    if (holder->n_positions == 0)
        return;
    s->n_positions = holder->n_positions;
    for (int i = 0; i < holder->n_positions; i++) {
        snprintf(s->position[i].name, sizeof s->position[i].name, "%s", holder->position[i].name);
        s->position[i].deg = holder->position[i].deg;
    }
}

static void take_as_stated(struct sim_config *s) {
    s->certificate_u_rel = s->u_polarisation = 0;
    for (int i = 0; i < s->n_axes; i++)
        s->axis[i].u_zero_deg = 0;
}

int simulate_new(struct simulate **simulate, const struct simulate_options *options,
                 const struct config *config, struct clock *clock, struct err *e) {
    struct sim_config s;
    sim_config_default(&s);
    if (options->file)
        s = options->file->file.bench;
    s.seed = options->seed;
    s.quiet |= options->quiet;
    s.bend += options->bend;
    if (options->no_drift)
        s.lamp_drift_rate = 0;
    snprintf(s.spectrometer, sizeof s.spectrometer, "%s", config->spectrometer.model);
    s.filling = config->optics.filling == FILLING_BEAM_IN_VIEW ? SIM_BEAM_IN_VIEW : SIM_VIEW_IN_BEAM;
    s.beam_mm = config->optics.beam_mm;
    s.view_mm = config->optics.view_mm;
    s.source_width_deg = config->optics.source_width_deg;
    s.sensor_width_deg = config->optics.sensor_width_deg;
    if (!options->file) {
        s.polarisation = config->optics.polarisation_p;
        s.u_polarisation = config->optics.u_polarisation;
    }
    s.lamp_warm_up_min = config->lamp_warm_up_min;
    s.shutter_by_hand = config->shutter != SHUTTER_LAMP_LINE;
    set_axes(&s, config, options->file != NULL);
    set_positions(&s, &config->holder);
    if (options->nominal)
        take_as_stated(&s);
    struct simulate *new = calloc(1, sizeof *new);
    if (!new)
        return err_set(e, ERR_NOMEM, "no memory for the simulated bench");
    new->config = config;
    new->file = options->file;
    int result = sim_bench_new(&new->bench, &s, clock, e);
    if (result < 0) {
        free(new);
        return result;
    }
    if (config->shutter == SHUTTER_NONE)
        sim_bench_shutter(new->bench, true);
    *simulate = new;
    return 0;
}

void simulate_free(struct simulate *s) {
    if (!s)
        return;
    sim_bench_free(s->bench);
    free(s->visit);
    free(s);
}

/* ---- its links ---- */

static int open_modbus(void *self, const struct modbus_link_config *link, struct modbus_link *out,
                       struct err *e) {
    struct simulate *s = self;
    if (strncmp(link->target, "sim:", 4) != 0)
        return err_set(e, ERR_INPUT,
                       "link %s is not simulated: with --simulate every axis has link sim:modbus",
                       link->target);
    return sim_modbus_link(s->bench, out, e);
}

static int open_usb(void *self, const char *target, const struct spectrometer_model *model,
                    const char *serial, struct usb_link *out, struct err *e) {
    struct simulate *s = self;
    (void)model;
    (void)serial;
    if (strncmp(target, "sim:", 4) != 0)
        return err_set(e, ERR_INPUT,
                       "link %s is not simulated: with --simulate the spectrometer has link sim:usb", target);
    return sim_usb_link(s->bench, out, e);
}

/* ---- what a person does ---- */

static char *mounted_at(struct simulate *s, const char *position) {
    for (int i = 0; i < s->n_positions; i++)
        if (!strcmp(s->position[i], position))
            return s->mounted[i];
    if (s->n_positions == JOB_SAMPLES)
        return NULL;
    snprintf(s->position[s->n_positions], sizeof s->position[0], "%s", position);
    return s->mounted[s->n_positions++];
}

static struct instead *new_instead(struct simulate *s, const char *sample, struct err *e) {
    if (s->n_instead == JOB_SAMPLES) {
        err_set(e, ERR_RANGE, "the simulated bench takes at most %d samples", JOB_SAMPLES);
        return NULL;
    }
    struct instead *new = &s->instead[s->n_instead++];
    *new = (struct instead){0};
    snprintf(new->sample, sizeof new->sample, "%s", sample);
    return new;
}

int simulate_mount_instead(struct simulate *s, const char *sample, const struct simulate_surface *surface,
                           struct err *e) {
    struct instead *new = new_instead(s, sample, e);
    if (!new)
        return -ERR_RANGE;
    new->surface = *surface;
    return 0;
}

int simulate_mount_measured(struct simulate *s, const char *sample, const struct measured *surface,
                            struct err *e) {
    struct instead *new = new_instead(s, sample, e);
    if (!new)
        return -ERR_RANGE;
    new->measured = surface;
    return 0;
}

static const struct instead *instead_of(const struct simulate *s, const char *sample) {
    for (int i = s->n_instead - 1; i >= 0; i--)
        if (!strcmp(s->instead[i].sample, sample))
            return &s->instead[i];
    return NULL;
}

static int surface_of(const struct simulate *s, const struct job_sample *sample, struct sim_surface *surface,
                      struct err *e) {
    const struct instead *instead = instead_of(s, sample->name);
    int water = sample->has_water ? (int)lround(sample->water_percent) : 0;
    const struct sim_surface *there = surface_at(s->file, sample->holder);
    if (!instead && there) {
        *surface = *there;
        return 0;
    }
    if (!instead)
        return sim_paint_find(sample->paint, sample->support, water, surface, e);
    if (instead->measured) {
        *surface = (struct sim_surface){.measured = instead->measured};
        return 0;
    }
    const struct simulate_surface *known = &instead->surface;
    *surface = (struct sim_surface){
        .sigma = known->sigma, .gamma = known->gamma, .beta_prime = known->beta_prime, .n = known->n};
    memcpy(surface->s_lambda, known->s_lambda, sizeof surface->s_lambda);
    return 0;
}

static json_t *truth(void *self, const struct job_sample *sample, const int mean_nm[2]) {
    struct sim_surface from;
    if (surface_of(self, sample, &from, NULL) < 0 || from.measured)
        return NULL;
    struct simulate_surface to = {
        .sigma = from.sigma, .gamma = from.gamma, .beta_prime = from.beta_prime, .n = from.n};
    memcpy(to.s_lambda, from.s_lambda, sizeof to.s_lambda);
    return simulate_surface_to_json(&to, mean_nm);
}

static int known(void *self, const struct job_sample *sample, struct err *e) {
    struct sim_surface surface;
    return surface_of(self, sample, &surface, e);
}

static int mount(void *self, const struct job_sample *sample, struct err *e) {
    struct simulate *s = self;
    struct sim_surface surface;
    char *there = mounted_at(s, sample->holder);
    if (there && !strcmp(there, sample->name))
        return 0;
    int result = surface_of(s, sample, &surface, e);
    if (result == 0)
        result = sim_bench_mount(s->bench, sample->holder, &surface, e);
    if (result == 0 && there)
        snprintf(there, sizeof s->mounted[0], "%s", sample->name);
    return result;
}

static int in_beam(void *self, const char *position, struct err *e) {
    struct simulate *s = self;
    return sim_bench_hold(s->bench, position, e);
}

static int turned(void *self, const char *axis, double deg, struct err *e) {
    struct simulate *s = self;
    return sim_bench_turn(s->bench, axis, deg, e);
}

static void shutter(void *self, bool open) {
    sim_bench_shutter(((struct simulate *)self)->bench, open);
}

/* ---- a session that goes on ---- */

static struct visit *visit_of(struct simulate *s, const struct visit *state) {
    for (int i = 0; i < s->n_visits; i++) {
        struct visit *v = &s->visit[i];
        if (v->source_udeg == state->source_udeg && v->sample_udeg == state->sample_udeg &&
            v->exposure_us == state->exposure_us && v->lamp == state->lamp &&
            !strcmp(v->position, state->position))
            return v;
    }
    struct visit *larger = realloc(s->visit, (s->n_visits + 1) * sizeof *larger);
    if (!larger)
        return NULL;
    s->visit = larger;
    s->visit[s->n_visits] = *state;
    return &s->visit[s->n_visits++];
}

static const char *position_at(const struct simulate *s, int32_t holder_udeg,
                               const struct job_sample *sample) {
    const struct config_axis *holder = &s->config->holder;
    for (int i = 0; i < holder->n_positions; i++)
        if (abs(holder_udeg - udeg_from_deg(holder->position[i].deg)) < UDEG_PER_DEG)
            return holder->position[i].name;
    return sample->holder;
}

static void seen_before(void *self, const struct job_sample *sample, const struct exposure *x) {
    struct simulate *s = self;
    struct visit state = {.source_udeg = x->source_udeg,
                          .sample_udeg = x->sample_udeg,
                          .exposure_us = x->exposure_us,
                          .lamp = x->lamp};
    snprintf(state.position, sizeof state.position, "%s", position_at(s, x->holder_udeg, sample));
    struct visit *v = visit_of(s, &state);
    if (v)
        sim_bench_set_visits(s->bench, v->position, v->source_udeg, v->sample_udeg, v->exposure_us, v->lamp,
                             ++v->count);
}

void simulate_wiring(struct simulate *s, struct wiring *wiring) {
    *wiring = (struct wiring){.self = s,
                              .simulated = true,
                              .modbus = open_modbus,
                              .usb = open_usb,
                              .known = known,
                              .mount = mount,
                              .in_beam = in_beam,
                              .turned = turned,
                              .shutter = shutter,
                              .truth = truth,
                              .seen_before = seen_before};
}
