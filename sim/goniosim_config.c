#include "sim/goniosim_config.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "proto/spectrum.h"
#include "proto/yaml_table.h"

#define AT(member) struct goniosim_config, member
#define AXIS(member) struct sim_axis_config, member
#define PLACE(member) struct goniosim_place, member

static const char *const EEPROMS[] = {"good", "blank", "corrupt", NULL};

static const struct yaml_key SPECTROMETER[] = {
    YAML_TEXT("model", AT(bench.spectrometer), .default_text = "usb2000plus",
              .doc = "usb2000plus or usb4000"),
    YAML_TEXT("serial", AT(bench.serial), .default_text = "USB2+SIM001", .doc = "as in EEPROM slot 0"),
    YAML_WORD("eeprom", AT(bench.eeprom), EEPROMS, .default_text = "good",
              .doc = "blank: never written; corrupt: a wavelength coefficient is damaged"),
    YAML_NUMBER("bend", AT(bench.bend), -0.1, 0.1, .default_text = "0",
                .doc =
                    "relative error of the counts at full scale that the EEPROM's polynomial does not know"),
    YAML_TEXT("listen", AT(usb_listen), .default_text = "tcp:0",
              .doc = "usbredir: tcp:PORT (0 = any free one) or unix:PATH; none = no spectrometer"),
    {0}};

static const struct yaml_key OPTICS[] = {
    YAML_NUMBER("beam_mm", AT(bench.beam_mm), 0.1, 1000, .default_text = "20", .unit = "mm",
                .doc = "diameter of the beam"),
    YAML_NUMBER("view_mm", AT(bench.view_mm), 0.1, 1000, .default_text = "3", .unit = "mm",
                .doc = "diameter of the view; the larger of both decides the filling case"),
    YAML_NUMBER("source_width_deg", AT(bench.source_width_deg), 0, 20, .default_text = "0", .unit = "deg",
                .doc = "full angular width of the source, in the plane of incidence"),
    YAML_NUMBER("sensor_width_deg", AT(bench.sensor_width_deg), 0, 20, .default_text = "0", .unit = "deg",
                .doc = "full angular width of the sensor"),
    YAML_NUMBER("polarisation", AT(bench.polarisation), -1, 1, .default_text = "0",
                .doc = "P that source and sensor together prefer"),
    YAML_NUMBER("u_polarisation", AT(bench.u_polarisation), 0, 0.2, .default_text = "0",
                .doc = "the true P is drawn from it"),
    YAML_NUMBER("stray_light", AT(bench.stray_light), 0, 0.1, .default_text = "5e-4",
                .doc = "inside the spectrometer, share of the mean signal"),
    YAML_NUMBER("halo", AT(bench.halo), 0, 0.1, .default_text = "0",
                .doc = "light past the surface, share of a white one at normal incidence"),
    {0}};

static const struct yaml_key LAMP[] = {
    YAML_NUMBER("warm_up_min", AT(bench.lamp_warm_up_min), 0, 600, .default_text = "30", .unit = "min",
                .doc = "until its level is within 1e-4; 0 = always warm"),
    YAML_NUMBER("drift_rate", AT(bench.lamp_drift_rate), 0, 1e-3, .default_text = "1e-9", .unit = "1/s",
                .doc = "relative variance of the level per second"),
    {0}};

static const struct yaml_key AXES[] = {
    YAML_TEXT("role", AXIS(role), .required = true, .doc = "source, sample or holder"),
    YAML_INTEGER("unit", AXIS(unit), 1, 247, .required = true, .doc = "Modbus unit id"),
    YAML_INTEGER("direction", AXIS(direction), -1, 1, .default_text = "1",
                 .doc = "1 or -1: user position = direction * raw - zero"),
    YAML_NUMBER("zero_deg", AXIS(zero_deg), -400, 400, .default_text = "0", .unit = "deg",
                .doc = "as goniod.yaml states it"),
    YAML_NUMBER("u_zero_deg", AXIS(u_zero_deg), 0, 5, .unit = "deg", .default_text = "0.01",
                .doc = "the true zero is drawn from it"),
    YAML_NUMBER("u_repeat_deg", AXIS(u_repeat_deg), 0, 1, .unit = "deg", .default_text = "0.002",
                .doc = "repeatability of a move"),
    YAML_NUMBER("lost_motion_deg", AXIS(lost_motion_deg), 0, 1, .unit = "deg", .default_text = "0.033",
                .doc = "of the gear, seen where the axis' angle is approached downwards"),
    YAML_NUMBER("speed_deg_s", AXIS(speed_deg_s), 0.01, 2000, .unit = "deg/s", .default_text = "20",
                .doc = "of a home"),
    YAML_NUMBER("accel_deg_s2", AXIS(accel_deg_s2), 0.01, 100000, .unit = "deg/s^2", .default_text = "40",
                .doc = "of a home"),
    YAML_INTEGER("watchdog_ms", AXIS(watchdog_ms), 0, 10000, .unit = "ms", .default_text = "1000",
                 .doc = "communication timeout of the drive, alarm 85h; 0 = off"),
    YAML_FLAG("mute", AXIS(mute), .doc = "the unit answers nothing"),
    YAML_FLAG("no_coordinates", AXIS(no_coordinates),
              .doc = "home was never set: an absolute move ends in alarm 4Ah"),
    YAML_NUMBER("switch_low_deg", AXIS(switch_low_deg), 0, 0, .unit = "deg",
                .doc = "limit switch, raw; both equal = none"),
    YAML_NUMBER("switch_high_deg", AXIS(switch_high_deg), 0, 0, .unit = "deg", .doc = "limit switch, raw"),
    {0}};

