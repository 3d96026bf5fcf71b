#include "fit/render/light.h"

static struct vec3 to_middle(const struct light *light, struct vec3 from) {
    return vec3_sub((struct vec3){light->at_mm[0], light->at_mm[1], light->at_mm[2]}, from);
}

/* sin^2 of the half angle under which it is seen; 1 or more from inside. */
static double sine_squared(const struct light *light, struct vec3 way) {
    return light->radius_mm * light->radius_mm / vec3_dot(way, way);
}

/* 1 - cos of that angle, without cancellation. */
static double cap_of(double sin2) {
    return sin2 / (1 + sqrt(1 - sin2));
}

int light_sphere_prepare(struct light *light, const char *folder, struct err *e) {
    double sin2 = sine_squared(light, to_middle(light, (struct vec3){0, 0, 0}));
    (void)folder;
    if (!(sin2 < 1)) {
        return err_set(
            e, ERR_INPUT,
            "this sphere holds the scene's origin, which a light must shine on from outside: move it away, "
            "or take an environment");
    }
    light->radiance = 1 / sin2; /* the illuminance of a sphere is pi L sin^2 */
    return 0;
}

bool light_sphere_sample(const struct light *light, struct vec3 from, const double u[2],
                         struct light_sample *sample) {
    struct vec3 way = to_middle(light, from), s, t;
    double sin2 = sine_squared(light, way);
    if (!(sin2 < 1)) {
        return false;
    }
    double cap = cap_of(sin2), height = u[0] * cap, azimuth = 2 * M_PI * u[1]; /* height: 1 - cos */
    double sine = sqrt(height * (2 - height)), distance = vec3_length(way);
    struct vec3 z = vec3_scale(way, 1 / distance);
    vec3_frame(z, &s, &t);
    struct vec3 across = vec3_add(vec3_scale(s, cos(azimuth)), vec3_scale(t, sin(azimuth)));
    sample->l = vec3_add(vec3_scale(z, 1 - height), vec3_scale(across, sine));
    double inside = light->radius_mm * light->radius_mm - distance * distance * sine * sine;
    sample->distance_mm = distance * (1 - height) - sqrt(fmax(inside, 0));
    sample->density = 1 / (2 * M_PI * cap);
    sample->radiance = light->radiance;
    return true;
}

bool light_sphere_meet(const struct light *light, struct vec3 from, struct vec3 l,
                       struct light_sample *sample) {
    struct vec3 way = to_middle(light, from), off = vec3_cross(way, l);
    double sin2 = sine_squared(light, way), along = vec3_dot(way, l);
    double inside = light->radius_mm * light->radius_mm - vec3_dot(off, off);
    if (!(sin2 < 1 && along > 0 && inside > 0)) {
        return false;
    }
    sample->distance_mm = along - sqrt(inside);
    sample->density = 1 / (2 * M_PI * cap_of(sin2));
    sample->radiance = light->radiance;
    return true;
}
