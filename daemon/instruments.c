#include "daemon/instruments.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/drives.h"
#include "proto/units.h"

/* ---- the real wiring ---- */

static int real_modbus(void *self, const struct modbus_link_config *link, struct modbus_link *out,
                       struct err *e) {
    return modbus_link_open(out, link, self, e);
}

static int real_usb(void *self, const char *target, const struct spectrometer_model *model,
                    const char *serial, struct usb_link *out, struct err *e) {
    return usb_link_open(out, target, model->vid, model->pid, *serial ? serial : NULL, self, e);
}

void wiring_real(struct wiring *wiring, struct clock *clock) {
    *wiring = (struct wiring){.self = clock, .modbus = real_modbus, .usb = real_usb};
}

/* ---- names ---- */

static const char *const axis_name[STAGE_AXES] = {
    [STAGE_SOURCE] = "source", [STAGE_SAMPLE] = "sample", [STAGE_HOLDER] = "holder"};

const char *stage_axis_name(enum stage_axis which) {
    return axis_name[which];
}

int stage_axis_find(const char *name) {
    for (int i = 0; i < STAGE_AXES; i++)
        if (!strcmp(axis_name[i], name))
            return i;
    return -1;
}

const struct config_axis *instruments_axis(const struct config *config, enum stage_axis which) {
    return which == STAGE_SOURCE   ? &config->source
           : which == STAGE_SAMPLE ? &config->sample
                                   : &config->holder;
}

double instruments_u_repeat_deg(const struct config *config, enum stage_axis which,
                                const struct profile *profile) {
    double own = instruments_axis(config, which)->u_repeat_deg;
    return own > 0 ? own : profile ? profile->u_repeat_deg : 0;
}

/* ---- what needs no device ---- */

static void load_profile(struct instruments *i, enum stage_axis which, struct err_list *errors) {
    const struct config_axis *a = instruments_axis(i->config, which);
    if (a->kind != CONFIG_AXIS_MOTOR)
        return;
    i->profile[which] = calloc(1, sizeof *i->profile[which]);
    if (i->profile[which])
        profile_load(a->profile, i->profile[which], errors);
}

/* A keep-out zone as config writes it, in the stage's terms. */
static void set_zones(struct instruments *i) {
    i->stage.n_zones = i->config->n_keep_out;
    for (int z = 0; z < i->config->n_keep_out; z++) {
        const struct config_zone *from = &i->config->keep_out[z];
        struct keep_out *to = &i->stage.zone[z];
        to->used[STAGE_SOURCE] = to->used[STAGE_SAMPLE] = true;
        to->low_udeg[STAGE_SOURCE] = udeg_from_deg(from->source_deg[0]);
        to->high_udeg[STAGE_SOURCE] = udeg_from_deg(from->source_deg[1]);
        to->low_udeg[STAGE_SAMPLE] = udeg_from_deg(from->sample_deg[0]);
        to->high_udeg[STAGE_SAMPLE] = udeg_from_deg(from->sample_deg[1]);
    }
}

int instruments_load(struct instruments *i, struct bench *bench, const struct config *config,
                     const struct wiring *wiring, const char *state_dir, struct err_list *errors) {
    size_t before = errors->n;
    memset(i, 0, sizeof *i);
    i->bench = i->stage.bench = bench;
    i->config = config;
    i->wiring = wiring;
    snprintf(i->state_dir, sizeof i->state_dir, "%s", state_dir);
    for (int a = 0; a < STAGE_AXES; a++)
        load_profile(i, a, errors);
    i->model = spectrometer_model_find(config->spectrometer.model);
    if (!i->model) {
        struct err e = {0};
        err_set(&e, ERR_INPUT, "%s: spectrometer model \"%s\" is not known", config->file,
                config->spectrometer.model);
        err_list_add(errors, &e);
    }
    set_zones(i);
    return errors->n == before ? 0 : -ERR_INPUT;
}

void instruments_free(struct instruments *i) {
    instruments_close(i);
    for (int a = 0; a < STAGE_AXES; a++) {
        free(i->profile[a]);
        i->profile[a] = NULL;
    }
}

