#include "daemon/config_keys.h"

#include <string.h>

#include "daemon/config.h"
#include "proto/yaml_table.h"

#define AT(field) struct config, field
#define AXIS_AT(field) struct config_axis, field

static const char *const shutters[] = {"lamp-line", "none", "manual", NULL};
static const char *const fillings[] = {"view-in-beam", "beam-in-view", NULL};

static void read_interval(struct yaml_reader *r, const struct yaml_node *node, double interval[2]) {
    if (!yaml_is_list(node) || yaml_count(node) != 2) {
        yaml_error(r, node, "expected two angles in degrees, [low, high]");
        return;
    }
    for (size_t i = 0; i < 2; i++)
        if (yaml_read_double(r, yaml_item(node, i), &interval[i]) == 0 &&
            !(interval[i] >= -360 && interval[i] <= 360))
            yaml_error(r, yaml_item(node, i), "an angle of an axis lies within -360 .. 360 deg");
}

static int read_limits(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct config_axis *axis = object;
    read_interval(r, node, axis->limits_deg);
    axis->has_limits = true;
    return 0;
}

static int read_zone_source(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    read_interval(r, node, ((struct config_zone *)object)->source_deg);
    return 0;
}

static int read_zone_sample(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    read_interval(r, node, ((struct config_zone *)object)->sample_deg);
    return 0;
}

static int read_positions(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct config_axis *axis = object;
    axis->n_positions = 0;
    if (!yaml_is_map(node)) {
        yaml_error(r, node, "expected names with angles, {sample: 0, reference: 90}");
        return 0;
    }
    for (size_t i = 0; i < yaml_count(node); i++) {
        const char *name = yaml_item_name(node, i);
        if (i >= CONFIG_POSITIONS || strlen(name) >= sizeof axis->position[0].name) {
            yaml_error(r, yaml_item_key(node, i),
                       "a holder has at most %d positions, with names of at most %d bytes", CONFIG_POSITIONS,
                       (int)sizeof axis->position[0].name - 1);
            return 0;
        }
        struct config_position *position = &axis->position[axis->n_positions++];
        strcpy(position->name, name);
        yaml_read_double(r, yaml_item(node, i), &position->deg);
    }
    return 0;
}

static int read_parity(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    const char *text = yaml_text(node);
    if (!text || strlen(text) != 1 || !strchr("NEO", text[0]))
        yaml_error(r, node, "the parity is N, E or O");
    else
        ((struct config_axis *)object)->parity = text[0];
    return 0;
}

/* `profile: X, ...`, `{fixed_deg: X}` or the word manual: what a key of the file may say of an axis. */
static int read_axis(struct yaml_reader *r, const struct yaml_node *node, struct config_axis *axis) {
    const char *word = yaml_text(node);
    if (word && strcmp(word, "manual") == 0) {
        axis->kind = CONFIG_AXIS_MANUAL;
        return 0;
    }
    if (!yaml_is_map(node)) {
        yaml_error(r, node,
                   "expected a motor {profile: NAME, link: ..., unit: N}, {fixed_deg: ANGLE} or manual");
        return 0;
    }
    if (yaml_find(node, "fixed_deg")) {
        axis->kind = CONFIG_AXIS_FIXED;
        return yaml_read_map(r, node, config_fixed_keys, axis);
    }
    axis->kind = CONFIG_AXIS_MOTOR;
    return yaml_read_map(r, node, config_axis_keys, axis);
}

static int read_source(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    return read_axis(r, node, &((struct config *)object)->source);
}

static int read_sample(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    return read_axis(r, node, &((struct config *)object)->sample);
}

static int read_holder(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    return read_axis(r, node, &((struct config *)object)->holder);
}

static const struct yaml_key polarisation_keys[] = {
    YAML_NUMBER("value", AT(optics.polarisation_p), -1, 1, .required = true, .doc = "P"),
    YAML_NUMBER("u", AT(optics.u_polarisation), 0, 0.5, .required = true, .doc = "its standard uncertainty"),
    {0}};

