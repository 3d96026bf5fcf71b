#include "fit/render/camera.h"

static struct vec3 vector(const double v[3]) {
    return (struct vec3){v[0], v[1], v[2]};
}

/* Half the height of the picture at the distance 1. */
static double half_height(const struct camera *c) {
    return c->kind == CAMERA_ORTHOGRAPHIC ? c->height_mm / 2 : tan(rad_from_deg(c->height_deg) / 2);
}

int camera_prepare(struct camera *c, int width, int height, double reach_mm, struct err *e) {
    struct vec3 at = vector(c->look_at_mm);
    struct vec3 back =
        c->kind == CAMERA_ORTHOGRAPHIC ? vector(c->from) : vec3_sub(vector(c->position_mm), at);
    struct vec3 right = vec3_cross(vector(c->up), back);
    if (!(vec3_length(back) > 0)) {
        return err_set(e, ERR_INPUT,
                       "the camera looks nowhere: give it a direction, or a place other than look_at_mm");
    }
    if (!(vec3_length(right) > 1e-9 * vec3_length(back) * vec3_length(vector(c->up)))) {
        return err_set(e, ERR_INPUT,
                       "the camera looks along `up`; give another direction for up, as [0, 0, -1]");
    }
    double step = half_height(c) / (height / 2.0);
    c->forward = vec3_scale(vec3_unit(back), -1);
    right = vec3_unit(right);
    c->right = vec3_scale(right, step);
    c->down = vec3_scale(vec3_cross(vec3_scale(c->forward, -1), right), -step);
    c->half_width = width / 2.0;
    c->half_height = height / 2.0;
    c->reach_mm = reach_mm;
    c->origin = c->kind == CAMERA_PERSPECTIVE ? vector(c->position_mm)
                                              : vec3_sub(at, vec3_scale(c->forward, reach_mm));
    return 0;
}

struct ray camera_ray(const struct camera *c, double u, double v) {
    struct vec3 step =
        vec3_add(vec3_scale(c->right, u - c->half_width), vec3_scale(c->down, v - c->half_height));
    if (c->kind == CAMERA_ORTHOGRAPHIC) {
        return (struct ray){vec3_add(c->origin, step), c->forward, 0};
    }
    return (struct ray){c->origin, vec3_unit(vec3_add(c->forward, step)), 0};
}
