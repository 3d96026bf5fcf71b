#include "sim/goniosim_config.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "proto/spectrum.h"
#include "proto/yaml.h"

#define AT(member) offsetof(struct goniosim_config, member)
#define AXIS(member) offsetof(struct sim_axis_config, member)
#define PLACE(member) offsetof(struct goniosim_place, member)
#define TEXT(member) sizeof(((struct goniosim_place *)0)->member)

static const char *const EEPROMS[] = {"good", "blank", "corrupt", NULL};

static const struct yaml_key SPECTROMETER[] = {
    {.name = "model",
     .type = YAML_STRING,
     .offset = AT(bench.spectrometer),
     .size = 24,
     .default_text = "usb2000plus",
     .doc = "usb2000plus or usb4000"},
    {.name = "serial",
     .type = YAML_STRING,
     .offset = AT(bench.serial),
     .size = 15,
     .default_text = "USB2+SIM001",
     .doc = "as in EEPROM slot 0"},
    {.name = "eeprom",
     .type = YAML_CHOICE,
     .offset = AT(bench.eeprom),
     .choices = EEPROMS,
     .default_text = "good",
     .doc = "blank: never written; corrupt: a wavelength coefficient is damaged"},
    {.name = "bend",
     .type = YAML_DOUBLE,
     .offset = AT(bench.bend),
     .low = -0.1,
     .high = 0.1,
     .default_text = "0",
     .doc = "relative error of the counts at full scale that the EEPROM's polynomial does not know"},
    {.name = "listen",
     .type = YAML_STRING,
     .offset = AT(usb_listen),
     .size = 128,
     .default_text = "tcp:0",
     .doc = "usbredir: tcp:PORT (0 = any free one) or unix:PATH; none = no spectrometer"},
    {0}};

static const struct yaml_key OPTICS[] = {
    {.name = "beam_mm",
     .type = YAML_DOUBLE,
     .offset = AT(bench.beam_mm),
     .low = 0.1,
     .high = 1000,
     .default_text = "20",
     .unit = "mm",
     .doc = "diameter of the beam"},
    {.name = "view_mm",
     .type = YAML_DOUBLE,
     .offset = AT(bench.view_mm),
     .low = 0.1,
     .high = 1000,
     .default_text = "3",
     .unit = "mm",
     .doc = "diameter of the view; the larger of both decides the filling case"},
    {.name = "source_width_deg",
     .type = YAML_DOUBLE,
     .offset = AT(bench.source_width_deg),
     .low = 0,
     .high = 20,
     .default_text = "0",
     .unit = "deg",
     .doc = "full angular width of the source, in the plane of incidence"},
    {.name = "sensor_width_deg",
     .type = YAML_DOUBLE,
     .offset = AT(bench.sensor_width_deg),
     .low = 0,
     .high = 20,
     .default_text = "0",
     .unit = "deg",
     .doc = "full angular width of the sensor"},
    {.name = "polarisation",
     .type = YAML_DOUBLE,
     .offset = AT(bench.polarisation),
     .low = -1,
     .high = 1,
     .default_text = "0",
     .doc = "P that source and sensor together prefer"},
    {.name = "u_polarisation",
     .type = YAML_DOUBLE,
     .offset = AT(bench.u_polarisation),
     .low = 0,
     .high = 0.2,
     .default_text = "0",
     .doc = "the true P is drawn from it"},
    {.name = "stray_light",
     .type = YAML_DOUBLE,
     .offset = AT(bench.stray_light),
     .low = 0,
     .high = 0.1,
     .default_text = "5e-4",
     .doc = "inside the spectrometer, share of the mean signal"},
    {.name = "halo",
     .type = YAML_DOUBLE,
     .offset = AT(bench.halo),
     .low = 0,
     .high = 0.1,
     .default_text = "0",
     .doc = "light past the surface, share of a white one at normal incidence"},
    {0}};

static const struct yaml_key LAMP[] = {{.name = "warm_up_min",
                                        .type = YAML_DOUBLE,
                                        .offset = AT(bench.lamp_warm_up_min),
                                        .low = 0,
                                        .high = 600,
                                        .default_text = "30",
                                        .unit = "min",
                                        .doc = "until its level is within 1e-4; 0 = always warm"},
                                       {.name = "drift_rate",
                                        .type = YAML_DOUBLE,
                                        .offset = AT(bench.lamp_drift_rate),
                                        .low = 0,
                                        .high = 1e-3,
                                        .default_text = "1e-9",
                                        .unit = "1/s",
                                        .doc = "relative variance of the level per second"},
                                       {0}};

