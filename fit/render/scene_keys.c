#include "fit/render/scene_keys.h"

#include <stddef.h>

#include "fit/render/path.h"
#include "fit/render/scene.h"

#define AT_SCENE(field) offsetof(struct scene, field)
#define AT_MATERIAL(field) offsetof(struct scene_material, field)
#define AT_CAMERA(field) offsetof(struct camera, field)
#define AT_IMAGE(field) offsetof(struct scene_image, field)

#define PARAMETER(key, field, lowest, before, text)                                                          \
    {                                                                                                        \
        .name = key, .type = YAML_DOUBLE, .offset = AT_MATERIAL(field), .low = lowest, .high = 1e50,         \
        .default_text = before, .doc = text                                                                  \
    }

const char *const scene_models[] = {"lambert",    "oren-nayar",  "eq1",      "composite",
                                    "heavy-tail", "transmitted", "two-lobe", NULL};
const char *const scene_observers[] = {"1931-2deg", "1964-10deg", NULL};
const char *const scene_spaces[] = {"srgb", "display-p3", "adobe-rgb", NULL};
const char *const scene_energies[] = {"scale", "report", NULL};
const char *const scene_adaptations[] = {"none", "von-kries", "bradford", "cat16", NULL};

static const struct yaml_key material_keys[] = {
    {.name = "name",
     .type = YAML_STRING,
     .offset = AT_MATERIAL(name),
     .size = sizeof((struct scene_material *)0)->name,
     .required = true,
     .doc = "what shapes call it"},
    {.name = "session",
     .type = YAML_STRING,
     .offset = AT_MATERIAL(session),
     .size = sizeof((struct scene_material *)0)->session,
     .doc = "a session file: its last estimate; or the keys below"},
    {.name = "spectrum",
     .type = YAML_STRING,
     .offset = AT_MATERIAL(spectrum),
     .size = sizeof((struct scene_material *)0)->spectrum,
     .doc = "CSV `lambda_nm,value`: S(lambda)"},
    {.name = "uniform",
     .type = YAML_DOUBLE,
     .offset = AT_MATERIAL(uniform),
     .high = 1e6,
     .set_offset = AT_MATERIAL(has_uniform) + 1,
     .doc = "the same S at all wavelengths, instead of a spectrum"},
    {.name = "model",
     .type = YAML_CHOICE,
     .offset = AT_MATERIAL(model),
     .choices = scene_models,
     .default_text = "composite",
     .doc = "reflection model"},
    PARAMETER("sigma", sigma, 0, "0", "diffuse roughness"),
    PARAMETER("gamma", gamma, 1e-9, "0.1", "specular roughness"),
    PARAMETER("beta_prime", beta_prime, 0, "0", "specular coefficient"),
    PARAMETER("n", n, 1, "1.5", "refractive index"),
    PARAMETER("tail", tail, 0, "0", "of the lobe, heavy-tail alone: 0 (Gaussian) to 2"),
    PARAMETER("n_d", n_d, 1, "1", "index of the surface that diffuse light passes, transmitted alone"),
    PARAMETER("gamma_2", gamma_2, 1e-9, "0.3", "roughness of the second lobe, two-lobe alone"),
    PARAMETER("beta_prime_2", beta_prime_2, 0, "0", "its coefficient"),
    PARAMETER("kappa", kappa, 0, "1", "of the interreflection; pi is the paper's printed form"),
    {0}};

static const struct yaml_key orthographic_keys[] = {
    SCENE_VECTOR("look_at_mm", AT_CAMERA(look_at_mm), AT_CAMERA(n_look_at), "[0, 0, 0]",
                 "the middle of the picture"),
    SCENE_VECTOR("from", AT_CAMERA(from), AT_CAMERA(n_from), "[0, 0, 1]", "direction towards the camera"),
    SCENE_VECTOR("up", AT_CAMERA(up), AT_CAMERA(n_up), "[0, 1, 0]", "what is up in the picture"),
    SCENE_LENGTH("height_mm", AT_CAMERA(height_mm), true, NULL, "height of what is seen"),
    {0}};

static const struct yaml_key perspective_keys[] = {
    SCENE_VECTOR("look_at_mm", AT_CAMERA(look_at_mm), AT_CAMERA(n_look_at), "[0, 0, 0]",
                 "the middle of the picture"),
    SCENE_VECTOR("position_mm", AT_CAMERA(position_mm), AT_CAMERA(n_position), NULL,
                 "where the camera stands"),
    SCENE_VECTOR("up", AT_CAMERA(up), AT_CAMERA(n_up), "[0, 1, 0]", "what is up in the picture"),
    {.name = "height_deg",
     .type = YAML_DOUBLE,
     .offset = AT_CAMERA(height_deg),
     .low = 0.001,
     .high = 170,
     .default_text = "30",
     .unit = "deg",
     .doc = "vertical angle of view"},
    {0}};