static int read_polarisation(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct config *config = object;
    const char *word = yaml_text(node);
    config->optics.polarisation = !word                          ? POLARISATION_STATED
                                  : strcmp(word, "unknown") == 0 ? POLARISATION_UNKNOWN
                                                                 : POLARISATION_DEPOLARISED;
    if (yaml_is_map(node))
        return yaml_read_map(r, node, polarisation_keys, object);
    if (!word || (strcmp(word, "unknown") != 0 && strcmp(word, "depolarised") != 0))
        yaml_error(r, node, "expected unknown, depolarised or {value: P, u: U}");
    return 0;
}

static const struct yaml_key spectrometer_keys[] = {
    YAML_TEXT("model", AT(spectrometer.model), .required = true,
              .doc = "usb2000plus (also Flame-S), usb4000 (also Flame-T)"),
    YAML_TEXT("link", AT(spectrometer.link), .default_text = "usb",
              .doc = "usb, usbredir:unix:PATH, usbredir:tcp:HOST:PORT, or sim:usb under `goniod --simulate`"),
    YAML_TEXT(
        "serial", AT(spectrometer.serial),
        .doc =
            "serial number as in the EEPROM; another unit is refused. Left out: the only one found is taken"),
    YAML_NUMBER("linearity_u_rel", AT(spectrometer.linearity_u_rel), 0, 0.1, .default_text = "5e-4",
                .doc = "relative u of the linearised counts at full scale. The default is an assumption: no "
                       "maker states what its polynomial leaves. Each campaign tests it on the diffuser at "
                       "two exposure times; what it sees beyond takes its place, with a warning"),
    {0}};

static const struct yaml_key lamp_keys[] = {
    YAML_NUMBER("warm_up_min", AT(lamp_warm_up_min), 0, 1440, .default_text = "30", .unit = "min",
                .doc = "time the lamp burns before the first reading"),
    {0}};

static const struct yaml_key optics_keys[] = {
    YAML_NUMBER("beam_mm", AT(optics.beam_mm), 0.1, 500, .required = true, .unit = "mm",
                .doc = "diameter of the illuminated spot at normal incidence"),
    YAML_NUMBER("view_mm", AT(optics.view_mm), 0.1, 500, .required = true, .unit = "mm",
                .doc = "diameter of the spot the sensor sees at normal view"),
    YAML_WORD("filling", AT(optics.filling), fillings, .default_text = "view-in-beam",
              .doc = "which spot lies inside the other, at every geometry of a plan"),
    YAML_NUMBER("source_width_deg", AT(optics.source_width_deg), 0, 20, .default_text = "0", .unit = "deg",
                .doc = "full angular width of the source"),
    YAML_NUMBER("sensor_width_deg", AT(optics.sensor_width_deg), 0, 20, .default_text = "0", .unit = "deg",
                .doc = "full angular width of the sensor"),
    YAML_OWN("polarisation", read_polarisation, .default_text = "unknown",
             .doc = "how much source and sensor together prefer the light across the plane of incidence: "
                    "unknown, depolarised, or a measured P = (across - along) / (across + along) as {value: "
                    "P, u: U}, -1 to 1; P is then fitted from there"),
    {0}};

static const struct yaml_key axes_keys[] = {
    YAML_OWN("source", read_source, .required = true, .doc = "the arm of the light source: a motor"),
    YAML_OWN("sample", read_sample, .required = true,
             .doc = "the turntable of the sample: a motor, manual, or {fixed_deg: ANGLE}"),
    {0}};

static const struct yaml_key access_keys[] = {
    YAML_TEXTS("watch", AT(watch), AT(n_watch), .default_text = "[users]", .doc = "groups that may watch"),
    YAML_TEXTS("operate", AT(operate), AT(n_operate), .default_text = "[goniod]",
               .doc = "groups that may command"),
    {0}};

const struct yaml_key config_fixed_keys[] = {
    YAML_NUMBER("fixed_deg", AXIS_AT(fixed_deg), -90, 90, .required = true, .unit = "deg",
                .doc = "the angle at which the axis is fixed"),
    YAML_NUMBER("u_zero_deg", AXIS_AT(u_zero_deg), 0, 5, .default_text = "0", .unit = "deg",
                .doc = "standard uncertainty of that angle"),
    {0}};

