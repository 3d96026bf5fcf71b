#include "fit/render/shape.h"

/* The nearest crossing of the mantle. The discriminant is taken from how far the ray misses the axis: squares of the
 * long way from the camera would cancel. */
static bool mantle(const struct shape_cylinder *c, struct vec3 o, struct vec3 d, double near_mm, double *t) {
    double flat2 = d.x * d.x + d.z * d.z, miss = o.x * d.z - o.z * d.x, r = c->radius_mm;
    double room = r * r * flat2 - miss * miss;
    if (!(room >= 0 && flat2 > 0)) {
        return false;
    }
    *t = -(o.x * d.x + o.z * d.z + sqrt(room)) / flat2;
    return *t > near_mm && fabs(o.y + *t * d.y) <= c->length_mm / 2;
}

static bool disc(const struct shape_cylinder *c, struct vec3 o, struct vec3 d, double near_mm, double *t) {
    if (c->open || d.y == 0) {
        return false;
    }
    *t = (copysign(c->length_mm / 2, -d.y) - o.y) / d.y;
    double x = o.x + *t * d.x, z = o.z + *t * d.z;
    return *t > near_mm && x * x + z * z <= c->radius_mm * c->radius_mm;
}

bool shape_cylinder_hit(const struct shape *s, const struct ray *ray, struct hit *hit) {
    struct vec3 o = frame_into(&s->frame, vec3_sub(ray->origin, s->frame.at));
    struct vec3 d = frame_into(&s->frame, ray->direction), normal;
    double t;
    if (mantle(&s->cylinder, o, d, ray->near_mm, &t)) {
        double inverse = 1 / s->cylinder.radius_mm; /* the length that the normal has */
        normal = (struct vec3){(o.x + t * d.x) * inverse, 0, (o.z + t * d.z) * inverse};
    } else if (disc(&s->cylinder, o, d, ray->near_mm, &t)) {
        normal = (struct vec3){0, copysign(1, -d.y), 0};
    } else {
        return false;
    }
    if (t >= hit->t_mm) {
        return false;
    }
    hit->t_mm = t;
    hit->position = vec3_add(ray->origin, vec3_scale(ray->direction, t));
    hit->normal = frame_out(&s->frame, normal);
    hit->paint = s->paint_of[0];
    return true;
}