static const struct yaml_key AXES[] = {
    {.name = "role",
     .type = YAML_STRING,
     .offset = AXIS(role),
     .size = 16,
     .required = true,
     .doc = "source, sample or holder"},
    {.name = "unit",
     .type = YAML_INT,
     .offset = AXIS(unit),
     .low = 1,
     .high = 247,
     .required = true,
     .doc = "Modbus unit id"},
    {.name = "direction",
     .type = YAML_INT,
     .offset = AXIS(direction),
     .low = -1,
     .high = 1,
     .default_text = "1",
     .doc = "1 or -1: user position = direction * raw - zero"},
    {.name = "zero_deg",
     .type = YAML_DOUBLE,
     .offset = AXIS(zero_deg),
     .low = -400,
     .high = 400,
     .default_text = "0",
     .unit = "deg",
     .doc = "as goniod.yaml states it"},
    {.name = "u_zero_deg",
     .type = YAML_DOUBLE,
     .offset = AXIS(u_zero_deg),
     .low = 0,
     .high = 5,
     .unit = "deg",
     .default_text = "0.01",
     .doc = "the true zero is drawn from it"},
    {.name = "u_repeat_deg",
     .type = YAML_DOUBLE,
     .offset = AXIS(u_repeat_deg),
     .low = 0,
     .high = 1,
     .unit = "deg",
     .default_text = "0.002",
     .doc = "repeatability of a move"},
    {.name = "lost_motion_deg",
     .type = YAML_DOUBLE,
     .offset = AXIS(lost_motion_deg),
     .low = 0,
     .high = 1,
     .unit = "deg",
     .default_text = "0.033",
     .doc = "of the gear, seen when approached downwards"},
    {.name = "speed_deg_s",
     .type = YAML_DOUBLE,
     .offset = AXIS(speed_deg_s),
     .low = 0.01,
     .high = 2000,
     .unit = "deg/s",
     .default_text = "20",
     .doc = "of a home"},
    {.name = "accel_deg_s2",
     .type = YAML_DOUBLE,
     .offset = AXIS(accel_deg_s2),
     .low = 0.01,
     .high = 100000,
     .unit = "deg/s^2",
     .default_text = "40",
     .doc = "of a home"},
    {.name = "watchdog_ms",
     .type = YAML_INT,
     .offset = AXIS(watchdog_ms),
     .low = 0,
     .high = 10000,
     .unit = "ms",
     .default_text = "1000",
     .doc = "communication timeout of the drive, alarm 85h; 0 = off"},
    {.name = "mute", .type = YAML_BOOL, .offset = AXIS(mute), .doc = "the unit answers nothing"},
    {.name = "no_coordinates",
     .type = YAML_BOOL,
     .offset = AXIS(no_coordinates),
     .doc = "home was never set: an absolute move ends in alarm 4Ah"},
    {.name = "switch_low_deg",
     .type = YAML_DOUBLE,
     .offset = AXIS(switch_low_deg),
     .unit = "deg",
     .doc = "limit switch, raw; both equal = none"},
    {.name = "switch_high_deg",
     .type = YAML_DOUBLE,
     .offset = AXIS(switch_high_deg),
     .unit = "deg",
     .doc = "limit switch, raw"},
    {0}};

static const struct yaml_key PLACES[] = {
    {.name = "name",
     .type = YAML_STRING,
     .offset = PLACE(name),
     .size = TEXT(name),
     .required = true,
     .doc = "of the position; reference holds the diffuser"},
    {.name = "deg",
     .type = YAML_DOUBLE,
     .offset = PLACE(deg),
     .low = -720,
     .high = 720,
     .unit = "deg",
     .required = true,
     .doc = "of the holder axis"},
    {.name = "paint",
     .type = YAML_STRING,
     .offset = PLACE(paint),
     .size = TEXT(paint),
     .doc = "Cadmium Red, Hooker's Green or Cobalt Blue Hue"},
    {.name = "support",
     .type = YAML_STRING,
     .offset = PLACE(support),
     .size = TEXT(support),
     .default_text = "drawing paper",
     .doc = "of the paint: drawing paper or acrylic board"},
    {.name = "water_percent",
     .type = YAML_INT,
     .offset = PLACE(water_percent),
     .low = 0,
     .high = 90,
     .unit = "%",
     .doc = "of the paint, by weight"},
    {.name = "sigma",
     .type = YAML_DOUBLE,
     .offset = PLACE(sigma),
     .low = 0,
     .high = 1.5,
     .doc = "a parameter set of your own: diffuse roughness, with gamma, beta_prime, n and spectrum"},
    {.name = "gamma",
     .type = YAML_DOUBLE,
     .offset = PLACE(gamma),
     .low = 0,
     .high = 1.5,
     .doc = "specular roughness"},
    {.name = "beta_prime",
     .type = YAML_DOUBLE,
     .offset = PLACE(beta_prime),
     .low = 0,
     .high = 10000,
     .doc = "height of the specular lobe"},
    {.name = "n", .type = YAML_DOUBLE, .offset = PLACE(n), .low = 0, .high = 5, .doc = "refractive index"},
    {.name = "spectrum",
     .type = YAML_STRING,
     .offset = PLACE(spectrum),
     .size = TEXT(spectrum),
     .doc = "CSV lambda_nm,value: S(lambda) over 380..780 nm"},
    {.name = "brdf",
     .type = YAML_STRING,
     .offset = PLACE(brdf),
     .size = TEXT(brdf),
     .doc = "a measured surface"},
    {0}};