const struct yaml_key config_axis_keys[] = {
    YAML_TEXT("profile", AXIS_AT(profile), .required = true,
              .doc = "register-map profile of the drive, as om-az"),
    YAML_TEXT("link", AXIS_AT(link), .required = true,
              .doc = "rtu:PATH, tcp:HOST:PORT, or sim:modbus; axes with the same link share one bus"),
    YAML_INTEGER("unit", AXIS_AT(unit), 1, 247, .required = true, .doc = "Modbus unit id"),
    YAML_NUMBER(
        "zero_deg", AXIS_AT(zero_deg), -360, 360, .default_text = "0", .unit = "deg",
        .doc = "direction * raw position at the axis' zero: what `gonioctl where` reads there with 0 here"),
    YAML_INTEGER("direction", AXIS_AT(direction), -1, 1, .default_text = "1",
                 .doc = "1, or -1 where the drive counts the other way"),
    YAML_OWN(
        "limits_deg", read_limits, .unit = "deg",
        .doc =
            "soft limits [low, high]; source and sample must have them, the holder's default is -180 .. 360"),
    YAML_NUMBER("blind_deg", AXIS_AT(blind_deg), 0, 90, .unit = "deg",
                .doc = "source only: nearer to the sensor than this, one housing shades the other"),
    YAML_OWN("positions", read_positions,
             .doc = "holder only: names with angles, {sample: 0, reference: 90, trap: 180}"),
    YAML_INTEGER("baud", AXIS_AT(baud), 1200, 4000000,
                 .doc = "RTU speed where it differs from the profile's"),
    YAML_OWN("parity", read_parity, .doc = "RTU parity N, E or O where it differs from the profile's"),
    YAML_INTEGER("response_ms", AXIS_AT(response_ms), 1, 10000, .unit = "ms",
                 .doc = "time within which a unit answers where it differs from the profile's"),
    YAML_NUMBER("u_zero_deg", AXIS_AT(u_zero_deg), 0, 5, .default_text = "0", .unit = "deg",
                .doc = "standard uncertainty of the zero, from alignment"),
    YAML_NUMBER("u_repeat_deg", AXIS_AT(u_repeat_deg), 0, 5, .unit = "deg",
                .doc = "repeatability of a move where it differs from the profile's"),
    YAML_NUMBER("u_transmission_deg", AXIS_AT(u_transmission_deg), 0, 5, .unit = "deg",
                .doc = "error of the transmission where it differs from the profile's"),
    {0}};

const struct yaml_key config_zone_keys[] = {YAML_OWN("source_deg", read_zone_source, .required = true,
                                                     .unit = "deg", .doc = "[low, high] of the source axis"),
                                            YAML_OWN("sample_deg", read_zone_sample, .required = true,
                                                     .unit = "deg", .doc = "[low, high] of the sample axis"),
                                            {0}};

const struct yaml_key config_keys[] = {
    YAML_PART("spectrometer", spectrometer_keys, .required = true, .doc = "the spectrometer"),
    YAML_WORD(
        "shutter", AT(shutter), shutters, .default_text = "lamp-line",
        .doc = "how the light is shut off for a dark: the spectrometer's lamp line, not at all, or by hand"),
    YAML_PART("lamp", lamp_keys, .default_text = "{}", .doc = "the lamp"),
    YAML_PART("optics", optics_keys, .required = true, .doc = "spots and angular widths"),
    YAML_PART("axes", axes_keys, .required = true,
              .doc = "the axes of the goniometer, in degrees from the sensor's optical axis"),
    YAML_OWN("holder", read_holder, .default_text = "manual",
             .doc = "what brings sample and reference into the beam: a motor with `positions`, or manual"),
    YAML_PARTS("keep_out", AT(keep_out), AT(n_keep_out), config_zone_keys,
               .doc = "forbidden while both axes are inside their intervals, also on the way"),
    YAML_PART("access", access_keys, .default_text = "{}",
              .doc = "who may watch and command over the socket"),
    YAML_TEXTS("notify", AT(notify), AT(n_notify),
               .doc = "programs that are run with each event as JSON on stdin; they never delay a campaign"),
    {0}};