void instruments_plan_devices(const struct instruments *i, struct plan_devices *devices) {
    for (int a = 0; a < STAGE_AXES; a++)
        devices->profile[a] = i->profile[a];
    devices->spectrometer = i->model;
}

/* ---- opening ---- */

static void link_config(const struct config_axis *a, const struct profile *p, struct modbus_link_config *c) {
    *c = (struct modbus_link_config){.target = a->link,
                                     .baud = a->baud ? a->baud : p->link.baud,
                                     .parity = a->parity ? a->parity : profile_parities[p->link.parity],
                                     .data_bits = p->link.data,
                                     .stop_bits = p->link.stop,
                                     .response_ms = a->response_ms ? a->response_ms : p->link.response_ms,
                                     .byte_ms = p->link.byte_ms,
                                     .gap_ms = p->link.gap_ms,
                                     .quarantine_ms = p->link.quarantine_ms};
}

static void pass_on(void *arg, int64_t sent_us, int64_t done_us, const struct modbus_request *sent,
                    const struct modbus_request *reply, int result) {
    const struct instruments_bus *bus = arg;
    if (bus->owner->seen)
        bus->owner->seen(bus->owner->seen_arg, bus->target, sent_us, done_us, sent, reply, result);
}

static int open_bus(struct instruments *i, enum stage_axis which, struct modbus_link **link, struct err *e) {
    const struct config_axis *a = instruments_axis(i->config, which);
    for (int b = 0; b < i->n_buses; b++)
        if (!strcmp(i->bus[b].target, a->link)) {
            *link = &i->bus[b].link;
            return 0;
        }
    struct modbus_link_config config;
    struct modbus_link inner;
    link_config(a, i->profile[which], &config);
    int result = i->wiring->modbus(i->wiring->self, &config, &inner, e);
    if (result < 0)
        return result;
    struct instruments_bus *bus = &i->bus[i->n_buses];
    *bus = (struct instruments_bus){.owner = i};
    snprintf(bus->target, sizeof bus->target, "%s", a->link);
    result = modbus_link_record(&bus->link, &inner, i->bench->clock, pass_on, bus, e);
    if (result < 0) {
        modbus_link_close(&inner);
        return result;
    }
    i->n_buses++;
    *link = &bus->link;
    return 0;
}

static void axis_limits(const struct config_axis *a, const struct profile *p, struct axis_config *c) {
    c->low_udeg = udeg_from_deg(-360);
    c->high_udeg = udeg_from_deg(360);
    if (a->has_limits) {
        c->low_udeg = udeg_from_deg(a->limits_deg[0]);
        c->high_udeg = udeg_from_deg(a->limits_deg[1]);
    } else if (p && p->limits.low_deg < p->limits.high_deg) {
        c->low_udeg = udeg_from_deg(p->limits.low_deg);
        c->high_udeg = udeg_from_deg(p->limits.high_deg);
    }
}

static int open_axis(struct instruments *i, enum stage_axis which, struct err *e) {
    static const enum axis_kind kind[] = {[CONFIG_AXIS_ABSENT] = AXIS_ABSENT,
                                          [CONFIG_AXIS_MOTOR] = AXIS_MOTOR,
                                          [CONFIG_AXIS_MANUAL] = AXIS_MANUAL,
                                          [CONFIG_AXIS_FIXED] = AXIS_FIXED};
    const struct config_axis *a = instruments_axis(i->config, which);
    struct axis_config c = {.kind = kind[a->kind],
                            .profile = i->profile[which],
                            .unit = a->unit,
                            .zero_udeg = udeg_from_deg(a->zero_deg),
                            .direction = a->direction ? a->direction : 1,
                            .fixed_udeg = udeg_from_deg(a->fixed_deg)};
    struct modbus_link *link = NULL;
    snprintf(c.name, sizeof c.name, "%s", stage_axis_name(which));
    axis_limits(a, i->profile[which], &c);
    if (c.kind == AXIS_ABSENT)
        return 0;
    if (c.kind == AXIS_MOTOR) {
        int result = open_bus(i, which, &link, e);
        if (result < 0)
            return result;
        c.position_valid = i->wiring->simulated || drives_position_valid(i->state_dir, a, i->profile[which]);
    }
    if (c.kind == AXIS_FIXED && i->wiring->turned) {
        int result = i->wiring->turned(i->wiring->self, c.name, a->fixed_deg, e);
        if (result < 0)
            return result;
    }
    return axis_open(&i->stage.axis[which], &c, link, i->bench, e);
}