static const struct yaml_key KEYS[] = {
    {.name = "seed",
     .type = YAML_INT,
     .offset = AT(seed),
     .low = 0,
     .high = 2147483647,
     .default_text = "1",
     .doc = "of every draw; the same seed is the same bench"},
    {.name = "quiet",
     .type = YAML_BOOL,
     .offset = AT(bench.quiet),
     .default_text = "false",
     .doc = "no noise, no drift, no draws"},
    {.name = "reply_delay_ms",
     .type = YAML_DOUBLE,
     .offset = AT(reply_delay_ms),
     .low = 0,
     .high = 10000,
     .default_text = "0",
     .unit = "ms",
     .doc = "of every Modbus reply"},
    {.name = "modbus",
     .type = YAML_STRINGS,
     .offset = AT(bus),
     .size = 128,
     .count_offset = AT(n_buses),
     .capacity = GONIOSIM_BUSES,
     .doc = "buses: tcp:PORT (0 = any free one), rtu (a pty) or rtu:LINK to it"},
    {.name = "spectrometer", .type = YAML_MAP, .keys = SPECTROMETER, .doc = "the instrument at the fibre"},
    {.name = "optics", .type = YAML_MAP, .keys = OPTICS, .doc = "spots and stray light"},
    {.name = "lamp",
     .type = YAML_MAP,
     .keys = LAMP,
     .doc = "the lamp; the spectrometer's lamp line is its shutter"},
    {.name = "certificate_u_rel",
     .type = YAML_DOUBLE,
     .offset = AT(bench.certificate_u_rel),
     .low = 0,
     .high = 0.2,
     .default_text = "0.005",
     .doc = "the diffuser differs from its certificate by a draw from it"},
    {.name = "axes",
     .type = YAML_LIST,
     .offset = AT(bench.axis),
     .size = sizeof(struct sim_axis_config),
     .count_offset = AT(bench.n_axes),
     .capacity = SIM_AXES,
     .keys = AXES,
     .doc = "drives; all are on every bus"},
    {.name = "holder",
     .type = YAML_LIST,
     .offset = AT(place),
     .size = sizeof(struct goniosim_place),
     .count_offset = AT(n_places),
     .capacity = SIM_POSITIONS,
     .keys = PLACES,
     .doc = "what stands where"},
    {0}};

static void complain(struct err_list *errors, const char *format, ...) __attribute__((format(printf, 2, 3)));

static void complain(struct err_list *errors, const char *format, ...) {
    va_list args;
    va_start(args, format);
    err_list_mistake(errors, "", 0, 0, format, args);
    va_end(args);
}

static void load_paint(struct goniosim_place *p, struct err_list *errors) {
    struct err e = {0};
    if (sim_paint_find(p->paint, p->support, p->water_percent, &p->surface, &e) != 0)
        err_list_add(errors, &e);
}

static void load_parameters(struct goniosim_place *p, struct err_list *errors) {
    struct spectrum s;
    if (!(p->sigma > 0) || !(p->gamma > 0) || !(p->n > 1))
        complain(errors, "position %s: a parameter set needs sigma and gamma above 0 and n above 1", p->name);
    if (spectrum_read_file(p->spectrum, &s, errors) != 0)
        return;
    p->surface =
        (struct sim_surface){.sigma = p->sigma, .gamma = p->gamma, .beta_prime = p->beta_prime, .n = p->n};
    for (int k = 0; k < BANDS; k++) {
        p->surface.s_lambda[k] = s.value[k];
        if (s.covered[k] && s.value[k] >= 0)
            continue;
        complain(errors, "position %s: %s must say S >= 0 over 380..780 nm, and does not at %d nm", p->name,
                 p->spectrum, band_nm(k));
        return;
    }
}

