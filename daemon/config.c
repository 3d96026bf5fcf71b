#include "daemon/config.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/config_keys.h"
#include "drivers/spectrometer.h"
#include "proto/file.h"
#include "proto/yaml.h"

/* What a check needs: the values, where they were written, and where to complain. */
struct check {
    const struct config *config;
    const struct yaml_places *places;
    struct err_list *errors;
};

static void complain(const struct check *c, const char *path, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

static void complain(const struct check *c, const char *path, const char *format, ...) {
    const struct yaml_place *place = yaml_place_near(c->places, path);
    va_list args;
    va_start(args, format);
    err_list_mistake(c->errors, c->config->file, place ? place->line : 0, place ? place->column : 0, format,
                     args);
    va_end(args);
}

static bool written(const struct check *c, const char *path) {
    return yaml_place_find(c->places, path) != NULL;
}

#define AXES 3

/* "axes.source", "axes.sample", "holder": as the file names them. */
static const struct config_axis *axis_at(const struct config *config, int which, const char **path) {
    static const char *const paths[AXES] = {"axes.source", "axes.sample", "holder"};
    const struct config_axis *const axes[AXES] = {&config->source, &config->sample, &config->holder};
    *path = paths[which];
    return axes[which];
}

static void check_link(const struct check *c, const char *path, const char *link) {
    char key[64];
    if (!*link)
        return; /* reported as missing */
    snprintf(key, sizeof key, "%s.link", path);
    bool tcp = strncmp(link, "tcp:", 4) == 0 && strrchr(link + 4, ':') && strrchr(link + 4, ':')[1] != '\0';
    bool rtu = strncmp(link, "rtu:", 4) == 0 && link[4] != '\0';
    if (!tcp && !rtu && strncmp(link, "sim:", 4) != 0)
        complain(c, key, "'%s' is no Modbus link: expected rtu:PATH or tcp:HOST:PORT", link);
}

static void check_limits(const struct check *c, const char *path, const struct config_axis *axis) {
    char key[64];
    snprintf(key, sizeof key, "%s.limits_deg", path);
    if (!axis->has_limits)
        complain(c, path,
                 "limits_deg is missing: a motor moves only inside soft limits, as limits_deg: [-70, 140]");
    else if (axis->limits_deg[0] >= axis->limits_deg[1])
        complain(c, key, "the limits %g .. %g deg are reversed: the lower one comes first",
                 axis->limits_deg[0], axis->limits_deg[1]);
}

static void check_motor(const struct check *c, const char *path, const struct config_axis *axis) {
    char key[64];
    check_link(c, path, axis->link);
    check_limits(c, path, axis);
    snprintf(key, sizeof key, "%s.direction", path);
    if (axis->direction == 0)
        complain(c, key, "the direction is 1 or -1, not 0");
    snprintf(key, sizeof key, "%s.blind_deg", path);
    if (axis != &c->config->source && written(c, key))
        complain(c, key,
                 "blind_deg belongs to axes.source: it is the light source that comes near the sensor");
    snprintf(key, sizeof key, "%s.positions", path);
    if (axis != &c->config->holder && written(c, key))
        complain(c, key, "positions belong to the holder, not to %s", path);
}

static void check_holder(const struct check *c) {
    const struct config_axis *holder = &c->config->holder;
    if (holder->kind == CONFIG_AXIS_FIXED)
        complain(c, "holder",
                 "a holder is a motor with positions, or manual: a fixed one could show no reference");
    if (holder->kind != CONFIG_AXIS_MOTOR)
        return;
    if (holder->n_positions < 1)
        complain(c, "holder",
                 "a motorised holder needs its positions, as positions: {sample: 0, reference: 90}");
    for (int i = 0; i < holder->n_positions; i++) {
        const struct config_position *position = &holder->position[i];
        if (position->deg < holder->limits_deg[0] || position->deg > holder->limits_deg[1])
            complain(c, "holder.positions",
                     "position %s at %g deg is outside the holder's limits %g .. %g deg", position->name,
                     position->deg, holder->limits_deg[0], holder->limits_deg[1]);
        for (int j = 0; j < i; j++)
            if (holder->position[j].deg == position->deg)
                complain(c, "holder.positions", "positions %s and %s are both at %g deg",
                         holder->position[j].name, position->name, position->deg);
    }
}

/* Axes with the same link share one bus: one unit id each, and one set of line parameters. */
static void check_pair_on_bus(const struct check *c, int a, int b) {
    const char *path_a, *path_b;
    const struct config_axis *first = axis_at(c->config, a, &path_a);
    const struct config_axis *second = axis_at(c->config, b, &path_b);
    char key[64];
    if (first->kind != CONFIG_AXIS_MOTOR || second->kind != CONFIG_AXIS_MOTOR || !*first->link ||
        strcmp(first->link, second->link) != 0)
        return;
    snprintf(key, sizeof key, "%s.unit", path_b);
    if (first->unit == second->unit)
        complain(c, key, "unit %d on %s is already %s: each axis of a bus has a unit id of its own",
                 second->unit, second->link, path_a);
    snprintf(key, sizeof key, "%s.baud", path_b);
    if (first->baud != second->baud)
        complain(c, key, "%s and %s share %s but not their baud: one bus has one speed", path_a, path_b,
                 second->link);
    snprintf(key, sizeof key, "%s.response_ms", path_b);
    if (first->response_ms != second->response_ms)
        complain(c, key, "%s and %s share %s but not their response_ms", path_a, path_b, second->link);
    snprintf(key, sizeof key, "%s.parity", path_b);
    if (first->parity != second->parity)
        complain(c, key, "%s and %s share %s but not their parity", path_a, path_b, second->link);
}

static void check_axes(const struct check *c) {
    const struct config_axis *source = &c->config->source;
    if (source->kind == CONFIG_AXIS_MANUAL || source->kind == CONFIG_AXIS_FIXED)
        complain(c, "axes.source",
                 "the source axis is a motor: without one there is nothing to run unattended");
    for (int i = 0; i < AXES; i++) {
        const char *path;
        const struct config_axis *axis = axis_at(c->config, i, &path);
        if (axis->kind == CONFIG_AXIS_MOTOR)
            check_motor(c, path, axis);
        for (int j = i + 1; j < AXES; j++)
            check_pair_on_bus(c, i, j);
    }
    if (source->blind_deg > 0 && source->limits_deg[0] >= -source->blind_deg &&
        source->limits_deg[1] <= source->blind_deg && source->limits_deg[0] < source->limits_deg[1])
        complain(c, "axes.source.blind_deg", "the blind zone of %g deg covers the whole travel %g .. %g deg",
                 source->blind_deg, source->limits_deg[0], source->limits_deg[1]);
    check_holder(c);
}

static void check_optics(const struct check *c) {
    double beam = c->config->optics.beam_mm, view = c->config->optics.view_mm;
    if (c->config->optics.filling == FILLING_VIEW_IN_BEAM && view >= beam)
        complain(c, "optics.view_mm",
                 "filling is view-in-beam, but the view (%g mm) is not smaller than the beam (%g mm)", view,
                 beam);
    if (c->config->optics.filling == FILLING_BEAM_IN_VIEW && beam >= view)
        complain(c, "optics.beam_mm",
                 "filling is beam-in-view, but the beam (%g mm) is not smaller than the view (%g mm)", beam,
                 view);
}

static void check_spectrometer(const struct check *c) {
    const char *link = c->config->spectrometer.link, *model = c->config->spectrometer.model;
    if (strcmp(link, "usb") != 0 && strncmp(link, "usbredir:unix:", 14) != 0 &&
        strncmp(link, "usbredir:tcp:", 13) != 0 && strncmp(link, "sim:", 4) != 0)
        complain(c, "spectrometer.link",
                 "'%s' is no way to a spectrometer: expected usb, usbredir:unix:PATH or "
                 "usbredir:tcp:HOST:PORT",
                 link);
    if (spectrometer_model_find(model))
        return;
    int n;
    const struct spectrometer_model *models = spectrometer_models(&n);
    char known[160] = "";
    for (int i = 0; i < n; i++) {
        size_t used = strlen(known);
        snprintf(known + used, sizeof known - used, "%s%s", i ? ", " : "", models[i].name);
    }
    complain(c, "spectrometer.model", "unknown model '%s': goniod knows %s", model, known);
}

static void check_zones(const struct check *c) {
    for (int i = 0; i < c->config->n_keep_out; i++) {
        const struct config_zone *zone = &c->config->keep_out[i];
        char key[64];
        snprintf(key, sizeof key, "keep_out[%d].source_deg", i);
        if (zone->source_deg[0] > zone->source_deg[1])
            complain(c, key, "the interval %g .. %g deg is reversed", zone->source_deg[0],
                     zone->source_deg[1]);
        snprintf(key, sizeof key, "keep_out[%d].sample_deg", i);
        if (zone->sample_deg[0] > zone->sample_deg[1])
            complain(c, key, "the interval %g .. %g deg is reversed", zone->sample_deg[0],
                     zone->sample_deg[1]);
    }
}

int config_read_text(const char *file, const char *text, size_t size, struct config *config,
                     struct err_list *errors) {
    *config = (struct config){0};
    snprintf(config->file, sizeof config->file, "%s", file);
    size_t before = errors->n;
    struct yaml_places places = {0};
    /* A holder turns freely, so that its limits have a default; a file's own limits replace it. */
    config->holder.has_limits = true;
    config->holder.limits_deg[0] = -180;
    config->holder.limits_deg[1] = 360;
    yaml_read_text_places(file, text, size, config_keys, config, errors, &places);
    struct check check = {config, &places, errors};
    if (config->source.kind != CONFIG_AXIS_ABSENT && config->sample.kind != CONFIG_AXIS_ABSENT)
        check_axes(&check);
    if (config->optics.beam_mm > 0 && config->optics.view_mm > 0)
        check_optics(&check);
    if (config->spectrometer.model[0])
        check_spectrometer(&check);
    check_zones(&check);
    yaml_sort_errors(errors, before);
    yaml_places_free(&places);
    return errors->n > before ? -ERR_INPUT : 0;
}

int config_read_file(const char *path, struct config *config, struct err_list *errors) {
    char *text;
    size_t size;
    struct err e = {0};
    if (file_read(path, YAML_BYTES_MAX, &text, &size, &e) < 0) {
        err_list_add(errors, &e);
        return -e.code;
    }
    int rc = config_read_text(path, text, size, config, errors);
    free(text);
    return rc;
}

const struct config_position *config_position_find(const struct config_axis *holder, const char *name) {
    for (int i = 0; i < holder->n_positions; i++)
        if (strcmp(holder->position[i].name, name) == 0)
            return &holder->position[i];
    return NULL;
}

const char *config_builtin_text(void) {
    return "# The bench of `goniod --simulate` without --config.\n"
           "spectrometer: {model: usb2000plus, link: sim:usb}\n"
           "shutter: lamp-line\n"
           "lamp: {warm_up_min: 30}\n"
           "optics: {beam_mm: 20, view_mm: 3, filling: view-in-beam, source_width_deg: 1, sensor_width_deg: "
           "1,\n"
           "         polarisation: {value: 0, u: 0.02}}\n"
           "axes:\n"
           "  source: {profile: om-az, link: sim:modbus, unit: 1, limits_deg: [-70, 140], blind_deg: 8,\n"
           "           u_zero_deg: 0.01}\n"
           "  sample: {profile: om-az, link: sim:modbus, unit: 2, limits_deg: [-90, 90], u_zero_deg: 0.01}\n"
           "holder: {profile: om-az, link: sim:modbus, unit: 3, limits_deg: [-10, 190],\n"
           "         positions: {sample: 0, reference: 90, trap: 180}}\n"
           "access: {watch: [users], operate: [goniod]}\n";
}

void config_print_reference(void *file) {
    yaml_print_reference(file, "goniod.yaml", config_keys);
    yaml_print_reference(file, "goniod.yaml: an axis or a holder that is a motor", config_axis_keys);
    yaml_print_reference(file, "goniod.yaml: an axis that is fixed", config_fixed_keys);
}
