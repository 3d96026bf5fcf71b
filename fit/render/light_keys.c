#include <math.h>
#include <stddef.h>

#include "fit/render/light.h"
#include "fit/render/scene_keys.h"

#define AT_LIGHT(field) offsetof(struct light, field)
#define AT_RECTANGLE(field) AT_LIGHT(rectangle) + offsetof(struct light_rectangle, field)
#define AT_ENVIRONMENT(field) AT_LIGHT(environment) + offsetof(struct light_environment, field)

#define SPD                                                                                                  \
    {                                                                                                        \
        .name = "spd", .type = YAML_STRING, .offset = AT_LIGHT(spd_name),                                    \
        .size = sizeof((struct light *)0)->spd_name, .default_text = "D65",                                  \
        .doc = "A, D50, D65, F2, F7, F11, a daylight as \"5003 K\", or a file NAME.csv with lambda_nm,value" \
    }
#define WEIGHT                                                                                               \
    {                                                                                                        \
        .name = "weight", .type = YAML_DOUBLE, .offset = AT_LIGHT(weight), .low = 0, .high = 1e6,            \
        .default_text = "1",                                                                                 \
        .doc = "the illuminance that it gives the scene's origin, relative to the other lights"              \
    }
#define MIDDLE SCENE_VECTOR("at_mm", AT_LIGHT(at_mm), AT_LIGHT(n_at), NULL, "its middle")

static void add_theta(struct yaml_reader *r, const struct yaml_node *node, struct light *light, double deg) {
    if (!(deg >= -180 && deg <= 180)) {
        yaml_error(r, node, "%g deg is outside -180 .. 180 deg", deg);
    } else if (light->n_theta == LIGHT_ANGLES) {
        yaml_error(r, node, "more than %d angles in one series", LIGHT_ANGLES);
    } else {
        light->theta_deg[light->n_theta++] = deg;
    }
}

struct sweep {
    double from, to, step;
};

static const struct yaml_key sweep_keys[] = {{.name = "from",
                                              .type = YAML_DOUBLE,
                                              .offset = offsetof(struct sweep, from),
                                              .required = true,
                                              .unit = "deg",
                                              .doc = "first angle"},
                                             {.name = "to",
                                              .type = YAML_DOUBLE,
                                              .offset = offsetof(struct sweep, to),
                                              .required = true,
                                              .unit = "deg",
                                              .doc = "last angle"},
                                             {.name = "step",
                                              .type = YAML_DOUBLE,
                                              .offset = offsetof(struct sweep, step),
                                              .low = 0.01,
                                              .high = 360,
                                              .required = true,
                                              .unit = "deg",
                                              .doc = "from one picture to the next"},
                                             {0}};

static void read_sweep(struct yaml_reader *r, const struct yaml_node *node, struct light *light) {
    struct sweep sweep = {0};
    if (yaml_read_map(r, node, sweep_keys, &sweep)) {
        return;
    }
    int last = (int)floor((sweep.to - sweep.from) / sweep.step + 1e-9);
    if (last < 0) {
        yaml_error(r, node, "from %g to %g deg runs backwards: `from` is the smaller angle", sweep.from,
                   sweep.to);
    }
    for (int i = 0; i <= last && i <= LIGHT_ANGLES; i++) {
        add_theta(r, node, light, sweep.from + i * sweep.step);
    }
}

static int read_theta(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct light *light = object;
    double deg;
    light->n_theta = 0;
    if (yaml_is_map(node)) {
        read_sweep(r, node, light);
    } else if (yaml_is_list(node)) {
        for (size_t i = 0; i < yaml_count(node); i++) {
            if (yaml_read_double(r, yaml_item(node, i), &deg) == 0) {
                add_theta(r, yaml_item(node, i), light, deg);
            }
        }
    } else if (yaml_read_double(r, node, &deg) == 0) {
        add_theta(r, node, light, deg);
    }
    return 0;
}

static const struct yaml_key beam_keys[] = {
    {.name = "theta_deg",
     .type = YAML_CUSTOM,
     .custom = read_theta,
     .required = true,
     .unit = "deg",
     .doc = "angle from the z axis; a list or {from, to, step} makes a series of pictures"},
    {.name = "azimuth_deg",
     .type = YAML_DOUBLE,
     .offset = AT_LIGHT(azimuth_deg),
     .low = -360,
     .high = 360,
     .default_text = "0",
     .unit = "deg",
     .doc = "where it comes from: 0 right, 90 above, 180 left"},
    SPD,
    WEIGHT,
    {0}};

static const struct yaml_key rectangle_keys[] = {
    MIDDLE,
    SCENE_VECTOR("look_at_mm", AT_RECTANGLE(look_at_mm), AT_RECTANGLE(n_look_at), "[0, 0, 0]",
                 "what it faces; it shines to that side only"),
    SCENE_VECTOR("up", AT_RECTANGLE(up), AT_RECTANGLE(n_up), "[0, 1, 0]", "along its height, about"),
    SCENE_LENGTH("width_mm", AT_RECTANGLE(width_mm), true, NULL, "across `up`"),
    SCENE_LENGTH("height_mm", AT_RECTANGLE(height_mm), true, NULL, "along `up`"),
    SPD,
    WEIGHT,
    {0}};

static const struct yaml_key sphere_keys[] = {
    MIDDLE, SCENE_LENGTH("radius_mm", AT_LIGHT(radius_mm), true, NULL, "radius"), SPD, WEIGHT, {0}};

static const struct yaml_key environment_keys[] = {
    {.name = "image",
     .type = YAML_STRING,
     .offset = AT_ENVIRONMENT(image),
     .size = sizeof((struct light_environment *)0)->image,
     .required = true,
     .doc = "radiance by latitude (rows, from +y down) and longitude (the middle column at -z, +x to its "
            "right): an "
            "EXR with Y, or R, G, B taken as linear sRGB's luminance; or a PNG, its codes taken as linear"},
    SCENE_VECTOR("turn_deg", AT_ENVIRONMENT(turn_deg), AT_ENVIRONMENT(n_turn), "[0, 0, 0]",
                 "turned about x, then y, then z"),
    SPD,
    WEIGHT,
    {0}};

#define LIGHT(key, kind, table, text)                                                                        \
    {                                                                                                        \
        .name = key, .type = YAML_MAP, .offset = 0, .keys = table,                                           \
        .set_offset = AT_LIGHT(given) + (kind) * sizeof(bool) + 1, .doc = text                               \
    }

const struct yaml_key scene_light_keys[] = {
    LIGHT("beam", LIGHT_BEAM, beam_keys, "parallel light"),
    LIGHT("rectangle", LIGHT_RECTANGLE, rectangle_keys, "a panel, equally bright all over"),
    LIGHT("sphere", LIGHT_SPHERE, sphere_keys, "a ball, equally bright all over"),
    LIGHT("environment", LIGHT_ENVIRONMENT, environment_keys,
          "light from all around, infinitely far away, of one spectrum"),
    {0}};