int instruments_open_stage(struct instruments *i, const bool uses[STAGE_AXES], struct err *e) {
    for (int a = 0; a < STAGE_AXES; a++) {
        bool motor = instruments_axis(i->config, a)->kind == CONFIG_AXIS_MOTOR;
        if (i->stage.axis[a] || (motor ? !uses[a] : a == STAGE_HOLDER))
            continue;
        int result = open_axis(i, a, e);
        if (result < 0)
            return result;
    }
    return 0;
}

/* A redirected unit is not chosen by its serial number, so it is looked at again here. */
static int check_serial(const struct instruments *i, struct err *e) {
    const char *wanted = i->config->spectrometer.serial,
               *found = spectrometer_calibration(i->spectrometer)->serial;
    if (i->wiring->simulated || !*wanted || strcmp(wanted, found) == 0)
        return 0;
    return err_set(
        e, ERR_DEVICE,
        "the spectrometer at %s has the serial number %s, goniod.yaml asks for %s: connect that one, "
        "or change spectrometer.serial",
        i->config->spectrometer.link, found, wanted);
}

int instruments_open_spectrometer(struct instruments *i, const struct cancel *cancel, struct err *e) {
    if (i->spectrometer)
        return 0;
    const struct config *c = i->config;
    int result =
        i->wiring->usb(i->wiring->self, c->spectrometer.link, i->model, c->spectrometer.serial, &i->usb, e);
    if (result < 0)
        return result;
    i->usb_open = true;
    result = usb_link_serve(&i->usb, i->bench, e);
    if (result == 0)
        result = spectrometer_open(&i->spectrometer, i->model, &i->usb, i->bench, cancel, e);
    if (result == 0)
        result = check_serial(i, e);
    if (result < 0)
        instruments_close_spectrometer(i);
    return result;
}

void instruments_close_spectrometer(struct instruments *i) {
    if (i->spectrometer)
        spectrometer_close(i->spectrometer);
    i->spectrometer = NULL;
    if (i->usb_open)
        usb_link_close(&i->usb, i->bench);
    i->usb_open = false;
}

void instruments_close(struct instruments *i) {
    instruments_close_spectrometer(i);
    for (int a = 0; a < STAGE_AXES; a++) {
        if (i->stage.axis[a])
            axis_close(i->stage.axis[a]);
        i->stage.axis[a] = NULL;
    }
    for (int b = 0; b < i->n_buses; b++)
        modbus_link_close(&i->bus[b].link);
    i->n_buses = 0;
}

/* ---- what is known of a unit ---- */

int instruments_check_commissioned(const struct instruments *i, enum stage_axis which, struct err *e) {
    const struct profile *p = i->profile[which];
    if (!p || i->wiring->simulated || p->evidence != PROFILE_SOURCES_ONLY ||
        drives_commissioned(i->state_dir, instruments_axis(i->config, which), p))
        return 0;
    return err_set(e, ERR_STATE,
                   "the %s axis runs by profile %s, which nobody has tried on a real unit: prove it on yours "
                   "with `gonioctl commission %s`",
                   stage_axis_name(which), p->id, stage_axis_name(which));
}

int instruments_record_drive(struct instruments *i, enum stage_axis which, bool position_valid,
                             bool commissioned, struct err *e) {
    if (i->wiring->simulated || !i->profile[which])
        return 0;
    struct drive_record record = {.position_valid = position_valid,
                                  .commissioned = commissioned,
                                  .utc_us = clock_utc_us(i->bench->clock)};
    return drives_record(i->state_dir, instruments_axis(i->config, which), i->profile[which], &record, e);
}