static const struct yaml_key PLACES[] = {
    YAML_TEXT("name", PLACE(name), .required = true, .doc = "of the position; reference holds the diffuser"),
    YAML_NUMBER("deg", PLACE(deg), -720, 720, .unit = "deg", .required = true, .doc = "of the holder axis"),
    YAML_TEXT("paint", PLACE(paint), .doc = "Cadmium Red, Hooker's Green or Cobalt Blue Hue"),
    YAML_TEXT("support", PLACE(support), .default_text = "drawing paper",
              .doc = "of the paint: drawing paper or acrylic board"),
    YAML_INTEGER("water_percent", PLACE(water_percent), 0, 90, .unit = "%", .doc = "of the paint, by weight"),
    YAML_NUMBER("sigma", PLACE(sigma), 0, 1.5,
                .doc =
                    "a parameter set of your own: diffuse roughness, with gamma, beta_prime, n and spectrum"),
    YAML_NUMBER("gamma", PLACE(gamma), 0, 1.5, .doc = "specular roughness"),
    YAML_NUMBER("beta_prime", PLACE(beta_prime), 0, 10000, .doc = "height of the specular lobe"),
    YAML_NUMBER("n", PLACE(n), 0, 5, .doc = "refractive index"),
    YAML_TEXT("spectrum", PLACE(spectrum), .doc = "CSV lambda_nm,value: S(lambda) over 380..780 nm"),
    YAML_TEXT("brdf", PLACE(brdf), .doc = "a measured surface"),
    {0}};

static const struct yaml_key KEYS[] = {
    YAML_INTEGER("seed", AT(seed), 0, 2147483647, .default_text = "1",
                 .doc = "of every draw; the same seed is the same bench"),
    YAML_FLAG("quiet", AT(bench.quiet), .default_text = "false", .doc = "no noise, no drift, no draws"),
    YAML_NUMBER("reply_delay_ms", AT(reply_delay_ms), 0, 10000, .default_text = "0", .unit = "ms",
                .doc = "of every Modbus reply"),
    YAML_TEXTS("modbus", AT(bus), AT(n_buses),
               .doc = "buses: tcp:PORT (0 = any free one), rtu (a pty) or rtu:LINK to it"),
    YAML_PART("spectrometer", SPECTROMETER, .doc = "the instrument at the fibre"),
    YAML_PART("optics", OPTICS, .doc = "spots and stray light"),
    YAML_PART("lamp", LAMP, .doc = "the lamp; the spectrometer's lamp line is its shutter"),
    YAML_NUMBER("certificate_u_rel", AT(bench.certificate_u_rel), 0, 0.2, .default_text = "0.005",
                .doc = "the diffuser differs from its certificate by a draw from it"),
    YAML_PARTS("axes", AT(bench.axis), AT(bench.n_axes), AXES, .doc = "drives; all are on every bus"),
    YAML_PARTS("holder", AT(place), AT(n_places), PLACES, .doc = "what stands where"),
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

static int finish(struct goniosim_config *c, struct err_list *errors) {
    size_t before = errors->n;
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

int goniosim_config_read(const char *path, struct goniosim_config *c, struct err_list *errors) {
    defaults(c);
    return path && yaml_read_file(path, KEYS, c, errors) != 0 ? -ERR_INPUT : finish(c, errors);
}

int goniosim_config_read_text(const char *file, const char *text, size_t size, struct goniosim_config *c,
                              struct err_list *errors) {
    defaults(c);
    return yaml_read_text(file, text, size, KEYS, c, errors) != 0 ? -ERR_INPUT : finish(c, errors);
}

void goniosim_config_free(struct goniosim_config *c) {
    for (int i = 0; i < c->n_places; i++)
        measured_free(c->place[i].measured);
}

void goniosim_config_print_reference(FILE *out) {
    yaml_print_reference(out, "goniosim.yaml", KEYS);
}