static void load_brdf(struct goniosim_place *p, struct err_list *errors) {
    struct brdf b;
    struct err e = {0};
    if (brdf_read_file(p->brdf, &b, &e) != 0) {
        err_list_add(errors, &e);
        return;
    }
    if (measured_new(&p->measured, &b, &e) != 0)
        err_list_add(errors, &e);
    p->surface.measured = p->measured;
    brdf_free(&b);
}

static void load(struct goniosim_place *p, struct err_list *errors) {
    int kinds = (p->paint[0] != 0) + (p->spectrum[0] != 0) + (p->brdf[0] != 0);
    if (kinds > 1)
        complain(errors, "position %s: paint, spectrum and brdf are three ways to say one thing; keep one",
                 p->name);
    p->has_surface = kinds == 1;
    if (kinds != 1)
        return;
    if (p->paint[0])
        load_paint(p, errors);
    else if (p->brdf[0])
        load_brdf(p, errors);
    else
        load_parameters(p, errors);
    snprintf(p->surface.name, sizeof p->surface.name, "%s", p->paint[0] ? p->paint : p->name);
}

static void check_listeners(const struct goniosim_config *c, struct err_list *errors) {
    for (int i = 0; i < c->n_buses; i++)
        if (strncmp(c->bus[i], "tcp:", 4) != 0 && strcmp(c->bus[i], "rtu") != 0 &&
            strncmp(c->bus[i], "rtu:", 4) != 0)
            complain(errors, "modbus: %s is neither tcp:PORT nor rtu nor rtu:LINK", c->bus[i]);
    const char *usb = c->usb_listen;
    if (strncmp(usb, "tcp:", 4) != 0 && strncmp(usb, "unix:", 5) != 0 && strcmp(usb, "none") != 0)
        complain(errors, "spectrometer.listen: %s is neither tcp:PORT nor unix:PATH nor none", usb);
}

static void defaults(struct goniosim_config *c) {
    memset(c, 0, sizeof *c);
    sim_config_default(&c->bench);
    c->seed = 1;
    c->n_buses = 2;
    strcpy(c->bus[0], "tcp:0");
    strcpy(c->bus[1], "rtu");
    strcpy(c->usb_listen, "tcp:0");
    memset(c->bench.axis, 0, sizeof c->bench.axis);
    c->bench.n_axes = 0;
}

/* Lists are taken whole: those of the built-in bench stand only where none was written. */
static void default_lists(struct goniosim_config *c) {
    struct sim_config built_in;
    sim_config_default(&built_in);
    if (c->bench.n_axes == 0) {
        memcpy(c->bench.axis, built_in.axis, sizeof built_in.axis);
        c->bench.n_axes = built_in.n_axes;
    }
    if (c->n_places > 0)
        return;
    c->n_places = built_in.n_positions;
    for (int i = 0; i < c->n_places; i++) {
        strcpy(c->place[i].name, built_in.position[i].name);
        c->place[i].deg = built_in.position[i].deg;
    }
    strcpy(c->place[0].paint, "Hooker's Green");
    strcpy(c->place[0].support, "acrylic board");
}

int goniosim_config_read(const char *path, struct goniosim_config *c, struct err_list *errors) {
    size_t before = errors->n;
    defaults(c);
    if (path && yaml_read_file(path, KEYS, c, errors) != 0)
        return -ERR_INPUT;
    default_lists(c);
    c->bench.seed = (uint64_t)c->seed;
    c->bench.filling = c->bench.view_mm <= c->bench.beam_mm ? SIM_VIEW_IN_BEAM : SIM_BEAM_IN_VIEW;
    c->bench.n_positions = c->n_places;
    for (int i = 0; i < c->n_places; i++) {
        load(&c->place[i], errors);
        snprintf(c->bench.position[i].name, sizeof c->bench.position[i].name, "%s", c->place[i].name);
        c->bench.position[i].deg = c->place[i].deg;
    }
    check_listeners(c, errors);
    return errors->n == before ? 0 : -ERR_INPUT;
}

void goniosim_config_free(struct goniosim_config *c) {
    for (int i = 0; i < c->n_places; i++)
        measured_free(c->place[i].measured);
}

void goniosim_config_print_reference(FILE *out) {
    yaml_print_reference(out, "goniosim.yaml", KEYS);
}