#define CAMERA(key, kind, table, text)                                                                       \
    {                                                                                                        \
        .name = key, .type = YAML_MAP, .offset = 0, .keys = table,                                           \
        .set_offset = AT_CAMERA(given) + (kind) * sizeof(bool) + 1, .doc = text                              \
    }

static const struct yaml_key camera_keys[] = {
    CAMERA("orthographic", CAMERA_ORTHOGRAPHIC, orthographic_keys, "parallel rays"),
    CAMERA("perspective", CAMERA_PERSPECTIVE, perspective_keys, "rays from one point"),
    {0}};

#define COUNT(key, field, lowest, highest, before, text)                                                     \
    {                                                                                                        \
        .name = key, .type = YAML_INT, .offset = AT_IMAGE(field), .low = lowest, .high = highest,            \
        .default_text = before, .doc = text                                                                  \
    }
#define CHOICE(key, field, names, before, text)                                                              \
    {                                                                                                        \
        .name = key, .type = YAML_CHOICE, .offset = AT_IMAGE(field), .choices = names,                       \
        .default_text = before, .doc = text                                                                  \
    }

static const struct yaml_key image_keys[] = {
    COUNT("width", width, 1, 16384, "400", "pixels"),
    COUNT("height", height, 1, 16384, "400", "pixels"),
    COUNT("grid", grid, 1, 64, "4", "grid x grid samples in each pixel"),
    COUNT("bounces", bounces, 1, PATH_STEPS + 1, "1",
          "surfaces that light may come over on its way; 1: each is lit by the lights alone"),
    CHOICE(
        "energy", energy, scene_energies, "scale",
        "beyond the first bounce a paint that returns more light than it receives is scaled down to what it "
        "receives; report: only told"),
    COUNT("samples", samples, 1, 1 << 20, "64",
          "of a light with extent and of paths of several bounces, drawn at random in each pixel; made up to "
          "4, 8, 12, ... for each of the "
          "grid's"),
    CHOICE("observer", observer, scene_observers, "1931-2deg", "whose colour matching functions"),
    CHOICE("space", space, scene_spaces, "srgb", "the RGB space of the picture"),
    CHOICE("adaptation", adaptation, scene_adaptations, "bradford",
           "from the light's white to that of the space"),
    {.name = "bits",
     .type = YAML_INT,
     .offset = AT_IMAGE(bits),
     .low = 8,
     .high = 16,
     .default_text = "8",
     .doc = "of each channel: 8 or 16"},
    {.name = "exposure",
     .type = YAML_DOUBLE,
     .offset = AT_IMAGE(exposure),
     .low = 1e-9,
     .high = 1e9,
     .default_text = "1",
     .doc = "Y of the perfect diffuser facing the light, in the picture"},
    {0}};

const struct yaml_key scene_keys[] = {{.name = "name",
                                       .type = YAML_STRING,
                                       .offset = AT_SCENE(name),
                                       .size = sizeof((struct scene *)0)->name,
                                       .doc = "what it is, for people"},
                                      {.name = "materials",
                                       .type = YAML_LIST,
                                       .offset = AT_SCENE(material),
                                       .size = sizeof(struct scene_material),
                                       .count_offset = AT_SCENE(n_paints),
                                       .capacity = SCENE_PAINTS,
                                       .keys = material_keys,
                                       .doc = "what the shapes are painted with"},
                                      {.name = "shapes",
                                       .type = YAML_LIST,
                                       .offset = AT_SCENE(shape),
                                       .size = sizeof(struct shape),
                                       .count_offset = AT_SCENE(n_shapes),
                                       .capacity = SCENE_SHAPES,
                                       .keys = scene_shape_keys,
                                       .doc = "each a mapping with one key, its kind"},
                                      {.name = "lights",
                                       .type = YAML_LIST,
                                       .offset = AT_SCENE(light),
                                       .size = sizeof(struct light),
                                       .count_offset = AT_SCENE(n_lights),
                                       .capacity = SCENE_LIGHTS,
                                       .keys = scene_light_keys,
                                       .doc = "each a mapping with one key, its kind"},
                                      {.name = "camera",
                                       .type = YAML_MAP,
                                       .offset = AT_SCENE(camera),
                                       .keys = camera_keys,
                                       .required = true,
                                       .doc = "a mapping with one key, its kind"},
                                      {.name = "image",
                                       .type = YAML_MAP,
                                       .offset = AT_SCENE(image),
                                       .keys = image_keys,
                                       .default_text = "{}",
                                       .doc = "the picture"},
                                      {0}};
