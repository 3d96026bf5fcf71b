#include "fit/render/light.h"

struct kind { /* NULL: nothing to do, or nothing to meet */
    const char *name;
    int (*prepare)(struct light *light, const char *folder, struct err *e);
    void (*free)(struct light *light);
    bool (*sample)(const struct light *light, struct vec3 from, const double u[2],
                   struct light_sample *sample);
    bool (*meet)(const struct light *light, struct vec3 from, struct vec3 l, struct light_sample *sample);
};

static const struct kind kinds[LIGHT_KINDS] = {
    [LIGHT_BEAM] = {.name = "beam"},
    [LIGHT_RECTANGLE] = {"rectangle", light_rectangle_prepare, NULL, light_rectangle_sample,
                         light_rectangle_meet},
    [LIGHT_SPHERE] = {"sphere", light_sphere_prepare, NULL, light_sphere_sample, light_sphere_meet},
    [LIGHT_ENVIRONMENT] = {"environment", light_environment_prepare, light_environment_free,
                           light_environment_sample, light_environment_meet},
};

const char *light_name(enum light_kind kind) {
    return kinds[kind].name;
}

bool light_has_extent(const struct light *light) {
    return light->kind != LIGHT_BEAM;
}

int light_prepare(struct light *light, const char *folder, struct err *e) {
    return kinds[light->kind].prepare ? kinds[light->kind].prepare(light, folder, e) : 0;
}

void light_free(struct light *light) {
    if (kinds[light->kind].free) {
        kinds[light->kind].free(light);
    }
}

void light_aim(struct light *light, int picture) {
    if (light->kind == LIGHT_BEAM) {
        light_beam_aim(light, picture);
    }
}

bool light_sample(const struct light *light, struct vec3 from, const double u[2],
                  struct light_sample *sample) {
    return kinds[light->kind].sample && kinds[light->kind].sample(light, from, u, sample);
}

double light_radiance(const struct light *light, struct vec3 from, struct vec3 l,
                      struct light_sample *sample) {
    sample->l = l;
    bool met = kinds[light->kind].meet && kinds[light->kind].meet(light, from, l, sample);
    return met ? sample->radiance : 0;
}

double light_size_mm(const struct light *light) {
    switch (light->kind) {
    case LIGHT_RECTANGLE:
        return fmax(light->rectangle.width_mm, light->rectangle.height_mm);
    case LIGHT_SPHERE:
        return 2 * light->radius_mm;
    case LIGHT_ENVIRONMENT:
        return INFINITY;
    default:
        return 0;
    }
}
